"""Contacts and contours as CSV, for spreadsheets and other programs."""

from __future__ import annotations

import csv
import io
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from drivers.core.contacts import Array, Grasp
from drivers.core.errors import ConfigurationError, SessionError
from drivers.core.reading.bounded_files import LARGEST_TABLE_bytes, read_bounded
from tactile_lab.evaluation.prism import open_ring

NANOSECOND_s = 1e-9
CONTACT_COLUMNS = (
    *("grasp", "stamp_s", "finger", "x_world_m", "y_world_m", "z_world_m"),
    *("normal_x_world", "normal_y_world", "normal_z_world", "point_sigma_m", "normal_sigma_rad", "force_N"),
)
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
            raise SessionError(f"line {number}: {error}", where=str(path), hint=RERUN) from error
    return tuple(map(_contact_rows, grasps))


def _contact_rows(rows: list[list[str]]) -> ContactRows:
    table = np.array([[float(entry) for entry in row[1:]] for row in rows]).reshape(-1, 9)
    return ContactRows(tuple(row[0] for row in rows), table[:, :3], table[:, 3:6], *table[:, 6:].T)


def contour_text(points_m: Array) -> str:
    """``contour.csv`` of a contour of shape (n, 2), object frame: x_m, y_m, the first point repeated at the end."""
    ring = open_ring(points_m)
    return _csv_text(("x_m", "y_m"), [[repr(float(x)), repr(float(y))] for x, y in [*ring, ring[0]]])


def pieces_text(pieces_m: Sequence[Array]) -> str:
    """``known.csv`` of open lines of shape (n, 2), object frame: piece, x_m, y_m; a closed contour is one piece."""
    rows = [[str(number), repr(float(x)), repr(float(y))] for number, piece in enumerate(pieces_m) for x, y in piece]
    return _csv_text(("piece", "x_m", "y_m"), rows)


def read_contour(path: Path) -> Array:
    """Read ``contour.csv``: points of the outer contour, shape (n, 2), object frame, the first one repeated.

    Raises:
        SessionError: the file is missing or not two columns of numbers.
    """
    try:
        return np.array([[float(x), float(y)] for x, y in _read_csv(path, ("x_m", "y_m"))]).reshape(-1, 2)
    except ValueError as error:
        raise SessionError(f"does not have two numbers per line ({error})", where=str(path), hint=RERUN) from error


def _read_csv(path: Path, columns: Sequence[str]) -> list[list[str]]:
    try:
        rows = list(csv.reader(io.StringIO(read_bounded(path, LARGEST_TABLE_bytes).decode("utf-8"))))
    except (OSError, ConfigurationError, UnicodeDecodeError) as error:
        raise SessionError("cannot be read", where=str(path), hint=RERUN) from error
    if not rows or rows[0] != list(columns) or any(len(row) != len(columns) for row in rows):
        raise SessionError(f"is not a table of {', '.join(columns)}", where=str(path), hint=RERUN)
    return rows[1:]
