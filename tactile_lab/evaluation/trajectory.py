"""The object's trajectory: its file, and its errors relative to the marker camera.

The estimate's object frame is defined by the first grasp and independent of the frame of the object's model. One fixed
transform relates them: the one that makes both agree at the first grasp for which both are known.
"""

from __future__ import annotations

import csv
import io
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from gtsam import Pose3
from numpy.typing import NDArray

from drivers.core.contacts import Array
from drivers.core.errors import ConfigurationError, SessionError
from drivers.core.poses import rotation_angle_rad
from drivers.core.reading.bounded_files import LARGEST_TABLE_bytes, read_bounded

COLUMNS = ("stamp_s", *(f"world_T_object_{row}{column}" for row in range(4) for column in range(4)))
"""Columns of ``trajectory.csv``: the stamp, then the 4 x 4 matrix row by row."""

Poses = Sequence[Pose3 | None]
"""One ``world_T_object`` per grasp; None if unknown."""


@dataclass(frozen=True)
class Trajectory:
    """The object's pose at each grasp.

    Attributes:
        stamps_s: time of each grasp, session clock, seconds.
        world_T_object: pose at each grasp, or None if the grasp could not be registered.
    """

    stamps_s: tuple[float, ...]
    world_T_object: tuple[Pose3 | None, ...]


@dataclass(frozen=True)
class Compared:
    """One grasp for which the estimated and the true ``world_T_object`` are both known."""

    index: int
    estimate: Pose3
    truth: Pose3


@dataclass(frozen=True)
class GraspError:
    """Pose error at one grasp: distance of the object origins and angle between the frames."""

    mm: float
    deg: float


@dataclass(frozen=True)
class PoseErrors:
    """Errors of a whole trajectory after the first grasp's object frame is aligned.

    Attributes:
        per_grasp: error at each grasp; None if the estimate or the truth is missing.
        aligned_at: the grasp whose pose the frames were aligned at (its own error is zero).
        rmse_mm, rmse_deg: root mean square over the compared grasps without the aligned one.
        final_mm, final_deg: error at the last compared grasp.
        drift_mm_per_grasp, drift_deg_per_grasp: slope of the error over the grasps, least squares through zero
            at the aligned grasp.
        step_mm, step_deg: root mean square error of the motion from one compared grasp to the next.
    """

    per_grasp: tuple[GraspError | None, ...]
    aligned_at: int
    rmse_mm: float
    rmse_deg: float
    final_mm: float
    final_deg: float
    drift_mm_per_grasp: float
    drift_deg_per_grasp: float
    step_mm: float
    step_deg: float


def trajectory_text(trajectory: Trajectory) -> str:
    """``trajectory.csv`` as text: one line per grasp, with empty entries for unregistered grasps."""
    out = io.StringIO()
    writer = csv.writer(out, lineterminator="\n")
    writer.writerow(COLUMNS)
    for stamp, pose in zip(trajectory.stamps_s, trajectory.world_T_object, strict=True):
        entries = [""] * 16 if pose is None else [repr(float(entry)) for entry in pose.matrix().ravel()]
        writer.writerow([f"{stamp:.9f}", *entries])
    return out.getvalue()


def read_trajectory(path: Path) -> Trajectory:
    """Read ``trajectory.csv``.

    Raises:
        SessionError: the file is missing or not in the format of :func:`trajectory_text`.
    """
    try:
        text = read_bounded(path, LARGEST_TABLE_bytes).decode("utf-8")
    except (OSError, ConfigurationError, UnicodeDecodeError) as error:
        raise SessionError(
            "trajectory cannot be read", where=str(path), hint="Replay the session to write its results"
        ) from error
    if text.partition("\n")[0].rstrip("\r") != ",".join(COLUMNS):  # before millions of lines of something else are read
        raise SessionError(f"first line is not '{COLUMNS[0]}' and the 16 entries of world_T_object", where=str(path))
    try:
        rows = list(csv.reader(io.StringIO(text)))
    except csv.Error as error:
        raise SessionError(f"is not a table ({error})", where=str(path), hint="Replay the session") from error
    placed = [_read_row(row, f"{path}, line {number}") for number, row in enumerate(rows[1:], start=2)]
    return Trajectory(tuple(stamp for stamp, _ in placed), tuple(pose for _, pose in placed))


