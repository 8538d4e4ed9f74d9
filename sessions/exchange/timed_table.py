"""Tables of timed contacts, CSV or JSON: read and checked line by line before they are converted."""

from __future__ import annotations

import csv
import io
import math
import re
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path
from typing import Any, Literal

import numpy as np

from drivers.core.contacts import Array
from drivers.core.errors import ConfigurationError
from drivers.core.reading.bounded_files import LARGEST_JSON_bytes, LARGEST_TABLE_bytes, read_input
from drivers.core.reading.json_text import parse_json

FORMAT = "tactile-timed-contacts/1"

POSE_PARTS = ("x_m", "y_m", "z_m", "yaw_rad", "qx", "qy", "qz", "qw")
COLUMNS = (
    *("time_s", "grasp", "finger", "held"),
    *("x_m", "y_m", "z_m", "nx", "ny", "nz", "fx_N", "fy_N", "fz_N"),
    *("point_sigma_m", "normal_sigma_rad"),
    *(f"tool_{part}" for part in POSE_PARTS),
    *(f"object_{part}" for part in POSE_PARTS),
)
SIGMAS = ("point_sigma_m", "normal_sigma_rad")
_TEXTS = {"finger"}
_WRONG_UNIT = re.compile(r"_(?:mm|cm|um|deg|degrees|ms|us|ns|mN|kg|g)$")
_LARGEST_FORCE_N = 1000.0
_MOST_ROWS = 50_000

Row = Mapping[str, Any]


def _check_count(rows: int, path: Path) -> None:
    """Raises ConfigurationError for more contacts than a person would bring in at a time."""
    if rows > _MOST_ROWS:
        what = f"has {rows} lines, more than the {_MOST_ROWS} that are read at a time"
        raise ConfigurationError(what, where=str(path), hint="Divide it")


def read_csv(path: Path) -> list[dict[str, str]]:
    """The lines of a CSV table without their empty values. Raises ConfigurationError."""
    try:
        text = read_input(path, LARGEST_TABLE_bytes).decode("utf-8-sig")
        _check_count(text.count("\n"), path)
        with io.StringIO(text, newline="") as file:
            lines = csv.DictReader(line for line in file if not line.startswith("#"))
            rows = [{str(name).strip(): value for name, value in row.items()} for row in lines]
            names = [name.strip() for name in lines.fieldnames or ()]
    except UnicodeDecodeError as error:
        raise ConfigurationError("is not a text file", where=str(path), hint="Give a CSV table in UTF-8") from error
    except csv.Error as error:
        what = "is not a CSV table: an entry of it is longer than 131,072 characters, or a quotation does not end"
        raise ConfigurationError(what, where=str(path), hint="Check its quotation marks") from error
    if len(set(names)) < len(names):
        raise ConfigurationError("two columns have the same name", where=str(path), hint="Name every column once")
    check_columns(set(names), path)
    for number, row in enumerate(rows, start=1):
        if "None" in row or None in row.values():
            raise refusal(
                path, number, f"does not have {len(names)} values", "Give every column a value, or leave it empty"
            )
    return [{name: value for name, value in row.items() if value.strip()} for row in rows]


def read_json(path: Path) -> dict[str, Any]:
    """A document of the form :data:`FORMAT`. Raises ConfigurationError."""
    try:
        document = parse_json(read_input(path, LARGEST_JSON_bytes))
    except ValueError as error:
        raise ConfigurationError(f"is not JSON ({error})", where=str(path)) from error
    form = document.get("format") if isinstance(document, dict) else None
    if form == "tactile-contacts/1":
        hint = f"It needs no import: tactile-lab reconstruct {path}"
        raise ConfigurationError("is already a contact log", where=str(path), hint=hint)
    if form != FORMAT:
        hint = "docs/sessions.md describes the form"
        raise ConfigurationError(f"its format is {form!r}, not {FORMAT!r}", where=str(path), hint=hint)
    rows = document.get("contacts")
    if not isinstance(rows, list) or not all(isinstance(row, dict) for row in rows):
        raise ConfigurationError("contacts: must be a list of objects", where=str(path))
    _check_count(len(rows), path)
    if unknown := set(document) - {"format", "contacts", "object", "note", *SIGMAS}:
        raise ConfigurationError(f"unknown key {sorted(unknown)[0]!r}", where=str(path), hint="See docs/sessions.md")
    for name in SIGMAS:
        value = document.get(name, 1.0)
        if isinstance(value, bool) or not isinstance(value, int | float) or not 0.0 < value < math.inf:
            raise ConfigurationError(f"{name} is {value!r}", where=str(path), hint="Give a number above 0")
    return dict(document)


