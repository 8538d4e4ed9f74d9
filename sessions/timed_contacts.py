"""Contacts that others recorded, a line for each: a CSV table or the same as JSON, turned into a contact log.

The columns are described in ``docs/sessions.md``. A column's name carries its unit, so that a table in millimetres or
degrees is refused by name instead of being understood wrongly.
"""

from __future__ import annotations

import csv
import json
import math
import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path
from typing import Any, Literal

import numpy as np
from gtsam import Pose3, Rot3

from sessions.contact_form import ObjectTruth
from sessions.contact_log import ContactLog
from tactile_lab.clock import NANOSECONDS
from tactile_lab.errors import ConfigurationError, SessionError
from tactile_lab.geometry.contacts import Array, Contact, Grasp
from tactile_lab.strict_yaml import validate

FORMAT = "tactile-timed-contacts/1"

POSE_PARTS = ("x_m", "y_m", "z_m", "yaw_rad", "qx", "qy", "qz", "qw")
COLUMNS = (
    *("time_s", "grasp", "finger", "held"),
    *("x_m", "y_m", "z_m", "nx", "ny", "nz", "fx_N", "fy_N", "fz_N"),
    *("point_sigma_m", "normal_sigma_rad"),
    *(f"tool_{part}" for part in POSE_PARTS),
    *(f"object_{part}" for part in POSE_PARTS),
)
_TEXTS = {"finger"}
_WRONG_UNIT = re.compile(r"_(?:mm|cm|um|deg|degrees|ms|us|ns|mN|kg|g)$")
_LARGEST_FORCE_N = 1000.0

Row = Mapping[str, Any]


@dataclass(frozen=True)
class ImportSettings:
    """What a table does not say.

    Attributes:
        point_sigma_m: standard deviation of the points, per axis.
        normal_sigma_rad: of the normals; None takes 0.1, or 0.35 where they are directions of forces: friction tilts
            a force by as much.
        gap_s: where no column says so, contacts farther apart in time belong to different grasps.
        mesh: true object, a closed mesh beside the log, or None.
    """

    point_sigma_m: float = 0.002
    normal_sigma_rad: float | None = None
    gap_s: float = 0.5
    mesh: str | None = None


def read_timed_contacts(path: Path, settings: ImportSettings | None = None) -> ContactLog:
    """Read a table of contacts, CSV or JSON by the file's name.

    Raises:
        SessionError: the file can not be read, or is no CSV or JSON.
        ConfigurationError: a column or a line that does not fit; names it.
    """
    settings = settings or ImportSettings()
    truth = None if settings.mesh is None else ObjectTruth(name=Path(settings.mesh).stem, mesh=settings.mesh)
    if path.suffix.lower() == ".json":
        document = _read_json(path)
        rows, truth = document["contacts"], _truth(document, path) or truth
        settings = _with_sigmas(settings, document)
        _check_columns({name for row in rows for name in row}, path)
    else:
        rows = _read_csv(path)
    table = _Table(path, [_numbers(row, number, path) for number, row in enumerate(rows, start=1)])
    table.check()
    return _log(table, settings, truth)


# --- reading -------------------------------------------------------------------------------------------------------


def _read_csv(path: Path) -> list[dict[str, str]]:
    try:
        with path.open(newline="", encoding="utf-8-sig") as file:
            lines = csv.DictReader(line for line in file if not line.startswith("#"))
            rows = [{str(name).strip(): value for name, value in row.items()} for row in lines]
            names = [name.strip() for name in lines.fieldnames or ()]
    except OSError as error:
        raise SessionError(f"can not be read ({error.strerror})", where=str(path), hint="Check the path") from error
    except (UnicodeDecodeError, csv.Error) as error:
        raise SessionError(f"is not a CSV table ({error})", where=str(path)) from error
    if len(set(names)) < len(names):
        raise ConfigurationError("two columns have one name", where=str(path), hint="Name every column once")
    _check_columns(set(names), path)
    for number, row in enumerate(rows, start=1):
        if "None" in row or None in row.values():
            raise _bad(
                path, number, f"does not have {len(names)} values", "Give every column a value, or leave it empty"
            )
    return [{name: value for name, value in row.items() if value.strip()} for row in rows]


