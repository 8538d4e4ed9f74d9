"""Simulated sessions on a Dask cluster of this machine, with a worker and the client killed on the way.

    python -m tests.support.cluster_table --sessions 1000 --store

The sessions are those of the experiment ``methods-2d`` with four grasps. They are made twice: by the process pool, and
by two workers of a cluster, of whom one is killed after a third, the client after two thirds and started again. The
rows have to be the same. ``--out`` keeps the rows, so that what is made already is not made again; ``--pool`` makes
only those of the process pool.
"""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from collections.abc import Sequence
from pathlib import Path

from tactile_lab.experiments.cells import Cell, Row, grid
from tactile_lab.experiments.runner import RunnerSettings, kept_rows, run_cells
from tactile_lab.experiments.studies.planar import PLANAR_SHAPES
from tests.support.cluster_work import measured
from tests.support.dask_cluster import DaskCluster
from tests.support.repository import REPOSITORY
from tests.support.stored_table import GrowingTable, Outline, parser

NAME, WORKERS, GRASPS, FIRST_SEED = "cluster-sessions", 2, 4, 1000
MEASURED = ("process", "cpu_s", "resident_MB")
"""What the runs add to the figures of a session: these alone may differ between pool and cluster."""

OUTLINE = Outline(
    NAME,
    "Simulated sessions of four grasps on a Dask cluster, a worker and the client killed on the way.",
    ("python -m tests.support.cluster_table --sessions 1000 --store",),
    "A scheduler, two workers and the client on a machine of two cores. A worker is killed (SIGKILL) when a third of "
    "the sessions is made, the client when two thirds are, and started again. Efficiency: processor time of the "
    "sessions that are in the table, by twice the seconds from the first client's start to the second one's end. "
    "Memory: the largest that a worker process has held when a quarter of its sessions were made, and at its end.",
    (
        "Sessions, method",
        "Rows as in the pool",
        "Processor s a session",
        "s in all",
        "Efficiency",
        "Worker MB, quarter",
        "Worker MB, end",
    ),
)


def cells_of(sessions: int, method: str) -> list[Cell]:
    """As many cells, over all planar shapes and then over seeds."""
    settings = grid(noise=[100], outliers=[0], shape=PLANAR_SHAPES, method=[method], grasps=[GRASPS])
    seeds = range(FIRST_SEED, FIRST_SEED - (-sessions // len(settings)))
    return [Cell(setting, seed) for seed in seeds for setting in settings][:sessions]


def same_rows(one: Sequence[Row], other: Sequence[Row]) -> bool:
    """Whether two tables have the same figures, but for what was measured."""
    return [_content(row) for row in one] == [_content(row) for row in other]


def _content(row: Row) -> object:
    figures = {name: value for name, value in (row.figures or {}).items() if name not in (*MEASURED, *_timed(row))}
    return row.cell, row.problem, repr(sorted(figures.items()))  # repr: a number that is none equals itself


def _timed(row: Row) -> list[str]:
    """Times are in the figures of sessions, too."""
    return [name for name in row.figures or {} if name.endswith(("_s", "_ms"))]


def killed_on_the_way(cells: Sequence[Cell], arguments: Sequence[str], folder: Path) -> float:
    """Run the sessions on a cluster, killing a worker and the client; the seconds from start to end."""
    file = folder / "cluster.jsonl"
    with DaskCluster(folder, WORKERS) as cluster:
        words = [sys.executable, "-m", __spec__.name, *arguments, "--scheduler", cluster.address]
        begun_s = time.monotonic()
        client = subprocess.Popen(words, cwd=REPOSITORY)
        _wait(file, len(cells) // 3, client)
        worker = next(row.figures["process"] for row in kept_rows(NAME, file) if row.figures)
        os.kill(int(worker), signal.SIGKILL)
        _wait(file, 2 * len(cells) // 3, client)
        client.kill()
        client.wait()
        subprocess.run(words, cwd=REPOSITORY, check=True)
        return time.monotonic() - begun_s


def _wait(file: Path, rows: int, client: subprocess.Popen[bytes]) -> None:
    while not file.is_file() or file.read_bytes().count(b"\n") <= rows:
        if client.poll() is not None:
            raise SystemExit(f"the client has ended with {client.returncode} before {rows} sessions were made")
        time.sleep(0.1)


def _memory(rows: Sequence[Row]) -> tuple[float, float]:
    """The most that the process with the most sessions has held: after a quarter of its sessions, and at its end."""
    held: dict[int, list[float]] = {}
    for row in rows:
        if row.figures:
            held.setdefault(row.figures["process"], []).append(row.figures["resident_MB"])
    longest: list[float] = max(held.values(), key=len)
    longest.sort()  # in the order of the sessions: the most so far never falls
    return longest[len(longest) // 4], longest[-1]


def main() -> None:
    """Make the table."""
    options = parser(__doc__)
    options.add_argument("--sessions", type=int, default=1000)
    options.add_argument("--method", default="joint")
    options.add_argument("--out", type=Path, default=Path("runs") / NAME)
    options.add_argument("--pool", action="store_true")
    options.add_argument("--scheduler", default="")
    chosen = options.parse_args()
    cells = cells_of(chosen.sessions, chosen.method)
    chosen.out.mkdir(parents=True, exist_ok=True)
    if chosen.scheduler:
        run_cells(NAME, cells, measured, chosen.out / "cluster.jsonl", RunnerSettings(scheduler=chosen.scheduler))
        return
    pooled = run_cells(NAME, cells, measured, chosen.out / "pool.jsonl", RunnerSettings(jobs=WORKERS))
    if chosen.pool:
        return
    (chosen.out / "cluster.jsonl").unlink(missing_ok=True)
    arguments = ["--sessions", str(chosen.sessions), "--method", chosen.method, "--out", str(chosen.out.resolve())]
    seconds = killed_on_the_way(cells, arguments, chosen.out)
    by_cell = {row.cell.key: row for row in kept_rows(NAME, chosen.out / "cluster.jsonl")}
    _put(
        GrowingTable(chosen.docs, OUTLINE, [(_key(chosen.sessions, chosen.method),)]),
        chosen.method,
        pooled,
        [by_cell[cell.key] for cell in cells],
        seconds,
    )


def _key(sessions: int, method: str) -> str:
    return f"{sessions}, {method}"


def _put(table: GrowingTable, method: str, pooled: Sequence[Row], made: Sequence[Row], seconds: float) -> None:
    spent_s = sum(row.figures["cpu_s"] for row in made if row.figures)
    early, late = _memory(made)
    figures = (
        "all" if same_rows(pooled, made) else "NO",
        f"{spent_s / len(made):.2f}",
        f"{seconds:.0f}",
        f"{spent_s / (WORKERS * seconds):.0%}",
        f"{early:.0f}",
        f"{late:.0f}",
    )
    table.put((_key(len(made), method),), figures)
    table.publish()


if __name__ == "__main__":
    main()
