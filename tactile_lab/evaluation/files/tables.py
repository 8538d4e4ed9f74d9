"""Contacts and contours as CSV, for spreadsheets and other programs."""

from __future__ import annotations

import csv
import io
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from drivers.core.contacts import Array, Grasp
from drivers.core.errors import ConfigurationError, SessionDataError
from drivers.core.reading.bounded_files import LARGEST_TABLE_bytes, read_bounded

NANOSECOND_s = 1e-9
CONTACT_COLUMNS = (
    *("grasp", "stamp_s", "finger", "x_world_m", "y_world_m", "z_world_m"),
    *("normal_x_world", "normal_y_world", "normal_z_world", "point_sigma_m", "normal_sigma_rad", "force_N"),
)
CONTOUR_COLUMNS = ("x_m", "y_m", "sigma_m", "known")
_LEAST_CORNERS = 3
RERUN = "Replay the session to write its results"


@dataclass(frozen=True)
class ContactRows:
    """The contacts of one grasp as in ``contacts.csv``, world frame.

    Attributes:
        fingers: names, one per contact.
        points_world_m: shape (n, 3).
        normals_world: shape (n, 3), pointing out of the object.
        point_sigma_m: shape (n,), root mean variance of the point over the three axes.
        normal_sigma_rad: shape (n,).
        force_N: shape (n,).
    """

    fingers: tuple[str, ...]
    points_world_m: Array
    normals_world: Array
    point_sigma_m: Array
    normal_sigma_rad: Array
    force_N: Array


def contacts_text(grasps: Sequence[Grasp]) -> str:
    """``contacts.csv``: every contact of every grasp in the world frame."""
    rows = []
    for grasp in grasps:
        for contact in grasp.contacts:
            sigma_m = float(np.sqrt(np.trace(contact.point_covariance_m2) / 3.0))
            numbers = [
                *contact.point_world_m,
                *contact.normal_world,
                sigma_m,
                contact.normal_sigma_rad,
                contact.force_N,
            ]
            head = [str(grasp.index), f"{grasp.stamp_ns * NANOSECOND_s:.9f}", contact.finger]
            rows.append([*head, *(repr(float(number)) for number in numbers)])
    return _csv_text(CONTACT_COLUMNS, rows)


def _csv_text(columns: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    out = io.StringIO()
    csv.writer(out, lineterminator="\n").writerows([columns, *rows])
    return out.getvalue()


def read_contacts(path: Path, grasp_count: int) -> tuple[ContactRows, ...]:
    """Read ``contacts.csv``: one entry per grasp, in order.

    Raises:
        SessionError: the file is missing or not in the format of :func:`contacts_text`.
    """
    grasps: list[list[list[str]]] = [[] for _ in range(grasp_count)]
    for number, row in enumerate(_read_csv(path, CONTACT_COLUMNS), start=2):
        try:
            index, finger = int(row[0]), row[2]
            if not finger or not 0 <= index < grasp_count:
                raise ValueError(f"no such finger or grasp: {finger}, {index}")
            grasps[index].append([finger, *map(str, map(float, row[3:]))])
        except ValueError as error:
            raise SessionDataError(f"line {number}: {error}", where=str(path), hint=RERUN) from error
    return tuple(map(_contact_rows, grasps))


def _contact_rows(rows: list[list[str]]) -> ContactRows:
    table = np.array([[float(entry) for entry in row[1:]] for row in rows]).reshape(-1, 9)
    return ContactRows(tuple(row[0] for row in rows), table[:, :3], table[:, 3:6], *table[:, 6:].T)


def contour_text(ring_m: Array, sigma_m: Array, known: NDArray[np.bool_] | None = None) -> str:
    """``contour.csv`` of a closed contour of shape (n, 2), object frame, and its standard deviations, shape (n,).

    The first point is repeated at the end. ``known`` says of each point whether it was touched nearby; None: all were.
    """
    touched = np.ones(len(ring_m), dtype=bool) if known is None else known
    rows = [
        [*(repr(float(value)) for value in (*point, sigma)), str(int(near))]
        for point, sigma, near in zip(ring_m, sigma_m, touched, strict=True)
    ]
    return _csv_text(CONTOUR_COLUMNS, [*rows, rows[0]])


def pieces_text(pieces_m: Sequence[Array]) -> str:
    """``known.csv`` of open lines of shape (n, 2), object frame: piece, x_m, y_m; a closed contour is one piece."""
    rows = [[str(number), repr(float(x)), repr(float(y))] for number, piece in enumerate(pieces_m) for x, y in piece]
    return _csv_text(("piece", "x_m", "y_m"), rows)


@dataclass(frozen=True)
class ContourRows:
    """The outline as in ``contour.csv``, object frame, counter-clockwise, the first point not repeated.

    Attributes:
        points_m: shape (n, 2).
        sigma_m: standard deviation along the normal, shape (n,); of shape (0,) in results of older versions.
        known: whether it was touched nearby, shape (n,); always so in results of older versions.
    """

    points_m: Array
    sigma_m: Array
    known: NDArray[np.bool_]


def read_contour(path: Path) -> ContourRows:
    """Read ``contour.csv``.

    Raises:
        SessionError: the file is missing or not in the format of :func:`contour_text`.
    """
    rows = _read_csv(path, CONTOUR_COLUMNS, CONTOUR_COLUMNS[:3], CONTOUR_COLUMNS[:2])
    try:
        table = np.array([[float(entry) for entry in row] for row in rows[:-1]])
    except ValueError as error:
        raise SessionDataError("has an entry that is not a number", where=str(path), hint=RERUN) from error
    if len(table) < _LEAST_CORNERS or not np.isfinite(table).all():
        raise SessionDataError("is not an outline of three finite points or more", where=str(path), hint=RERUN)
    known = table[:, 3] != 0 if table.shape[1] > 3 else np.ones(len(table), dtype=bool)
    return ContourRows(table[:, :2], table[:, 2:3].ravel(), known)


def _read_csv(path: Path, *forms: Sequence[str]) -> list[list[str]]:
    """The lines below the head, which must be one of these."""
    try:
        rows = list(csv.reader(io.StringIO(read_bounded(path, LARGEST_TABLE_bytes).decode("utf-8"))))
    except (OSError, ConfigurationError, UnicodeDecodeError) as error:
        raise SessionDataError("cannot be read", where=str(path), hint=RERUN) from error
    if not rows or tuple(rows[0]) not in forms or any(len(row) != len(rows[0]) for row in rows):
        raise SessionDataError(f"is not a table of {', '.join(forms[0])}", where=str(path), hint=RERUN)
    return rows[1:]
