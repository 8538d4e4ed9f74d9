"""Converts contacts from other sources, one per line of a CSV table or a JSON file, into a contact log.

The columns are described in ``docs/sessions.md``. A column's name carries its unit, so that a table in millimetres or
degrees is refused by name instead of being misread (see :mod:`sessions.exchange.timed_table`).
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
from gtsam import Pose3, Rot3

from drivers.core.clock import NANOSECONDS
from drivers.core.configuration import validate
from drivers.core.contacts import Contact, Grasp
from sessions.exchange.contact_form import ObjectTruth
from sessions.exchange.contact_log import ContactLog
from sessions.exchange.timed_table import Row, TimedTable, as_numbers, check_columns, read_csv, read_json, refusal


@dataclass(frozen=True)
class ImportSettings:
    """Values that a table does not contain.

    Attributes:
        point_sigma_m: standard deviation of the points, per axis.
        normal_sigma_rad: of the normals; None: 0.1, or 0.35 for directions of forces, which friction tilts by this
            much.
        gap_s: without a grasp column, a longer pause starts a new grasp.
        object_name: name of the true object.
        mesh: its closed mesh next to the log, or None.
    """

    point_sigma_m: float = 0.002
    normal_sigma_rad: float | None = None
    gap_s: float = 0.5
    object_name: str = "object"
    mesh: str | None = None


def read_timed_contacts(path: Path, settings: ImportSettings | None = None) -> ContactLog:
    """Read a table of contacts, CSV or JSON by the file's suffix.

    Raises:
        SessionError: the file cannot be read, or is not CSV or JSON.
        ConfigurationError: an invalid column or line; names it.
    """
    settings = settings or ImportSettings()
    truth = None if settings.mesh is None else ObjectTruth(name=settings.object_name, mesh=settings.mesh)
    if path.suffix.lower() == ".json":
        document = read_json(path)
        rows, truth = document["contacts"], _truth(document, path) or truth
        settings = _with_sigmas(settings, document)
        check_columns({name for row in rows for name in row}, path)
    else:
        rows = read_csv(path)
    table = TimedTable(path, [as_numbers(row, number, path) for number, row in enumerate(rows, start=1)])
    table.check()
    return _log(table, settings, truth)


def _truth(document: Mapping[str, Any], path: Path) -> ObjectTruth | None:
    found = document.get("object")
    return None if found is None else validate(found, ObjectTruth, where=f"{path}: object")


def _with_sigmas(settings: ImportSettings, document: Mapping[str, Any]) -> ImportSettings:
    return replace(
        settings,
        point_sigma_m=document.get("point_sigma_m", settings.point_sigma_m),
        normal_sigma_rad=document.get("normal_sigma_rad", settings.normal_sigma_rad),
    )


def _log(table: TimedTable, settings: ImportSettings, truth: ObjectTruth | None) -> ContactLog:
    sigma_rad = settings.normal_sigma_rad or (0.35 if table.by_force else 0.1)
    grasps: list[Grasp] = []
    groups, poses = _groups(table, settings.gap_s), []
    tool: Pose3 | None = None
    for index, rows in enumerate(groups):
        before, tool = tool, _pose(rows[0], "tool_", table) or tool
        held = bool(rows[0].get("held")) and before is not None and tool is not None
        motion = tool * before.inverse() if held and tool is not None and before is not None else Pose3()
        contacts = tuple(_contact(row, table, settings.point_sigma_m, sigma_rad) for row in rows)
        grasps.append(
            Grasp(
                index=index,
                stamp_ns=round(rows[0]["time_s"] * NANOSECONDS),
                contacts=contacts,
                world_T_palm=tool or _at_centre(contacts),
                hand_motion_world=motion,
            )
        )
        poses.append(_pose(rows[0], "object_", table))
    return ContactLog(
        dimension=table.dimension,
        point_sigma_m=settings.point_sigma_m,
        normal_sigma_rad=sigma_rad,
        motion_sigma=None,
        grasps=tuple(grasps),
        truth=truth,
        true_poses=tuple(poses),
    )


def _groups(table: TimedTable, gap_s: float) -> list[list[dict[str, Any]]]:
    groups = [[table.rows[0]]]
    for before, row in pairwise(table.rows):
        by_time = row["time_s"] - before["time_s"] > gap_s
        apart = row["grasp"] != before.get("grasp") if "grasp" in row else by_time
        if apart:
            groups.append([row])
        else:
            groups[-1].append(row)
    return groups


def _contact(row: Row, table: TimedTable, point_sigma_m: float, normal_sigma_rad: float) -> Contact:
    direction = table.direction(row)
    length = float(np.linalg.norm(direction))
    return Contact(
        finger=row.get("finger", "tool"),
        point_world_m=np.array([row["x_m"], row["y_m"], row.get("z_m", 0.0)]),
        normal_world=direction / length,
        point_covariance_m2=row.get("point_sigma_m", point_sigma_m) ** 2 * np.eye(3),
        normal_sigma_rad=row.get("normal_sigma_rad", normal_sigma_rad),
        force_N=length if table.by_force else float(np.linalg.norm([row.get(f"f{axis}_N", 0.0) for axis in "xyz"])),
    )


def _pose(row: Row, prefix: str, table: TimedTable) -> Pose3 | None:
    """The pose with that prefix; None if there is none. Raises ConfigurationError for an incomplete pose."""
    given = {name.removeprefix(prefix): value for name, value in row.items() if name.startswith(prefix)}
    if not given:
        return None
    number = table.rows.index(row) + 1  # type: ignore[arg-type]
    quaternion = [given.get(name) for name in ("qw", "qx", "qy", "qz")]
    if "x_m" not in given or "y_m" not in given or ("yaw_rad" in given) == (None not in quaternion):
        hint = f"Give {prefix}x_m, {prefix}y_m ({prefix}z_m) and {prefix}yaw_rad or {prefix}qx, qy, qz, qw"
        raise refusal(table.path, number, f"incomplete pose ({prefix}...)", hint)
    place = np.array([given["x_m"], given["y_m"], given.get("z_m", 0.0)])
    if "yaw_rad" in given:
        if abs(given["yaw_rad"]) > 4 * math.pi:
            raise refusal(table.path, number, f"{prefix}yaw_rad is {given['yaw_rad']:g}", "Give radians, not degrees")
        return Pose3(Rot3.Rz(given["yaw_rad"]), place)
    return Pose3(_rotation(quaternion, table.path, number), place)


def _rotation(quaternion: Sequence[Any], path: Path, number: int) -> Rot3:
    length = float(np.linalg.norm(quaternion))
    if abs(length - 1.0) > 0.01:
        raise refusal(path, number, f"a quaternion must have length 1, not {length:.3g}", "Correct the line")
    return Rot3.Quaternion(*(value / length for value in quaternion))


def _at_centre(contacts: Sequence[Contact]) -> Pose3:
    return Pose3(Rot3(), np.mean([contact.point_world_m for contact in contacts], axis=0))
