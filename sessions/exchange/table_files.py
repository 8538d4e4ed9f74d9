"""Tables of samples as CSV files or as one HDF5 file. Stamps are seconds of the session clock."""

from __future__ import annotations

import csv
import os
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from drivers.core.atomic_files import write_failure
from drivers.core.clock import NANOSECONDS
from drivers.core.errors import ConfigurationError, TactileLabError, WriteError
from drivers.core.installed.extras import LazyPackage
from sessions.exchange.sample_tables import SampleTables, Table

if TYPE_CHECKING:
    import h5py
else:
    h5py = LazyPackage("h5py")

PICTURES = "pictures"


def write_csv(tables: SampleTables, folder: Path) -> int:
    """Write a CSV file per table into a new folder, and pictures as files into a subfolder. Returns the number of rows.

    Raises:
        ConfigurationError: the folder exists.
        WriteError: it cannot be written.
    """
    try:
        folder.mkdir(parents=True)
        for name, table in tables.tables.items():
            _write_table(folder / f"{name}.csv", table)
        if tables.pictures:
            (folder / PICTURES).mkdir()
        for stamp_ns, content in tables.pictures:
            (folder / PICTURES / f"{stamp_ns:019d}{picture_suffix(content)}").write_bytes(content)
    except OSError as error:
        raise _unwritable(folder, error) from error
    return rows_of(tables)


def write_hdf5(tables: SampleTables, path: Path) -> int:
    """Write a group per table with ``stamp_ns`` and one dataset per column.

    Returns the number of rows. Names of columns carry their units. Pictures stay encoded as received, as arrays of
    bytes in ``pictures/encoded``.

    Raises:
        ConfigurationError: the file exists.
        WriteError: it cannot be written.
    """
    try:
        with h5py.File(path, "x") as file:
            file.attrs["format"] = "tactile-samples/1"
            for name, table in tables.tables.items():
                _write_group(file.create_group(name), table)
            if tables.pictures:
                _write_pictures(file.create_group(PICTURES), tables.pictures)
    except OSError as error:
        raise _unwritable(path, error) from error
    return rows_of(tables)


def rows_of(tables: SampleTables) -> int:
    """Rows and pictures in all tables."""
    return sum(len(table.rows) for table in tables.tables.values()) + len(tables.pictures)


def picture_suffix(content: bytes) -> str:
    """Suffix of a picture's file."""
    return ".png" if content.startswith(b"\x89PNG") else ".jpg"


def _write_table(path: Path, table: Table) -> None:
    with path.open("w", newline="", encoding="utf-8") as file:
        lines = csv.writer(file)
        lines.writerow(["stamp_s", *table.columns])
        for stamp_ns, row in zip(table.stamps_ns, table.rows, strict=True):
            seconds, rest = divmod(stamp_ns, NANOSECONDS)
            lines.writerow([f"{seconds}.{rest:09d}", *(_plain(value) for value in row)])


def _plain(value: object) -> object:
    return value.item() if isinstance(value, np.generic) else value


def _write_group(group: h5py.Group, table: Table) -> None:
    group.create_dataset("stamp_ns", data=np.array(table.stamps_ns, dtype=np.int64))
    for place, column in enumerate(table.columns):
        values = [row[place] for row in table.rows]
        text = bool(values) and isinstance(values[0], str)
        data = np.array(values, dtype=h5py.string_dtype() if text else None)
        group.create_dataset(column, data=data, compression=None if text else "gzip")


def _write_pictures(group: h5py.Group, pictures: list[tuple[int, bytes]]) -> None:
    group.create_dataset("stamp_ns", data=np.array([stamp_ns for stamp_ns, _ in pictures], dtype=np.int64))
    encoded = group.create_dataset("encoded", (len(pictures),), dtype=h5py.vlen_dtype(np.uint8))
    for place, (_, content) in enumerate(pictures):
        encoded[place] = np.frombuffer(content, np.uint8)


def _unwritable(path: Path, error: OSError) -> TactileLabError:
    if path.exists():
        return ConfigurationError("exists already", where=str(path), hint="Choose another name")
    ours = OSError(error.errno, os.strerror(error.errno)) if error.errno else error  # in HDF5's there are its own words
    return WriteError(write_failure(ours), where=str(path), hint="Choose another name")