def _read_json(path: Path) -> dict[str, Any]:
    try:
        document = json.loads(path.read_text(encoding="utf-8"))
    except OSError as error:
        raise SessionError(f"can not be read ({error.strerror})", where=str(path), hint="Check the path") from error
    except (ValueError, RecursionError) as error:
        raise SessionError(f"is not JSON ({error})", where=str(path)) from error
    form = document.get("format") if isinstance(document, dict) else None
    if form == "tactile-contacts/1":
        hint = f"It needs no import: tactile-lab reconstruct {path}"
        raise ConfigurationError("is a contact log already", where=str(path), hint=hint)
    if form != FORMAT:
        hint = "docs/sessions.md describes the form"
        raise ConfigurationError(f"its format is {form!r}, not {FORMAT!r}", where=str(path), hint=hint)
    rows = document.get("contacts")
    if not isinstance(rows, list) or not all(isinstance(row, dict) for row in rows):
        raise ConfigurationError("contacts: must be a list of objects", where=str(path))
    if unknown := set(document) - {"format", "contacts", "object", "point_sigma_m", "normal_sigma_rad", "note"}:
        raise ConfigurationError(f"unknown key {sorted(unknown)[0]!r}", where=str(path), hint="See docs/sessions.md")
    return document


def _truth(document: Mapping[str, Any], path: Path) -> ObjectTruth | None:
    found = document.get("object")
    return None if found is None else validate(found, ObjectTruth, where=f"{path}: object")


def _with_sigmas(settings: ImportSettings, document: Mapping[str, Any]) -> ImportSettings:
    return ImportSettings(
        float(document.get("point_sigma_m", settings.point_sigma_m)),
        document.get("normal_sigma_rad", settings.normal_sigma_rad),
        settings.gap_s,
        settings.mesh,
    )


# --- checks --------------------------------------------------------------------------------------------------------


def _check_columns(names: Iterable[str], path: Path) -> None:
    for name in sorted(names):
        if name in COLUMNS:
            continue
        stem = _WRONG_UNIT.sub("", name)
        proper = [column for column in COLUMNS if stem != name and column.startswith(stem + "_")]
        hint = f"Convert it and call it {proper[0]}" if proper else f"Columns are {', '.join(COLUMNS)}"
        what = f"column {name!r} is in another unit" if proper else f"unknown column {name!r}"
        raise ConfigurationError(what, where=str(path), hint=hint)
    for needed in ("time_s", "x_m", "y_m"):
        if needed not in names:
            raise ConfigurationError(
                f"no column {needed!r}", where=str(path), hint="docs/sessions.md describes the form"
            )


def _numbers(row: Row, number: int, path: Path) -> dict[str, Any]:
    found: dict[str, Any] = {}
    for name, value in row.items():
        if name in _TEXTS:
            found[name] = str(value)
            continue
        try:
            found[name] = float(value)
        except (TypeError, ValueError):
            raise _bad(path, number, f"{name} is {value!r}, no number", "Correct the line") from None
        if not math.isfinite(found[name]):
            raise _bad(path, number, f"{name} is {value!r}, no finite number", "Leave the line out")
    return found


def _bad(path: Path, number: int, what: str, hint: str) -> ConfigurationError:
    return ConfigurationError(f"contact {number}: {what}", where=str(path), hint=hint)


