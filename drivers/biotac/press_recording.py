"""Recordings of presses on a plate with known normal, for training and testing contact normals.

Two forms are read. A CSV table with the columns ``e1`` ... ``e19`` (or ``e24``), ``nx``, ``ny``, ``nz``, in
chronological order: counts and the skin's outward normal. Rows without a normal were recorded without contact, and
their mean is the tare of all rows. The other form is two text files of numbers, electrodes and normals, one column per
sample, with the tare already subtracted.
"""

from __future__ import annotations

import csv
import io
from dataclasses import dataclass
from pathlib import Path
from typing import get_args

import numpy as np

from drivers.biotac.electrodes import ElectrodeCount
from drivers.biotac.learned_normal import Presses
from drivers.core.contacts import Array
from drivers.core.errors import ConfigurationError
from drivers.core.reading.bounded_files import LARGEST_TABLE_bytes, read_input

_NORMAL = ("nx", "ny", "nz")
_COUNTS: tuple[ElectrodeCount, ...] = get_args(ElectrodeCount)


@dataclass(frozen=True, eq=False)
class PressRecording:
    """Presses and their number of electrodes."""

    presses: Presses
    electrodes: ElectrodeCount


def read_presses(path: Path, normals: Path | None = None) -> PressRecording:
    """Read a recording.

    Args:
        path: the table, or the text file of electrodes if ``normals`` is given.
        normals: the text file of normals, shape (3, n).

    Raises:
        ConfigurationError: a file cannot be read or its contents do not fit; the message says where.
    """
    changes, directions = _table(path) if normals is None else (_matrix(path), _matrix(normals))
    where = str(path if normals is None else normals)
    if directions.shape[1] != 3 or len(directions) != len(changes):
        what = f"{len(changes)} samples of electrodes, but normals of shape {directions.shape[::-1]}"
        raise ConfigurationError(what, where=where, hint="Give one normal of three numbers for each sample")
    electrodes = next((count for count in _COUNTS if count == changes.shape[1]), None)
    if electrodes is None:
        hint = "A BioTac has 19, a BioTac SP 24"
        raise ConfigurationError(f"{changes.shape[1]} electrodes", where=str(path), hint=hint)
    return PressRecording(Presses(changes, _units(directions, where)), electrodes)


def _units(directions: Array, where: str) -> Array:
    length = np.linalg.norm(directions, axis=1)
    if bad := np.flatnonzero(~(np.abs(length - 1.0) < 0.05)).tolist():
        what = f"the normal of sample {bad[0] + 1} has length {length[bad[0]]:.3g}, not 1"
        raise ConfigurationError(what, where=where, hint="Give unit vectors")
    return np.asarray(directions / length[:, None])


def _matrix(path: Path) -> Array:
    try:
        values = np.loadtxt(io.BytesIO(read_input(path, LARGEST_TABLE_bytes)), ndmin=2)
    except ValueError as error:
        hint = "Give a text file of numbers, one column per sample and as many in every line"
        raise ConfigurationError("is not a table of numbers", where=str(path), hint=hint) from error
    if not np.isfinite(values).all():
        raise ConfigurationError("contains values that are not numbers", where=str(path), hint="Remove those samples")
    return np.asarray(values.T)


def _table(path: Path) -> tuple[Array, Array]:
    try:
        text = read_input(path, LARGEST_TABLE_bytes).decode("utf-8")
        rows = list(csv.reader(io.StringIO(text, newline="")))
    except (UnicodeDecodeError, csv.Error) as error:
        hint = "Give comma-separated values in UTF-8"
        raise ConfigurationError("is not a text file of a table", where=str(path), hint=hint) from error
    electrodes = len(rows[0]) - len(_NORMAL) if rows else 0
    names = [f"e{number}" for number in range(1, electrodes + 1)]
    if not rows or [name.strip().lower() for name in rows[0]] != [*names, *_NORMAL]:
        hint = "Its first line must be e1,e2,...,nx,ny,nz; for two plain files of numbers use --normals"
        raise ConfigurationError("is not a table of presses", where=str(path), hint=hint)
    values = np.array([_row(row, number, electrodes, path) for number, row in enumerate(rows[1:], 2)])
    values = values.reshape(-1, electrodes + len(_NORMAL))
    touched = np.isfinite(values[:, electrodes:]).all(axis=1)
    tare = values[~touched, :electrodes].mean(axis=0) if not touched.all() else np.zeros(electrodes)
    return values[touched, :electrodes] - tare, values[touched, electrodes:]


def _row(cells: list[str], number: int, electrodes: int, path: Path) -> list[float]:
    try:
        counts = [float(cell) for cell in cells[:electrodes]]
        normal = [float(cell) if cell.strip() else np.nan for cell in cells[electrodes:]]
    except ValueError:
        counts, normal = [], []
    if len(counts) != electrodes or len(normal) != len(_NORMAL) or not np.isfinite(counts).all():
        hint = "Each line needs the electrodes' counts and a normal, or three empty cells if nothing is touched"
        raise ConfigurationError("is not a sample", where=f"{path}, line {number}", hint=hint)
    return counts + normal
