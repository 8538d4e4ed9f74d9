"""Streams of poses that two programs recorded on clocks of their own: the hand's, and the target's in the camera.

The target is fixed to the hand, so that both turn equally fast at any moment, whatever their frames. This
gives the delay between the clocks to a fraction of a second before anything else is known.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise
from typing import Any, Literal, TypeAlias

import numpy as np
from gtsam import Pose3, Rot3
from pydantic import Field, model_validator

from calibration.forearm.hand_eye import nearest_rotation
from calibration.steps.observations import PosePair
from drivers.core.configuration import StrictModel, validate
from drivers.core.contacts import Array
from drivers.core.errors import ConfigurationError
from drivers.core.poses import rotation_angle_rad

STREAMS_FORMAT = "tactile-pose-streams/1"

Matrix: TypeAlias = tuple[
    tuple[float, float, float, float],
    tuple[float, float, float, float],
    tuple[float, float, float, float],
    tuple[float, float, float, float],
]

_SKEWED = 1e-3
_STEP_s, _SPAN_s = 0.02, 0.1
"""Grid on which speeds are compared, and half of the time over which each is measured: over less, noise hides them."""
_LEAST_OVERLAP_s, _LEAST_CORRELATION = 4.0, 0.8


@dataclass(frozen=True, eq=False)
class PoseStream:
    """Poses with the times of one clock.

    Attributes:
        times_s: increasing, shape (n,).
        poses: n of them.
    """

    times_s: Array
    poses: tuple[Pose3, ...]

    def at(self, time_s: float) -> tuple[Pose3, Array]:
        """The pose at a time; its velocity, rotation first, body frame, shape (6,); extrapolated beyond its ends."""
        index = int(np.clip(np.searchsorted(self.times_s, time_s) - 1, 0, len(self.poses) - 2))
        before, after = self.poses[index], self.poses[index + 1]
        step_s = float(self.times_s[index + 1] - self.times_s[index])
        velocity = Pose3.Logmap(before.between(after)) / step_s
        return before * Pose3.Expmap((time_s - float(self.times_s[index])) * velocity), velocity

    def speeds_rad_s(self, times_s: Array) -> Array:
        """How fast it turns at some times, shape (n,)."""
        ends = [(self.at(time_s - _SPAN_s)[0], self.at(time_s + _SPAN_s)[0]) for time_s in times_s]
        return np.array([rotation_angle_rad(before.between(after)) for before, after in ends]) / (2 * _SPAN_s)

    @cached_property
    def grid_s(self) -> Array:
        """Times at which its speed is compared."""
        return np.arange(self.times_s[0] + _SPAN_s, self.times_s[-1] - _SPAN_s, _STEP_s)


@dataclass(frozen=True, eq=False)
class PoseStreams:
    """The hand's stream and the target's.

    Attributes:
        mount_T_hand: poses of the hand.
        camera_T_target: poses of the target.
        most_delay_s: farthest that the clocks may be apart.
        most_poses: use at most this many of the target's, evenly spaced: each is left out once to judge the result.
        where: the file, for messages.
    """

    mount_T_hand: PoseStream
    camera_T_target: PoseStream
    most_delay_s: float = 10.0
    most_poses: int = 80
    where: str = "streams"

    @cached_property
    def first_delay_s(self) -> float:
        """The delay at which both turn most alike: the hand's clock minus the target's.

        Raises:
            ConfigurationError: they do not turn alike at any delay, or too short a time.
        """
        hand, target = self.mount_T_hand, self.camera_T_target
        seen, moved = target.speeds_rad_s(target.grid_s), hand.speeds_rad_s(hand.grid_s)
        delays = np.arange(-self.most_delay_s, self.most_delay_s + _STEP_s / 2, _STEP_s)
        alike = [_alike(hand.grid_s, moved, target.grid_s + delay, seen) for delay in delays]
        best = int(np.argmax(alike))
        if alike[best] < _LEAST_CORRELATION:
            what = f"hand and target do not turn alike at any delay up to {self.most_delay_s:g} s"
            hint = "Record both while the hand turns and stops for half a minute; clocks farther apart: most_delay_s"
            raise ConfigurationError(what, where=self.where, hint=hint)
        return float(delays[best])

    @cached_property
    def used_s(self) -> Array:
        """Times of the target's poses that are used: those at which the hand is known, evenly thinned."""
        first, last = self.mount_T_hand.times_s[[0, -1]] - self.first_delay_s
        times_s = self.camera_T_target.times_s
        inside = times_s[(times_s >= first + _SPAN_s) & (times_s <= last - _SPAN_s)]
        chosen = np.unique(np.linspace(0, len(inside) - 1, min(self.most_poses, len(inside))).astype(int))
        return np.asarray(inside[chosen])

    def pairs_at(self, delay_s: float) -> tuple[PosePair, ...]:
        """The used poses of the target with the hand's at the same moment, if the clocks are so far apart."""
        by_time = dict(zip(self.camera_T_target.times_s.tolist(), self.camera_T_target.poses, strict=True))
        return tuple(PosePair(self.mount_T_hand.at(t + delay_s)[0], by_time[t]) for t in self.used_s.tolist())