@dataclass(frozen=True)
class _Table:
    """The lines of a table, as numbers."""

    path: Path
    rows: list[dict[str, Any]]

    @property
    def dimension(self) -> Literal[2, 3]:
        """3 where a column says how high."""
        return 3 if any("z_m" in row for row in self.rows) else 2

    @property
    def by_force(self) -> bool:
        """The directions are those of forces."""
        return not any("nx" in row for row in self.rows)

    def check(self) -> None:
        """Raises ConfigurationError for lines that are incomplete or out of order."""
        if not self.rows:
            raise ConfigurationError("holds no contact", where=str(self.path))
        for number, row in enumerate(self.rows, start=1):
            self._check_row(number, row)
        for number, (before, row) in enumerate(pairwise(self.rows), start=2):
            if row["time_s"] < before["time_s"]:
                what = f"its time {row['time_s']:g} s is before that of the contact before, {before['time_s']:g} s"
                raise _bad(self.path, number, what, "Sort the lines by time_s")
            if row.get("grasp", 0) < before.get("grasp", 0):
                raise _bad(self.path, number, "its grasp comes before that of the contact before", "Sort the lines")

    def _check_row(self, number: int, row: Row) -> None:
        needed = ["time_s", "x_m", "y_m", *(["z_m"] if self.dimension == 3 else [])]
        if missing := [name for name in needed if name not in row]:
            raise _bad(self.path, number, f"has no {missing[0]}", "Give every contact a time and a place")
        direction = self.direction(row)
        length = float(np.linalg.norm(direction))
        if self.by_force and not 0.0 < length < _LARGEST_FORCE_N:
            raise _bad(self.path, number, f"its force is {length:g} N", "Give a normal, or the force in newtons")
        if not self.by_force and abs(length - 1.0) > 0.01:
            raise _bad(self.path, number, f"a normal has length 1, this one {length:.3g}", "Give unit normals")
        if row.get("held") and not any(name.startswith("tool_") for name in row):
            raise _bad(self.path, number, "the object was held, but nothing says by what", "Give the tool's pose")

    def direction(self, row: Row) -> Array:
        """The normal as given, or the force, shape (3,)."""
        names = ("fx_N", "fy_N", "fz_N") if self.by_force else ("nx", "ny", "nz")
        return np.array([row.get(name, 0.0) for name in names])


# --- making grasps -------------------------------------------------------------------------------------------------


def _log(table: _Table, settings: ImportSettings, truth: ObjectTruth | None) -> ContactLog:
    sigma_rad = settings.normal_sigma_rad or (0.35 if table.by_force else 0.1)
    grasps: list[Grasp] = []
    groups, poses = _groups(table, settings.gap_s), []
    tool = None
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


def _groups(table: _Table, gap_s: float) -> list[list[dict[str, Any]]]:
    groups = [[table.rows[0]]]
    for before, row in pairwise(table.rows):
        by_time = row["time_s"] - before["time_s"] > gap_s
        apart = row["grasp"] != before.get("grasp") if "grasp" in row else by_time
        if apart:
            groups.append([row])
        else:
            groups[-1].append(row)
    return groups


def _contact(row: Row, table: _Table, point_sigma_m: float, normal_sigma_rad: float) -> Contact:
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


def _pose(row: Row, prefix: str, table: _Table) -> Pose3 | None:
    """The pose with that prefix; None where there is none. Raises ConfigurationError for half a pose."""
    given = {name.removeprefix(prefix): value for name, value in row.items() if name.startswith(prefix)}
    if not given:
        return None
    number = table.rows.index(row) + 1  # type: ignore[arg-type]
    quaternion = [given.get(name) for name in ("qw", "qx", "qy", "qz")]
    if "x_m" not in given or "y_m" not in given or ("yaw_rad" in given) == (None not in quaternion):
        hint = f"Give {prefix}x_m, {prefix}y_m ({prefix}z_m) and {prefix}yaw_rad or {prefix}qx, qy, qz, qw"
        raise _bad(table.path, number, f"half a pose ({prefix}...)", hint)
    place = np.array([given["x_m"], given["y_m"], given.get("z_m", 0.0)])
    if "yaw_rad" in given:
        if abs(given["yaw_rad"]) > 4 * math.pi:
            raise _bad(table.path, number, f"{prefix}yaw_rad is {given['yaw_rad']:g}", "Give radians, not degrees")
        return Pose3(Rot3.Rz(given["yaw_rad"]), place)
    return Pose3(_rotation(quaternion, table.path, number), place)


def _rotation(quaternion: Sequence[Any], path: Path, number: int) -> Rot3:
    length = float(np.linalg.norm(quaternion))
    if abs(length - 1.0) > 0.01:
        raise _bad(path, number, f"a quaternion has length 1, this one {length:.3g}", "Correct the line")
    return Rot3.Quaternion(*(value / length for value in quaternion))


def _at_centre(contacts: Sequence[Contact]) -> Pose3:
    return Pose3(Rot3(), np.mean([contact.point_world_m for contact in contacts], axis=0))
