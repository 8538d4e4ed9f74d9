"""The outcome of an experiment as files (``results.json``, ``results.md``, ``plot.svg``) and as part of a document."""

from __future__ import annotations

import json
import os
import platform
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from tactile_lab.errors import SessionError
from tactile_lab.experiments.cells import Row
from tactile_lab.experiments.experiment import Experiment
from tactile_lab.experiments.runner import FORMAT, version
from tactile_lab.experiments.study_plots import UNITS
from tactile_lab.experiments.summary import Group, group_json, grouped, markdown, table
from tactile_lab.whole_files import write_whole

JSON_FILE, TABLE_FILE, PLOT_FILE, LINES_FILE = "results.json", "results.md", "plot.svg", "runs.jsonl"
PICTURES = "pictures"


def document(study: Experiment, rows: Sequence[Row], jobs: int) -> dict[str, Any]:
    """Everything as plain data: where it was made, groups with their spreads, and every run."""
    return {
        "format": FORMAT,
        "experiment": study.name,
        "sentence": study.sentence,
        "version": version(),
        "machine": {"cores": os.cpu_count(), "processor": platform.machine(), "jobs": jobs},
        "seeds": seeds_of(rows),
        "groups": [group_json(group, study.columns) for group in grouped(rows)],
        "pooled": [group_json(group, study.columns) for group in pooled_groups(study, rows)],
        "runs": [row.as_json() for row in rows],
    }


def section(study: Experiment, rows: Sequence[Row], jobs: int) -> str:
    """Text and tables in Markdown: all runs together first, then each setting."""
    seeds = seeds_of(rows)
    text = f"{study.sentence}\n\n```\ntactile-lab experiment {study.name}\n```\n\n"
    text += f"Seeds {_ranges(seeds)}; {len(rows)} runs, {jobs} at a time on {os.cpu_count()} cores. "
    text += "Where a heading says nothing else, three figures are median / p90 / maximum.\n\n"
    if any(column.key == "hausdorff_mm" for column in study.columns):
        text += "Hausdorff distances are at the best fit; a run without a shape counts as infinitely wrong.\n\n"
    if study.left_out():
        text += f"Not run: {study.left_out()}.\n\n"
    pooled = pooled_groups(study, rows)
    if pooled:
        text += f"All values of {' and '.join(study.pooled)} together:\n\n"
        text += markdown(table(pooled, study.columns, UNITS)) + "\n"
    return text + markdown(table(grouped(rows), study.columns, UNITS))


def pooled_groups(study: Experiment, rows: Sequence[Row]) -> list[Group]:
    """Groups over the settings that the experiment pools; none if it has only one value of them."""
    distinct = {tuple(row.cell[name] for name in study.pooled) for row in rows}
    return grouped(rows, over=study.pooled) if len(distinct) > 1 else []


def seeds_of(rows: Sequence[Row]) -> list[int]:
    """All seeds, in order."""
    return sorted({row.cell.seed for row in rows})


def write_report(study: Experiment, rows: Sequence[Row], folder: Path, jobs: int) -> None:
    """Write the three files.

    Raises:
        WriteError: the folder can not be written.
    """
    texts = {
        JSON_FILE: json.dumps(document(study, rows, jobs), indent=1, allow_nan=False) + "\n",
        TABLE_FILE: section(study, rows, jobs),
        PLOT_FILE: _plot(study, rows),
    }
    for name, text in texts.items():
        write_whole(folder / name, text, "Choose another folder with --out")


def insert_section(page: Path, study: Experiment, rows: Sequence[Row], jobs: int) -> None:
    """Put an experiment's section between its two marks in a Markdown document, in place of what is there.

    The marks are comments of the form ``<!-- experiment NAME -->`` and ``<!-- end NAME -->``. The plot goes into the
    folder ``pictures`` beside the document.

    Raises:
        SessionError: the document can not be read, or does not have the marks.
        WriteError: it, or the plot, can not be written.
    """
    begin, end = f"<!-- experiment {study.name} -->", f"<!-- end {study.name} -->"
    picture = Path(PICTURES) / f"{study.name}.svg"
    try:
        before, found, rest = page.read_text(encoding="utf-8").partition(begin)
    except OSError as error:
        raise SessionError(f"can not be read ({error.strerror})", where=str(page), hint="Check the path") from error
    _, closed, after = rest.partition(end)
    if not (found and closed):
        hint = f"Add the lines {begin} and {end} where the section belongs"
        raise SessionError(f"has no place for {study.name}", where=str(page), hint=hint)
    text = f"{section(study, rows, jobs)}\n![{study.sentence}]({picture.as_posix()})\n"
    write_whole(page.parent / picture, _plot(study, rows))
    write_whole(page, f"{before}{begin}\n\n{text}\n{end}{after}")


def _plot(study: Experiment, rows: Sequence[Row]) -> str:
    return study.plot(study.sentence.rstrip("."), rows)


def _ranges(seeds: Sequence[int]) -> str:
    """Numbers with neighbours joined: 1-3, 7."""
    parts: list[list[int]] = []
    for seed in seeds:
        if parts and seed == parts[-1][-1] + 1:
            parts[-1].append(seed)
        else:
            parts.append([seed])
    return ", ".join(f"{part[0]}-{part[-1]}" if len(part) > 1 else str(part[0]) for part in parts)
