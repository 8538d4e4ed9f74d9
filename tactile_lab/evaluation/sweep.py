"""Many sessions in one table: objects x seeds x dimensions, with spread and failures."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import product
from typing import Any

from tactile_lab.evaluation.consistency.levels import LEVELS
from tactile_lab.evaluation.registration import FAILURE_LIMIT_MM
from tactile_lab.evaluation.spread import Spread

UNKNOWN = "\u2013"


@dataclass(frozen=True)
class SweepRun:
    """One session to run."""

    object_name: str
    dimension: int
    seed: int


@dataclass(frozen=True)
class SweepRow:
    """The outcome of one run.

    Attributes:
        run: the session.
        evaluation: content of its ``evaluation.json``, and why it ``ended_early``; None if there is none.
        problem: why there is none, "" otherwise.
    """

    run: SweepRun
    evaluation: Mapping[str, Any] | None
    problem: str = ""

    @property
    def failure(self) -> str:
        """Why the run counts as failed, or ""."""
        if self.evaluation is None:
            return self.problem or "no evaluation"
        if early := self.evaluation.get("ended_early"):
            return f"ended {early}"
        if self.evaluation.get("status") == "lost":
            return "object lost"
        if self.evaluation.get("failed"):
            return f"registration above {FAILURE_LIMIT_MM:g} mm"
        return "" if self.figure("shape_best_fit", "hausdorff_mm") is not None else "no shape"

    def line(self) -> str:
        """The row in one line, for progress."""
        head = f"{self.run.object_name}, {self.run.dimension}-D, seed {self.run.seed}"
        if self.failure:
            return f"{head}: failed, {self.failure}"
        figures = (self.figure("shape_best_fit", "hausdorff_mm"), self.figure("pose", "rmse_mm"))
        hausdorff, position = (UNKNOWN if figure is None else f"{figure:.1f}" for figure in figures)
        return f"{head}: Hausdorff {hausdorff} mm at best fit, position {position} mm"

    def as_json(self) -> dict[str, Any]:
        """Run, evaluation and failure as plain data."""
        run = {"object": self.run.object_name, "dimension": self.run.dimension, "seed": self.run.seed}
        return {**run, "failure": self.failure or None, "evaluation": self.evaluation}

    def figure(self, *keys: str | int) -> float | None:
        """A metric of the evaluation by its keys, a number being a place in a list; None if it is unknown."""
        value: Any = self.evaluation
        for key in keys:
            value = value[key] if isinstance(key, int) and value else value.get(key) if value else None
        return None if value is None else float(value)


COLUMNS = (
    ("Hausdorff, mm", ("shape", "hausdorff_mm"), 1),
    ("Hausdorff at best fit, mm", ("shape_best_fit", "hausdorff_mm"), 1),
    ("mean distance at best fit, mm", ("shape_best_fit", "mean_distance_mm"), 1),
    ("position RMSE, mm", ("pose", "rmse_mm"), 1),
    ("rotation RMSE, °", ("pose", "rmse_deg"), 1),
    ("registration, mm", ("registration_rms_mm",), 1),
    ("signed distance, mm", ("consistency", "surface", "signed_mm"), 2),
    ("share inside its 95 %", ("consistency", "surface", "inside", LEVELS.index(0.95)), 2),
)
"""Metrics of a summary: heading, keys in ``evaluation.json``, decimals. A signed distance is positive outside."""


@dataclass(frozen=True)
class SweepSummary:
    """All runs of one object in one dimension.

    Attributes:
        object_name, dimension: of the runs.
        runs: number of runs.
        spreads: one for each of :data:`COLUMNS`, over all runs with a value, including failed ones.
        failures: seed and reason of each failed run.
    """

    object_name: str
    dimension: int
    runs: int
    spreads: tuple[Spread | None, ...]
    failures: tuple[tuple[int, str], ...]


def planned_runs(objects: Sequence[str], dimensions: Sequence[int], seeds: Sequence[int]) -> list[SweepRun]:
    """Every combination, seeds fastest."""
    return [SweepRun(*combination) for combination in product(objects, dimensions, seeds)]


def summaries(rows: Sequence[SweepRow]) -> list[SweepSummary]:
    """One summary for each object and dimension, in the order of the rows."""
    groups: dict[tuple[str, int], list[SweepRow]] = {}
    for row in rows:
        groups.setdefault((row.run.object_name, row.run.dimension), []).append(row)
    return [_summary(name, dimension, group) for (name, dimension), group in groups.items()]


def _summary(name: str, dimension: int, rows: list[SweepRow]) -> SweepSummary:
    spreads = tuple(Spread.of_known(row.figure(*keys) for row in rows) for _, keys, _ in COLUMNS)
    failures = tuple((row.run.seed, row.failure) for row in rows if row.failure)
    return SweepSummary(name, dimension, len(rows), spreads, failures)


def markdown_table(found: Sequence[SweepSummary]) -> str:
    """The summaries as a Markdown table: median / p90 / maximum, and the failures with their seeds."""
    titles = summary_titles()
    lines = [_markdown_row(titles), _markdown_row(["---", *["---:"] * (len(titles) - 2), "---"])]
    lines += [_markdown_row(summary_cells(summary)) for summary in found]
    return "\n".join(lines) + "\n"


def summary_titles() -> list[str]:
    """Headings of :func:`summary_cells`."""
    return ["object", "dim.", "runs", *(title for title, _, _ in COLUMNS), "failed", "seeds and reasons"]


def summary_cells(summary: SweepSummary) -> list[str]:
    """One summary as a row of texts."""
    spreads = [
        UNKNOWN if spread is None else spread.text(digits)
        for spread, (_, _, digits) in zip(summary.spreads, COLUMNS, strict=True)
    ]
    reasons = "; ".join(f"{seed}: {reason}" for seed, reason in summary.failures)
    head = [summary.object_name, str(summary.dimension), str(summary.runs)]
    return [*head, *spreads, str(len(summary.failures)), reasons]


def _markdown_row(cells: Sequence[str]) -> str:
    return "| " + " | ".join(" ".join(cell.replace("|", "\\|").split()) for cell in cells) + " |"