def _read_row(row: list[str], where: str) -> tuple[float, Pose3 | None]:
    if len(row) != len(COLUMNS):
        raise SessionError(f"has {len(row)} entries instead of {len(COLUMNS)}", where=where)
    try:
        stamp = float(row[0])
        if not any(row[1:]):
            return stamp, None
        matrix = np.array([float(entry) for entry in row[1:]]).reshape(4, 4)
    except ValueError as error:
        raise SessionError(f"contains an entry that is not a number ({error})", where=where) from error
    return stamp, _rigid(matrix, where)


def _rigid(matrix: Array, where: str) -> Pose3:
    rotation = matrix[:3, :3]
    orthonormal = np.allclose(rotation @ rotation.T, np.eye(3), atol=1e-6) and np.linalg.det(rotation) > 0
    if not (np.isfinite(matrix).all() and orthonormal and np.array_equal(matrix[3], [0.0, 0.0, 0.0, 1.0])):
        raise SessionError("is not a rigid transform", where=where)
    return Pose3(matrix)


def compared_grasps(estimate: Poses, truth: Poses) -> list[Compared]:
    """Grasps for which both the estimated and the true pose are known, in order."""
    both = enumerate(zip(estimate, truth, strict=True))
    return [Compared(index, pose, true) for index, (pose, true) in both if pose is not None and true is not None]


def estimate_T_truth(estimate: Poses, truth: Poses) -> Pose3 | None:
    """The transform from the truth's object frame into the estimate's, from the first grasp that has both.

    It is the ``A`` in ``aligned = world_T_object_estimate * A``; None if no grasp has both.
    """
    both = compared_grasps(estimate, truth)
    return both[0].estimate.between(both[0].truth) if both else None


def aligned_poses(estimate: Poses, truth: Poses) -> tuple[Pose3 | None, ...]:
    """The estimated poses of the truth's object frame; all None if no grasp has both."""
    alignment = estimate_T_truth(estimate, truth)
    return tuple(None if pose is None or alignment is None else pose * alignment for pose in estimate)


def pose_errors(estimate: Poses, truth: Poses) -> PoseErrors | None:
    """Errors of the estimated trajectory, or None if no grasp after the aligned one can be compared."""
    both = compared_grasps(aligned_poses(estimate, truth), truth)
    if len(both) < 2:
        return None
    found = {pair.index: _difference(pair.truth, pair.estimate) for pair in both}
    table = _table(found.values())
    rmse, final, step = (
        _rms(table[1:]),
        GraspError(*map(float, table[-1])),
        _rms(_table(map(_step_error, both, both[1:]))),
    )
    drift = _slope_through_zero(np.array([pair.index - both[0].index for pair in both]), table)
    return PoseErrors(
        per_grasp=tuple(found.get(index) for index in range(len(truth))),
        aligned_at=both[0].index,
        rmse_mm=rmse.mm,
        rmse_deg=rmse.deg,
        final_mm=final.mm,
        final_deg=final.deg,
        drift_mm_per_grasp=drift.mm,
        drift_deg_per_grasp=drift.deg,
        step_mm=step.mm,
        step_deg=step.deg,
    )


def _step_error(before: Compared, after: Compared) -> GraspError:
    return _difference(before.truth.between(after.truth), before.estimate.between(after.estimate))


def _difference(truth: Pose3, estimate: Pose3) -> GraspError:
    difference = truth.between(estimate)
    distance_m = float(np.linalg.norm(difference.translation()))
    return GraspError(mm=1e3 * distance_m, deg=float(np.degrees(rotation_angle_rad(difference))))


def _table(errors: Iterable[GraspError]) -> Array:
    return np.array([[error.mm, error.deg] for error in errors])


def _rms(table: Array) -> GraspError:
    return GraspError(*map(float, np.sqrt(np.mean(table**2, axis=0))))


def _slope_through_zero(steps: NDArray[np.int_], table: Array) -> GraspError:
    return GraspError(*map(float, steps @ table / float(steps @ steps)))
