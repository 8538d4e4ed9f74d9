"""What a running session tells whoever watches it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Protocol


@dataclass(frozen=True)
class GraspReport:
    """One grasp, as told live.

    Attributes:
        number: from 1.
        planned: grasps the session was asked for.
        closing: how the hand closed.
        reason: why this grasp was chosen.
        forces_N: contact force of each finger that has a contact.
        missing: fingers without a contact, and why.
        landings: how often the hand came down on the object before it found its way.
        position_sigma_m: uncertainty of the object's place in the table plane, None where nothing is estimated.
        yaw_sigma_rad: uncertainty of the object's rotation.
        explored: share of the surface that is known, 0..1.
        verdict: what the estimation says about the grasp.
        stamp_ns: session clock.
    """

    number: int
    planned: int
    closing: str
    reason: str
    forces_N: Mapping[str, float]
    missing: Mapping[str, str]
    landings: int
    position_sigma_m: float | None
    yaw_sigma_rad: float | None
    explored: float | None
    verdict: str
    stamp_ns: int

    @property
    def contacts(self) -> int:
        """Fingers with a contact."""
        return len(self.forces_N)


class Progress(Protocol):
    """Whoever watches."""

    def phase(self, number: int, name: str) -> None:
        """Grasp ``number`` has come to a step of its cycle."""

    def grasp_done(self, report: GraspReport) -> None:
        """A grasp has been captured and estimated."""

    def on_message(self, message: str) -> None:
        """Something a person should know at once."""

    def on_interrupt(self) -> None:
        """Ctrl+C was pressed, in the midst of anything: only to be noted here."""


class NullProgress:
    """Nobody watches."""

    def phase(self, number: int, name: str) -> None:
        """Not told to anyone."""

    def grasp_done(self, report: GraspReport) -> None:
        """Not told to anyone."""

    def on_message(self, message: str) -> None:
        """Not told to anyone."""

    def on_interrupt(self) -> None:
        """Not told to anyone."""
