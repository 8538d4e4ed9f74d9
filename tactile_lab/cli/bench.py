"""``tactile-lab bench``: speed and memory, beside the reference."""

from __future__ import annotations

from tactile_lab.cli.options import Json, NoInput


def bench(as_json: Json = False, no_input: NoInput = False) -> None:
    """Measure the hot paths in one run, beside the thesis's figures and a plain implementation."""
    from tactile_lab.cli.console import emit_json, show_table
    from tactile_lab.evaluation.benchmark import run_benchmarks
    from tactile_lab.experiments.step_times import step_table

    del no_input
    tables = [*run_benchmarks(), step_table()]
    if as_json:
        emit_json([result.as_json() for result in tables])
        return
    for result in tables:
        show_table(result.title, ["what", "ms", "ratio", "peak MB", "how"], result.rows(), right=(1, 2, 3))
