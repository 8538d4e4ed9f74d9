"""Progress of a running session, for display."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Protocol


@dataclass(frozen=True)
class GraspReport:
    """One grasp, as shown live.

    Attributes:
        number: from 1.
        planned: number of grasps requested.
        closing: how the hand closed.
        reason: why this grasp was chosen.
        forces_N: contact force of each finger that held the object.
        touches_N: largest force of each finger's taps and touches before.
        missing: fingers without a contact, and why.
        landings: number of landings on the object during the approach.
        position_sigma_m: uncertainty of the object's position in the table plane, None if there is no estimate.
        yaw_sigma_rad: uncertainty of the object's rotation.
        explored: share of the surface that is known, 0..1.
        verdict: the estimator's verdict on the grasp.
        stamp_ns: session clock.
    """

    number: int
    planned: int
    closing: str
    reason: str
    forces_N: Mapping[str, float]
    touches_N: Mapping[str, float]
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
    """Receives progress."""

    def phase(self, number: int, name: str) -> None:
        """Grasp ``number`` has reached a step of its cycle."""

    def grasp_done(self, report: GraspReport) -> None:
        """A grasp has been captured and estimated."""

    def on_message(self, message: str) -> None:
        """Something a person should know immediately."""

    def on_interrupt(self) -> None:
        """Ctrl+C was pressed, at any point of the program: only note it here."""


class NullProgress:
    """Ignores progress."""

    def phase(self, number: int, name: str) -> None:
        """Ignored."""

    def grasp_done(self, report: GraspReport) -> None:
        """Ignored."""

    def on_message(self, message: str) -> None:
        """Ignored."""

    def on_interrupt(self) -> None:
        """Ignored."""
