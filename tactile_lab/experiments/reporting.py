"""The outcome of an experiment: as files in the folder of a run, and as a part of a stored result."""

from __future__ import annotations

import json
import os
import platform
from collections.abc import Sequence
from dataclasses import replace
from datetime import date
from importlib.metadata import version as package_version
from pathlib import Path
from typing import Any

from drivers.core.atomic_files import write_whole
from tactile_lab.experiments.cells import Cell, Row
from tactile_lab.experiments.execution.source_version import version
from tactile_lab.experiments.experiment import Experiment
from tactile_lab.experiments.groups import Group, group_runs
from tactile_lab.experiments.plots import draw
from tactile_lab.experiments.results.pages import page
from tactile_lab.experiments.results.stored_result import TOGETHER, MadeBy, Part, StoredResult, Table
from tactile_lab.experiments.runner import FORMAT
from tactile_lab.experiments.studies.plots import UNITS
from tactile_lab.experiments.summary import group_json, table

JSON_FILE, TABLE_FILE, PLOT_FILE = "results.json", "results.md", "plot.svg"


def document(study: Experiment, rows: Sequence[Row], jobs: int) -> dict[str, Any]:
    """The whole outcome as plain data: its origin, groups with their spreads, and every run."""
    return {
        "format": FORMAT,
        "experiment": study.name,
        "sentence": study.sentence,
        "version": version(),
        "machine": {"cores": os.cpu_count(), "processor": platform.machine(), "jobs": jobs},
        "seeds": seeds_of(rows),
        "groups": [group_json(group, study.columns) for group in group_runs(rows)],
        "pooled": [group_json(group, study.columns) for group in pooled_groups(study, rows)],
        "runs": [row.as_json() for row in rows],
    }


def made_here(jobs: int = 1) -> MadeBy:
    """This version of the program, today, on this machine."""
    machine = f"{os.cpu_count()} cores ({platform.machine()}), {jobs} at a time"
    return MadeBy(package_version("tactile-lab"), version(), None, date.today().isoformat(), machine)


def part_of(study: Experiment, rows: Sequence[Row], jobs: int, command: str, grasps: int | None = None) -> Part:
    """Tables and plot of the runs: all runs together first, then each setting.

    Args:
        study: the experiment.
        rows: the runs, at least one.
        jobs: number of parallel processes.
        command: the command that made them.
        grasps: number of grasps instead of the experiment's own.
    """
    names = _shown_settings(study, grasps)
    tables = [_table(study, group_runs(rows), names)]
    if pooled := pooled_groups(study, rows):
        left = [name for name in names if name not in study.pooled]
        together = f"{TOGETHER}{' and '.join(study.pooled)} together"
        tables.insert(0, _table(study, pooled, left, together))
        if study.kind is not None:
            kinds = pooled_groups(study, [_of_kind(row, study.kind(row.cell)) for row in rows])
            tables.insert(1, _table(study, kinds, ["kind", *left], f"{together}, by their kind"))
    return Part(made_here(jobs), (command,), _about(study, rows), tuple(tables), study.plot(rows))


def pooled_groups(study: Experiment, rows: Sequence[Row]) -> list[Group]:
    """Groups over the settings that the experiment pools; none if it has only one value of them."""
    distinct = {tuple(row.cell[name] for name in study.pooled) for row in rows}
    return group_runs(rows, over=study.pooled) if len(distinct) > 1 else []


def seeds_of(rows: Sequence[Row]) -> list[int]:
    """All seeds in ascending order."""
    return sorted({row.cell.seed for row in rows})


def write_report(study: Experiment, rows: Sequence[Row], folder: Path, jobs: int, command: str = "") -> None:
    """Write the three files.

    Raises:
        WriteError: the folder cannot be written.
    """
    part = part_of(study, rows, jobs, command or f"tactile-lab experiment {study.name}")
    result = StoredResult(study.name, study.sentence, (part,))
    texts = {
        JSON_FILE: json.dumps(document(study, rows, jobs), indent=1, allow_nan=False) + "\n",
        TABLE_FILE: page(result, part.made_by.sources or "", picture=PLOT_FILE),
        PLOT_FILE: draw(study.sentence.rstrip("."), study.plot(rows)),
    }
    for name, text in texts.items():
        write_whole(folder / name, text, "Choose another folder with --out")


def _of_kind(row: Row, kind: str) -> Row:
    return replace(row, cell=Cell((("kind", kind), *row.cell.setting), row.cell.seed))


def _table(study: Experiment, groups: Sequence[Group], names: Sequence[str], title: str = "") -> Table:
    head, *body = table(groups, study.columns, UNITS, names)
    return Table(title, tuple(head), tuple(map(tuple, body)), keys=len(names))


def _shown_settings(study: Experiment, grasps: int | None) -> list[str]:
    """Settings that the experiment varies, even if the present runs do not, so that all tables have the same
    columns.
    """
    cells = study.cells([0], None, grasps)
    names = [name for name, _ in cells[0].setting]
    return [name for name in names if len({dict(cell.setting).get(name) for cell in cells}) > 1] or names


def _about(study: Experiment, rows: Sequence[Row]) -> str:
    text = f"Seeds {_ranges(seeds_of(rows))}; {len(rows)} runs."
    if any(column.key == "hausdorff_mm" for column in study.columns):
        text += " Hausdorff distances are at the best fit; a run without a shape counts as infinitely wrong."
    return text + (f" Not run: {study.left_out()}." if study.left_out() else "")


def _ranges(seeds: Sequence[int]) -> str:
    """Numbers as text, with consecutive ones joined: 1-3, 7."""
    parts: list[list[int]] = []
    for seed in seeds:
        if parts and seed == parts[-1][-1] + 1:
            parts[-1].append(seed)
        else:
            parts.append([seed])
    return ", ".join(f"{part[0]}-{part[-1]}" if len(part) > 1 else str(part[0]) for part in parts)
