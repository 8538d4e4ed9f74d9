"""The runs of an experiment or sweep as a Parquet table, for DuckDB, pandas and the like."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

from sessions.exchange.addresses import write_anywhere
from tactile_lab.experiments.cells import Row
from tactile_lab.experiments.execution.source_version import version


def write_parquet(path: Path, name: str, rows: Sequence[Row]) -> None:
    """One row for each run: its setting, seed, why it failed, and its figures.

    Figures inside others have the names of both, joined by a dot; units are in the names. Lists are left out, they are
    in the file of results. The table's metadata names the experiment and the version of the program.

    Args:
        path: of the file, or its address; replaced as a whole.
        name: of the experiment.
        rows: the runs.

    Raises:
        WriteError: the file cannot be written.
    """
    import pyarrow
    from pyarrow import parquet

    records = [_plain(row) for row in rows]
    columns = {column: None for record in records for column in record}
    table = pyarrow.table({column: [record.get(column) for record in records] for column in columns})
    table = table.replace_schema_metadata({"experiment": name, "version": version()})
    buffer = pyarrow.BufferOutputStream()
    parquet.write_table(table, buffer)
    write_anywhere(path, buffer.getvalue().to_pybytes(), "Choose another file with --parquet")


def _plain(row: Row) -> dict[str, Any]:
    return {
        **dict(row.cell.setting),
        "seed": row.cell.seed,
        "failure": row.failure,
        **dict(_figures(row.figures or {})),
    }


def _figures(figures: Mapping[str, Any], inside: str = "") -> Iterator[tuple[str, Any]]:
    for name, value in figures.items():
        if isinstance(value, Mapping):
            yield from _figures(value, f"{inside}{name}.")
        elif isinstance(value, (bool, int, float, str)):
            # An integer in one run may be a fraction in the next: one type for each column.
            yield f"{inside}{name}", float(value) if isinstance(value, int) and not isinstance(value, bool) else value
