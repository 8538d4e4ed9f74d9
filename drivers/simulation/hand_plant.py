"""What the emulated palm and its motors need of a hand: any model with these can stand behind them."""

from __future__ import annotations

from typing import Protocol

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
