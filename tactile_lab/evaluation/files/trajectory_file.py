"""``trajectory.csv`` and ``truth.csv``: the object's pose at each grasp, with its covariance if that is known."""

from __future__ import annotations

import csv
import io
from dataclasses import dataclass
from itertools import combinations_with_replacement
from pathlib import Path

import numpy as np
from gtsam import Pose3

from drivers.core.contacts import Array
from drivers.core.errors import ConfigurationError, SessionDataError
from drivers.core.reading.bounded_files import LARGEST_TABLE_bytes, read_bounded

COLUMNS = ("stamp_s", *(f"world_T_object_{row}{column}" for row in range(4) for column in range(4)))
"""Columns of every trajectory: the stamp, then the 4 x 4 matrix row by row."""
AXES = ("x", "y", "z", "wx", "wy", "wz")
_PAIRS = tuple(combinations_with_replacement(range(len(AXES)), 2))
COVARIANCE_COLUMNS = tuple(f"covariance_{AXES[row]}_{AXES[column]}" for row, column in _PAIRS)
"""Further columns of an estimate: the upper triangle of the covariance."""
_MATRIX = slice(1, len(COLUMNS))


@dataclass(frozen=True)
class Trajectory:
    """The object's pose at each grasp.

    Attributes:
        stamps_s: time of each grasp, session clock, seconds.
        world_T_object: pose at each grasp, or None if the grasp could not be registered.
        covariances: of the position (m) and of a small rotation about the world's axes (rad), shape (6, 6), relative to
            the pose that defined the object frame; None if unknown. On a table only x, y and wz are not zero. Empty for
            the truth and for results of older versions.
    """

    stamps_s: tuple[float, ...]
    world_T_object: tuple[Pose3 | None, ...]
    covariances: tuple[Array | None, ...] = ()


def trajectory_text(trajectory: Trajectory) -> str:
    """A trajectory as text: one line per grasp, with empty entries for unregistered grasps."""
    columns = COLUMNS + (COVARIANCE_COLUMNS if trajectory.covariances else ())
    covariances = trajectory.covariances or (None,) * len(trajectory.stamps_s)
    out = io.StringIO()
    writer = csv.writer(out, lineterminator="\n")
    writer.writerow(columns)
    for stamp, pose, covariance in zip(trajectory.stamps_s, trajectory.world_T_object, covariances, strict=True):
        entries = [] if pose is None else [repr(float(entry)) for entry in pose.matrix().ravel()]
        if entries and covariance is not None:
            entries += [repr(float(covariance[pair])) for pair in _PAIRS]
        writer.writerow([f"{stamp:.9f}", *entries, *[""] * (len(columns) - 1 - len(entries))])
    return out.getvalue()


def read_trajectory(path: Path) -> Trajectory:
    """Read a trajectory.

    Raises:
        SessionError: the file is missing or not in the format of :func:`trajectory_text`.
    """
    try:
        text = read_bounded(path, LARGEST_TABLE_bytes).decode("utf-8")
    except (OSError, ConfigurationError, UnicodeDecodeError) as error:
        raise SessionDataError(
            "trajectory cannot be read", where=str(path), hint="Replay the session to write its results"
        ) from error
    columns = tuple(text.partition("\n")[0].rstrip("\r").split(","))  # before millions of lines of something else
    if columns not in (COLUMNS, COLUMNS + COVARIANCE_COLUMNS):
        raise SessionDataError(
            f"first line is not '{COLUMNS[0]}' and the 16 entries of world_T_object", where=str(path)
        )
    try:
        _, *rows = csv.reader(io.StringIO(text))
    except csv.Error as error:
        raise SessionDataError(f"is not a table ({error})", where=str(path), hint="Replay the session") from error
    places = [f"{path}, line {number}" for number in range(2, len(rows) + 2)]
    placed = [_read_row(row, len(columns), place) for row, place in zip(rows, places, strict=True)]
    covariances = tuple(covariance for _, _, covariance in placed) if len(columns) > len(COLUMNS) else ()
    return Trajectory(tuple(stamp for stamp, _, _ in placed), tuple(pose for _, pose, _ in placed), covariances)


def _read_row(row: list[str], count: int, where: str) -> tuple[float, Pose3 | None, Array | None]:
    if len(row) != count:
        raise SessionDataError(f"has {len(row)} entries instead of {count}", where=where)
    try:
        stamp = float(row[0])
        if not any(row[1:]):
            return stamp, None, None
        matrix = np.array([float(entry) for entry in row[_MATRIX]]).reshape(4, 4)
        upper = [float(entry) for entry in row[len(COLUMNS) :]] if any(row[len(COLUMNS) :]) else None
    except ValueError as error:
        raise SessionDataError("contains an entry that is not a number", where=where) from error
    return stamp, _rigid(matrix, where), None if upper is None else _covariance(upper, where)


def _rigid(matrix: Array, where: str) -> Pose3:
    rotation = matrix[:3, :3]
    orthonormal = np.allclose(rotation @ rotation.T, np.eye(3), atol=1e-6) and np.linalg.det(rotation) > 0
    if not (np.isfinite(matrix).all() and orthonormal and np.array_equal(matrix[3], [0.0, 0.0, 0.0, 1.0])):
        raise SessionDataError("is not a rigid transform", where=where)
    return Pose3(matrix)


def _covariance(upper: list[float], where: str) -> Array:
    """The symmetric matrix of shape (6, 6) from its upper triangle."""
    matrix = np.zeros((len(AXES), len(AXES)))
    rows, columns = np.array(_PAIRS).T
    matrix[rows, columns] = matrix[columns, rows] = upper
    if not np.isfinite(matrix).all() or (np.diag(matrix) < 0).any():
        raise SessionDataError(
            "contains a covariance with entries that are not finite, or negative variances", where=where
        )
    return matrix