def _alike(times_s: Array, moved: Array, shifted_s: Array, seen: Array) -> float:
    """Correlation of two speeds where they overlap; -1 where that is too short or nothing moves."""
    inside = (shifted_s >= times_s[0]) & (shifted_s <= times_s[-1])
    if inside.sum() * _STEP_s < _LEAST_OVERLAP_s:
        return -1.0
    here, there = np.interp(shifted_s[inside], times_s, moved), seen[inside]
    spread = float(np.std(here) * np.std(there))
    return -1.0 if spread < 1e-9 else float(np.mean((here - here.mean()) * (there - there.mean())) / spread)


# --- files ---------------------------------------------------------------------------------------------------------


class _Stream(StrictModel):
    """Poses with times, or at a rate if nobody stamped them."""

    poses: tuple[Matrix, ...] = Field(min_length=10)
    times_s: tuple[float, ...] | None = None
    rate_hz: float | None = Field(default=None, gt=0.0)

    @model_validator(mode="after")
    def _timed(self) -> _Stream:
        if (self.times_s is None) == (self.rate_hz is None):
            raise ValueError("give either times_s or rate_hz")
        if self.times_s is not None and len(self.times_s) != len(self.poses):
            raise ValueError(f"{len(self.times_s)} times for {len(self.poses)} poses")
        if self.times_s is not None and any(after <= before for before, after in pairwise(self.times_s)):
            raise ValueError("times_s do not increase")
        return self


class _StreamsFile(StrictModel):
    format: Literal["tactile-pose-streams/1"]
    mount_T_hand: _Stream
    camera_T_target: _Stream
    most_delay_s: float = Field(default=10.0, ge=0.0, le=600.0)
    most_poses: int = Field(default=80, ge=10, le=1000)


def read_streams(content: Mapping[str, Any], where: str) -> PoseStreams:
    """Streams from a file's content. Raises ConfigurationError."""
    file = validate(dict(content), _StreamsFile, where=where)
    hand = _stream(file.mount_T_hand, f"{where}: mount_T_hand")
    target = _stream(file.camera_T_target, f"{where}: camera_T_target")
    return PoseStreams(hand, target, file.most_delay_s, file.most_poses, where)


def _stream(entry: _Stream, where: str) -> PoseStream:
    poses = tuple(rigid_pose(matrix, f"{where}, pose {index + 1}") for index, matrix in enumerate(entry.poses))
    times_s = np.arange(len(poses)) / entry.rate_hz if entry.rate_hz else np.array(entry.times_s)
    if times_s[-1] - times_s[0] < _LEAST_OVERLAP_s:
        hint = "Record both while the hand turns and stops for half a minute"
        raise ConfigurationError(f"lasts {times_s[-1] - times_s[0]:.1f} s only", where=where, hint=hint)
    return PoseStream(times_s, poses)


def rigid_pose(rows: Sequence[Sequence[float]], where: str) -> Pose3:
    """A pose from a matrix of 4 x 4. Raises ConfigurationError if it is no rigid motion."""
    matrix = np.array(rows)
    rotation = nearest_rotation(matrix[:3, :3])
    if np.abs(rotation - matrix[:3, :3]).max() > _SKEWED or np.abs(matrix[3] - [0, 0, 0, 1]).max() > _SKEWED:
        hint = "Give 4 x 4 matrices of a rotation and a translation in metres"
        raise ConfigurationError("a matrix is not a rigid motion", where=where, hint=hint)
    return Pose3(Rot3(rotation), matrix[:3, 3])
