"""Checks before solving whether there is enough motion, and what is missing.

Closed forms do not detect insufficient motion: from rotations that are too small, or all about one axis, they still
return a result, the identity for instance.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import combinations

import numpy as np
from gtsam import Pose3, Rot3
from pydantic import Field

from calibration.steps.hand_chain import mount_T_link
from calibration.steps.observations import PosePair, Touch, View
from drivers.core.configuration import StrictModel
from drivers.core.contacts import Array
from drivers.core.errors import ConfigurationError


class MotionNeeds(StrictModel):
    """The least motion to solve from.

    Attributes:
        poses: pictures or pairs.
        rotation_rad: largest rotation between two poses.
        second_axis_rad: rotation about a second axis, root mean square over all pairs of poses.
        touches: touches.
        direction: smallest share of the touches that determines a direction of space (the mean squared cosine).
        lever_m: root mean square lever of the touches about each axis through their middle.
        turn_rad: rotation of the hand between touches, root mean square: it separates joint offsets from the mount.
    """

    poses: int = Field(default=8, ge=3)
    rotation_rad: float = Field(default=float(np.radians(30.0)), gt=0.0)
    second_axis_rad: float = Field(default=float(np.radians(8.0)), gt=0.0)
    touches: int = Field(default=12, ge=6)
    direction: float = Field(default=0.08, gt=0.0)
    lever_m: float = Field(default=0.03, gt=0.0)
    turn_rad: float = Field(default=float(np.radians(20.0)), gt=0.0)


@dataclass(frozen=True)
class Check:
    """One criterion.

    Attributes:
        name: its name.
        value, needed: in the unit.
        unit: "" for a count.
        advice: what to do if it is not met.
    """

    name: str
    value: float
    needed: float
    unit: str
    advice: str

    @property
    def ok(self) -> bool:
        """Whether it is met."""
        return self.value >= self.needed

    def __str__(self) -> str:
        digits = 0 if not self.unit else 2
        return f"{self.name} {self.value:.{digits}f} {self.unit}".rstrip() + f" of {self.needed:.{digits}f} needed"


@dataclass(frozen=True)
class MotionReport:
    """All checks of a set of poses."""

    checks: tuple[Check, ...]

    @property
    def ok(self) -> bool:
        """Whether all are met."""
        return all(check.ok for check in self.checks)

    @property
    def missing(self) -> tuple[str, ...]:
        """The criteria that are not met, and what to do."""
        return tuple(f"{check}: {check.advice}" for check in self.checks if not check.ok)

    def refuse(self, where: str) -> None:
        """Raise ConfigurationError if something is missing."""
        if not self.ok:
            hint = "Record more poses; nothing was solved or stored"
            raise ConfigurationError(f"the motion is not enough: {'; '.join(self.missing)}", where=where, hint=hint)


def check_pairs(pairs: Sequence[PosePair], needs: MotionNeeds | None = None) -> MotionReport:
    """Motion of pose pairs."""
    return check_rotations([pair.mount_T_hand for pair in pairs], "pose pairs", needs or MotionNeeds())


def check_views(views: Sequence[View], link: str = "palm", needs: MotionNeeds | None = None) -> MotionReport:
    """Motion of what carries the board."""
    hands = [Pose3(mount_T_link(view.pose, link)) for view in views]
    return check_rotations(hands, "pictures with the board", needs or MotionNeeds())


def check_rotations(poses: Sequence[Pose3], what: str, needs: MotionNeeds) -> MotionReport:
    """Number of poses, the largest rotation between two of them, and rotation about more than one axis."""
    turns = _relative_turns(poses)
    largest = float(np.linalg.norm(turns, axis=1).max())
    axis, second = _main_axis(turns)
    about = f"({axis[0]:.2f}, {axis[1]:.2f}, {axis[2]:.2f})"
    return MotionReport(
        (
            Check(what, len(poses), needs.poses, "", "add more"),
            Check(
                "largest rotation between two poses",
                float(np.degrees(largest)),
                float(np.degrees(needs.rotation_rad)),
                "deg",
                "turn the hand farther",
            ),
            Check(
                "rotation about a second axis",
                float(np.degrees(second)),
                float(np.degrees(needs.second_axis_rad)),
                "deg",
                f"nearly all rotations are about one axis, {about} of the hand; also turn it about another axis",
            ),
        )
    )


def check_touches(touches: Sequence[Touch], needs: MotionNeeds | None = None) -> MotionReport:
    """Number of touches, the directions they determine, their levers, and rotations of the hand between them."""
    needs = needs or MotionNeeds()
    directions = np.concatenate([touch.target.directions() for touch in touches] or [np.zeros((1, 3))])
    hands = [Pose3(mount_T_link(touch.pose, "palm")) for touch in touches]
    shares, weakest = _weakest(directions)
    lever, axis = _weakest_lever(touches) if touches else (0.0, np.zeros(3))
    turns = _relative_turns(hands)
    turn = float(np.degrees(np.sqrt(np.mean(np.sum(turns**2, axis=1)))))
    return MotionReport(
        (
            Check("touches", len(touches), needs.touches, "", "add more"),
            Check(
                "weight of the weakest direction",
                shares,
                needs.direction,
                "of 1",
                f"too few touches determine the position along {_direction(weakest)}; press faces in that direction",
            ),
            Check(
                "lever of the weakest turn",
                1e3 * lever,
                1e3 * needs.lever_m,
                "mm",
                f"rotations about {_direction(axis)} are hardly determined; press points farther apart",
            ),
            Check(
                "turns of the hand between touches",
                turn,
                float(np.degrees(needs.turn_rad)),
                "deg",
                "press with the hand turned about the finger, to separate joint offsets from the mount's pose",
            ),
        )
    )


def _relative_turns(poses: Sequence[Pose3]) -> Array:
    """Rotation vectors between all pairs of poses, hand frame, shape (n, 3); one zero when there is no pair."""
    turns = [Rot3.Logmap(a.rotation().between(b.rotation())) for a, b in combinations(poses, 2)]
    return np.array(turns or [np.zeros(3)])


def _main_axis(turns: Array) -> tuple[Array, float]:
    """The axis about which there is most rotation, and the rotation about the next one, root mean square."""
    values, vectors = np.linalg.eigh(turns.T @ turns / len(turns))
    return np.asarray(vectors[:, 2]), float(np.sqrt(max(0.0, values[1])))


def _weakest(directions: Array) -> tuple[float, Array]:
    values, vectors = np.linalg.eigh(directions.T @ directions / len(directions))
    return float(max(0.0, values[0])), np.asarray(vectors[:, 0])


def _weakest_lever(touches: Sequence[Touch]) -> tuple[float, Array]:
    """Lever about the least determined axis through the touches' middle, and that axis.

    A rotation that all touches would measure as a shift does not count.
    """
    places, rows = [], []
    for touch in touches:
        point = (mount_T_link(touch.pose, touch.finger) @ np.append(touch.point_distal_m, 1.0))[:3]
        for direction in touch.target.directions():
            places.append(point)
            rows.append(direction)
    levers, directions = np.cross(np.array(places) - np.mean(places, axis=0), rows), np.array(rows)
    shared = directions @ np.linalg.lstsq(directions, levers, rcond=None)[0]
    alone = levers - shared
    values, vectors = np.linalg.eigh(alone.T @ alone / len(alone))
    return float(np.sqrt(max(0.0, values[0]))), np.asarray(vectors[:, 0])


def _direction(vector: Array) -> str:
    return f"({vector[0]:.2f}, {vector[1]:.2f}, {vector[2]:.2f})"
