"""The interfaces through which emulated devices access a plant; any model with these can be used."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal, Protocol

from gtsam import Pose3

from drivers.core.contacts import Array


@dataclass(frozen=True)
class TrueContact:
    """One contact of a fingertip in the physics.

    Attributes:
        finger: the finger whose tip it is.
        touched: the thing that it touches.
        point_world_m: point, shape (3,).
        normal_world: unit normal that points out of the touched thing, shape (3,).
        force_on_tip_world_N: force on the fingertip, shape (3,).
        slides_m_s: speed at which the surfaces slide along each other there; a tip that rolls does not slide.
    """

    finger: str
    touched: Literal["object", "table"]
    point_world_m: Array
    normal_world: Array
    force_on_tip_world_N: Array
    slides_m_s: float = 0.0


class HandPlant(Protocol):
    """A hand whose joints move when its motors are driven."""

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
        """Set the duty cycles, -1 to 1, shape (20,), order of ``DRIVEN_JOINTS``."""


class CarriedPlant(Protocol):
    """A positioner that moves."""

    @property
    def stamp_ns(self) -> int:
        """Present time of the model."""

    @property
    def base(self) -> Array:
        """True positioner joints, shape (6,), metres and radians."""

    def move_base(self, target: Array) -> None:
        """Set the targets, shape (6,), metres and radians."""


class LoadedPlant(Protocol):
    """Fingertips that measure their load."""

    @property
    def wrenches(self) -> Array:
        """Load on the five fingertips, shape (5, 6), sensor frames."""


class TouchedPlant(Protocol):
    """Fingertips whose contacts are all known."""

    def contacts(self) -> tuple[TrueContact, ...]:
        """All present contacts of fingertips; one touch may give several points."""

    def world_T_distal(self, finger: str) -> Pose3:
        """True pose of a finger's distal frame."""


class TipPlant(LoadedPlant, TouchedPlant, Protocol):
    """Fingertips with loads and contacts."""

    @property
    def stamp_ns(self) -> int:
        """Present time of the model."""


class SeenPlant(Protocol):
    """An object that a camera sees."""

    @property
    def stamp_ns(self) -> int:
        """Present time of the model."""

    @property
    def world_T_object(self) -> Pose3:
        """True pose of the object."""
