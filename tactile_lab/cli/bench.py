"""``tactile-lab bench``: speed and memory, beside the reference."""

from __future__ import annotations

from typing import Annotated

import typer


def bench(
    as_json: Annotated[bool, typer.Option("--json", help="One JSON document on standard output.")] = False,
) -> None:
    """Measure the hot paths in one run, beside the thesis's figures and a plain implementation."""
    from tactile_lab.cli.console import emit_json, people, table
    from tactile_lab.evaluation.benchmark import run_benchmarks

    tables = run_benchmarks()
    if as_json:
        emit_json([result.as_json() for result in tables])
        return
    for result in tables:
        columns = ["what", "ms", "ratio", "peak MB", "how"]
        people.print(table(result.title, columns, result.rows(), right=(1, 2, 3)))
