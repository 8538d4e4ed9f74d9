"""Tables of samples as Parquet files, with the unit of each column in its metadata."""

from __future__ import annotations

import shutil
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from drivers.core.errors import SessionError
from drivers.core.installed.extras import LazyPackage, require_package
from sessions.exchange.sample_tables import SampleTables, Table
from sessions.exchange.table_files import PICTURES, rows_of

if TYPE_CHECKING:
    import pyarrow
else:
    pyarrow = LazyPackage("pyarrow")

UNITS = {"rad": "rad", "m": "m", "N": "N", "Nm": "N m", "ns": "ns", "s": "s"}
"""Units by the ends of columns' names."""


def write_parquet(tables: SampleTables, folder: Path) -> int:
    """Write a Parquet file per table into a new folder, and the pictures, encoded as received, as one more.

    Each file has ``stamp_ns``, the session's clock; a column's field says its ``unit``. Returns the number of rows.

    Raises:
        ConfigurationError: PyArrow is not installed.
        SessionError: the folder exists or cannot be written; nothing is left of it then.
    """
    require_package("pyarrow")
    if folder.exists():
        raise SessionError("exists already", where=str(folder), hint="Choose a new folder")
    partial = folder.with_name(f".{folder.name}.part")
    try:
        partial.mkdir(parents=True)
        for name, table in tables.tables.items():
            _write(partial / f"{name}.parquet", _arrow(table))
        if tables.pictures:
            stamps_ns, encoded = zip(*tables.pictures, strict=True)
            columns = {"stamp_ns": pyarrow.array(stamps_ns, pyarrow.int64()), "encoded": pyarrow.array(encoded)}
            _write(partial / f"{PICTURES}.parquet", _with_units(columns))
        partial.replace(folder)
    except OSError as error:
        what = f"cannot be written ({error.strerror or error})"
        raise SessionError(what, where=str(folder), hint="Choose a new folder") from error
    finally:
        shutil.rmtree(partial, ignore_errors=True)
    return rows_of(tables)


def unit_of(column: str) -> str:
    """The unit that a column's name ends with; "" for one without."""
    return UNITS.get(column.rpartition("_")[2], "") if "_" in column else ""


def _arrow(table: Table) -> pyarrow.Table:
    columns = {"stamp_ns": pyarrow.array(table.stamps_ns, pyarrow.int64())}
    for place, name in enumerate(table.columns):
        columns[name] = pyarrow.array([_plain(row[place]) for row in table.rows])
    return _with_units(columns)


def _with_units(columns: dict[str, pyarrow.Array]) -> pyarrow.Table:
    fields = [
        pyarrow.field(name, values.type, metadata={"unit": unit} if (unit := unit_of(name)) else None)
        for name, values in columns.items()
    ]
    return pyarrow.table(list(columns.values()), schema=pyarrow.schema(fields, {"content": "tactile-samples/1"}))


def _plain(value: object) -> object:
    return value.item() if isinstance(value, np.generic) else value


def _write(path: Path, table: pyarrow.Table) -> None:
    from pyarrow import parquet

    parquet.write_table(table, path)
