"""Simulated sessions on a Dask cluster of this machine, with a worker and the client killed on the way.

    python -m tests.support.cluster_table --sessions 1000 --store

The sessions are those of the experiment ``methods-2d`` with four grasps. They are made twice: by the process pool, and
by two workers of a cluster, of whom one is killed after a third, the client after two thirds and started again. The
rows have to be the same. ``--out`` keeps the rows, so that what is made already is not made again; ``--pool`` makes
only those of the process pool.
"""

from __future__ import annotations

import os
import resource
import signal
import subprocess
import sys
import time
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from tactile_lab.experiments.cells import Cell, Row, grid
from tactile_lab.experiments.runner import RunnerSettings, kept_rows, run_cells
from tactile_lab.experiments.studies.planar import PLANAR_SHAPES
from tests.support.dask_cluster import DaskCluster
from tests.support.measured_runs import measured
from tests.support.repository import REPOSITORY
from tests.support.stored_table import GrowingTable, Outline, parser

NAME, WORKERS, GRASPS, FIRST_SEED = "cluster-sessions", 2, 4, 1000
MEASURED = ("process", "cpu_s", "begun_s", "ended_s", "resident_MB")
"""What the runs add to the figures of a session: these alone may differ between pool and cluster."""

OUTLINE = Outline(
    NAME,
    "Simulated sessions of four grasps on a Dask cluster, a worker and the client killed on the way.",
    ("python -m tests.support.cluster_table --sessions 1000 --store",),
    "A scheduler, two workers and the client on a machine of two cores. A worker is killed (SIGKILL) when a third of "
    "the sessions is made, the client when two thirds are, and started again. Efficiency: processor time of the "
    "sessions that are in the table, by that which there was for them: of all processes of the study, from the "
    "cluster's start to its end, and what the two cores were idle from the first client's start to the second one's "
    "end. What other programs take of the cores is in neither; but a wait of ours in which another program used the "
    "core does not show. Workers in sessions: share of the two workers' time by the clock, from the first client's "
    "start to the second one's end, in which they made sessions that are in the table; such a wait shows there, and "
    "other programs make sessions and all else longer alike. "
    "Memory: the largest that a worker process has held when a quarter of its sessions were made, and at its end.",
    (
        "Sessions, method",
        "Rows as in the pool",
        "Processor s a session",
        "s in all",
        "Efficiency",
        "Workers in sessions",
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


@dataclass(frozen=True)
class Spent:
    """Seconds from start to end, and the processor time that there was: used by the study's processes, and idle."""

    whole_s: float
    used_s: float
    idle_s: float


def killed_on_the_way(cells: Sequence[Cell], arguments: Sequence[str], folder: Path) -> Spent:
    """Run the sessions on a cluster, killing a worker and the client."""
    used_s = _children_s()
    whole_s, idle_s = _on_cluster(cells, arguments, folder)
    return Spent(whole_s, _children_s() - used_s, idle_s)  # children are counted once they have ended


def _on_cluster(cells: Sequence[Cell], arguments: Sequence[str], folder: Path) -> tuple[float, float]:
    """Seconds, and those of idle cores."""
    file = folder / "cluster.jsonl"
    with DaskCluster(folder, WORKERS) as cluster:
        words = [sys.executable, "-m", __spec__.name, *arguments, "--scheduler", cluster.address]
        begun_s, idle_s = time.monotonic(), _idle_s()
        client = subprocess.Popen(words, cwd=REPOSITORY)
        _wait(file, len(cells) // 3, client)
        worker = next(row.figures["process"] for row in kept_rows(NAME, file) if row.figures)
        os.kill(int(worker), signal.SIGKILL)
        _wait(file, 2 * len(cells) // 3, client)
        client.kill()
        client.wait()
        subprocess.run(words, cwd=REPOSITORY, check=True)
        return time.monotonic() - begun_s, _idle_s() - idle_s


def _children_s() -> float:
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    return used.ru_utime + used.ru_stime


def _idle_s() -> float:
    """Of all cores since the machine's start."""
    times = Path("/proc/stat").read_text().split()
    return (int(times[4]) + int(times[5])) / os.sysconf("SC_CLK_TCK")


def _wait(file: Path, rows: int, client: subprocess.Popen[bytes]) -> None:
    while not file.is_file() or file.read_bytes().count(b"\n") <= rows:
        if client.poll() is not None:
            raise SystemExit(f"the client has ended with {client.returncode} before {rows} sessions were made")
        time.sleep(0.1)


def _lasted_s(row: Row) -> float:
    """A session's time by the clock."""
    return float(row.figures["ended_s"] - row.figures["begun_s"]) if row.figures else 0.0


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
    if not chosen.pool:
        command = f"python -m tests.support.cluster_table --sessions {len(cells)} --store"
        outline = replace(OUTLINE, commands=(command,))
        table = GrowingTable(chosen.docs, outline, [(_key(len(cells), chosen.method),)])
        _put(table, chosen.method, pooled, *_made_again(cells, chosen.method, chosen.out))


def _made_again(cells: Sequence[Cell], method: str, out: Path) -> tuple[list[Row], Spent]:
    """The rows that the cluster makes, none of an earlier study among them."""
    file = out / "cluster.jsonl"
    file.unlink(missing_ok=True)
    arguments = ["--sessions", str(len(cells)), "--method", method, "--out", str(out.resolve())]
    spent = killed_on_the_way(cells, arguments, out)
    by_cell = {row.cell.key: row for row in kept_rows(NAME, file)}
    return [by_cell[cell.key] for cell in cells], spent


def _key(sessions: int, method: str) -> str:
    return f"{sessions}, {method}"


def _put(table: GrowingTable, method: str, pooled: Sequence[Row], made: Sequence[Row], spent: Spent) -> None:
    sessions_s = sum(row.figures["cpu_s"] for row in made if row.figures)
    early, late = _memory(made)
    figures = (
        "all" if same_rows(pooled, made) else "NO",
        f"{sessions_s / len(made):.2f}",
        f"{spent.whole_s:.0f}",
        f"{sessions_s / (spent.used_s + spent.idle_s):.0%}",
        f"{sum(map(_lasted_s, made)) / (WORKERS * spent.whole_s):.0%}",
        f"{early:.0f}",
        f"{late:.0f}",
    )
    table.put((_key(len(made), method),), figures)
    table.publish()


if __name__ == "__main__":
    main()
