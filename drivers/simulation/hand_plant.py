"""What emulated devices need of a plant: any model with these can stand behind them."""

from __future__ import annotations

from typing import Protocol

from gtsam import Pose3

from tactile_lab.geometry.contacts import Array


class HandPlant(Protocol):
    """A hand that turns when its motors are driven."""

    @property
    def stamp_ns(self) -> int:
        """Present time of the model."""

    @property
    def joints_rad(self) -> Array:
        """True joint angles, shape (24,), radians."""

    @property
    def motor_torque_Nm(self) -> Array:
        """Torque of each driven joint's motor, shape (20,), order of ``DRIVEN_JOINTS``."""

    def drive(self, duty: Array) -> None:
        """Duty cycles -1 to 1 from now on, shape (20,), order of ``DRIVEN_JOINTS``."""


class CarriedPlant(Protocol):
    """A positioner that moves."""

    @property
    def stamp_ns(self) -> int:
        """Present time of the model."""

    @property
    def base(self) -> Array:
        """True positioner joints, shape (6,), metres and radians."""

    def move_base(self, target: Array) -> None:
        """Targets from now on, shape (6,), metres and radians."""


class LoadedPlant(Protocol):
    """Fingertips that feel."""

    @property
    def wrenches(self) -> Array:
        """Load on the five fingertips, shape (5, 6), sensor frames."""


class SeenPlant(Protocol):
    """An object that a camera sees."""

    @property
    def stamp_ns(self) -> int:
        """Present time of the model."""

    @property
    def world_T_object(self) -> Pose3:
        """True pose of the object."""