def check_columns(names: Iterable[str], path: Path) -> None:
    """Raises ConfigurationError for a column that is unknown, in another unit, or missing."""
    for name in sorted(names):
        if name in COLUMNS:
            continue
        stem = _WRONG_UNIT.sub("", name)
        proper = [column for column in COLUMNS if stem != name and column.startswith(stem + "_")]
        hint = f"Convert it and name it {proper[0]}" if proper else f"Columns are {', '.join(COLUMNS)}"
        if ";" in name or "\t" in name:
            hint = "Separate the columns by commas, and write decimals with a point"
        what = f"column {name!r} is in another unit" if proper else f"unknown column {name!r}"
        raise ConfigurationError(what, where=str(path), hint=hint)
    for needed in ("time_s", "x_m", "y_m"):
        if needed not in names:
            raise ConfigurationError(
                f"no column {needed!r}", where=str(path), hint="docs/sessions.md describes the form"
            )


def as_numbers(row: Row, number: int, path: Path) -> dict[str, Any]:
    """A line with its values as numbers. Raises ConfigurationError."""
    found: dict[str, Any] = {}
    for name, value in row.items():
        if name in _TEXTS:
            found[name] = str(value)
            continue
        try:
            found[name] = float(value)
        except (TypeError, ValueError):
            raise refusal(path, number, f"{name} is {value!r}, not a number", "Correct the line") from None
        if not math.isfinite(found[name]):
            raise refusal(path, number, f"{name} is {value!r}, not a finite number", "Remove the line")
    return found


def refusal(path: Path, number: int, what: str, hint: str) -> ConfigurationError:
    """The error for a contact, with its number in the table."""
    return ConfigurationError(f"contact {number}: {what}", where=str(path), hint=hint)


@dataclass(frozen=True)
class TimedTable:
    """The lines of a table, as numbers."""

    path: Path
    rows: list[dict[str, Any]]

    @property
    def dimension(self) -> Literal[2, 3]:
        """3 if there is a height column, otherwise 2."""
        return 3 if any("z_m" in row for row in self.rows) else 2

    @property
    def by_force(self) -> bool:
        """Whether the directions are those of forces."""
        return not any("nx" in row for row in self.rows)

    def check(self) -> None:
        """Raises ConfigurationError for lines that are incomplete or out of order."""
        if not self.rows:
            raise ConfigurationError("contains no contact", where=str(self.path))
        for number, row in enumerate(self.rows, start=1):
            self._check_row(number, row)
        for number, (before, row) in enumerate(pairwise(self.rows), start=2):
            if row["time_s"] < before["time_s"]:
                what = (
                    f"its time {row['time_s']:g} s is earlier than that of the previous contact, {before['time_s']:g} s"
                )
                raise refusal(self.path, number, what, "Sort the lines by time_s")
            if row.get("grasp", 0) < before.get("grasp", 0):
                raise refusal(
                    self.path, number, "its grasp number is lower than that of the previous contact", "Sort the lines"
                )

    def _check_row(self, number: int, row: Row) -> None:
        needed = ["time_s", "x_m", "y_m", *(["z_m"] if self.dimension == 3 else [])]
        if missing := [name for name in needed if name not in row]:
            raise refusal(self.path, number, f"has no {missing[0]}", "Give every contact a time and a position")
        for name in SIGMAS:
            if row.get(name, 1.0) <= 0.0:
                raise refusal(self.path, number, f"{name} is {row[name]:g}", "Give a number above 0, or nothing")
        direction = self.direction(row)
        length = float(np.linalg.norm(direction))
        if self.by_force and not 0.0 < length < _LARGEST_FORCE_N:
            raise refusal(self.path, number, f"its force is {length:g} N", "Give a normal, or the force in newtons")
        if not self.by_force and abs(length - 1.0) > 0.01:
            raise refusal(self.path, number, f"a normal must have length 1, not {length:.3g}", "Give unit normals")
        if row.get("held") and not any(name.startswith("tool_") for name in row):
            raise refusal(
                self.path, number, "the object was held, but the tool's pose is missing", "Give the tool's pose"
            )

    def direction(self, row: Row) -> Array:
        """The normal as given, or the force, shape (3,)."""
        names = ("fx_N", "fy_N", "fz_N") if self.by_force else ("nx", "ny", "nz")
        return np.array([row.get(name, 0.0) for name in names])
