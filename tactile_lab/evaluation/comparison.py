"""Compares several evaluations: methods on one session, or one method over several sessions.

Metrics are grouped by method; means have a 95 % confidence interval by Student's t. If all methods were run on the same
sessions, each is also compared with the first one, session by session, so that the sessions' difficulty cancels.
"""

from __future__ import annotations

import csv
import io
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from tactile_lab.evaluation.spread import Interval, Spread

FIGURES: tuple[tuple[str, tuple[str | int, ...]], ...] = (
    ("Hausdorff at best fit, mm", ("shape_best_fit", "hausdorff_mm")),
    ("mean distance at best fit, mm", ("shape_best_fit", "mean_distance_mm")),
    ("position RMSE, mm", ("pose", "rmse_mm")),
    ("rotation RMSE, °", ("pose", "rmse_deg")),
    ("aligned position RMSE (Umeyama), mm", ("pose_umeyama", "rmse_mm")),
    ("poses inside their 95 % regions, share", ("consistency", "poses", "inside", 2)),
    ("surface inside its 95 % band, share", ("consistency", "surface", "inside", 2)),
    ("registration, mm", ("registration_rms_mm",)),
    ("contact error, mm", ("sensing", "median_mm")),
)
"""Heading and keys in ``evaluation.json``."""
UNKNOWN = "–"


@dataclass(frozen=True)
class EvaluatedRun:
    """One evaluation.

    Attributes:
        session: name of the session.
        results: name of its folder of results.
        evaluation: content of ``evaluation.json``.
    """

    session: str
    results: str
    evaluation: Mapping[str, Any]

    @property
    def method(self) -> str:
        """The method, with the dimension."""
        return f"{self.evaluation['method']}, {self.evaluation['dimension']}-D"

    def figure(self, keys: Sequence[str | int]) -> float | None:
        """A metric by its keys, numbers being places in lists; None if it is unknown."""
        value: Any = self.evaluation
        for key in keys:
            if isinstance(key, int):
                value = value[key] if isinstance(value, list) and key < len(value) else None
            else:
                value = value.get(key) if isinstance(value, Mapping) else None
        return None if value is None else float(value)


@dataclass(frozen=True)
class Figure:
    """One metric of one method: number of values, spread, mean, and mean difference to the first method."""

    title: str
    count: int
    spread: Spread | None
    mean: Interval | None
    against_first: Interval | None


@dataclass(frozen=True)
class MethodSummary:
    """All evaluations of one method."""

    method: str
    runs: int
    failed: int
    figures: tuple[Figure, ...]


def compare(runs: Sequence[EvaluatedRun]) -> list[MethodSummary]:
    """One summary per method, in order of appearance.

    Several results of one method on one session are not independent runs: then each results folder is a separate group,
    with its name.
    """
    counts = Counter((each.session, each.method) for each in runs)
    repeated = {method for (_, method), count in counts.items() if count > 1}
    groups: dict[str, list[EvaluatedRun]] = {}
    for each in runs:
        name = f"{each.method}, {each.results}" if each.method in repeated else each.method
        groups.setdefault(name, []).append(each)
    first = next(iter(groups.values()))
    return [_summary(method, group, first) for method, group in groups.items()]


def _summary(method: str, group: Sequence[EvaluatedRun], first: Sequence[EvaluatedRun]) -> MethodSummary:
    failed = sum(bool(each.evaluation.get("failed")) for each in group)
    return MethodSummary(
        method, len(group), failed, tuple(_figure(title, keys, group, first) for title, keys in FIGURES)
    )


def _figure(
    title: str, keys: Sequence[str | int], group: Sequence[EvaluatedRun], first: Sequence[EvaluatedRun]
) -> Figure:
    known = [value for each in group if (value := each.figure(keys)) is not None]
    mean = Interval.of(known) if known else None
    return Figure(title, len(known), Spread.of_known(known), mean, _difference(keys, group, first))


def _difference(
    keys: Sequence[str | int], group: Sequence[EvaluatedRun], first: Sequence[EvaluatedRun]
) -> Interval | None:
    """Mean difference to the first method over common sessions; None for the first method itself."""
    if group is first:
        return None
    base = {each.session: each.figure(keys) for each in first}
    pairs = [(each.figure(keys), base.get(each.session)) for each in group]
    differences = [mine - theirs for mine, theirs in pairs if mine is not None and theirs is not None]
    return Interval.of(differences) if differences else None


def rows_csv(runs: Sequence[EvaluatedRun]) -> str:
    """One line per evaluation; unknown metrics are empty."""
    out = io.StringIO()
    writer = csv.writer(out, lineterminator="\n")
    writer.writerow(["session", "results", "object", "method", "seed", "grasps", "status", "failed", *_columns()])
    for each in runs:
        content = each.evaluation
        head = [each.session, each.results, content["object"], each.method, content["seed"], content["grasps"]]
        figures = ["" if (value := each.figure(keys)) is None else f"{value:.6g}" for _, keys in FIGURES]
        writer.writerow([*head, content["status"], content["failed"], *figures])
    return out.getvalue()


def _columns() -> list[str]:
    return [".".join(map(str, keys)) for _, keys in FIGURES]


def table(summaries: Sequence[MethodSummary]) -> list[list[str]]:
    """Header and body: a line per method and metric."""
    head = ["method", "figure", "n", "median / p90 / max", "mean [95 %]", "relative to the first [95 %]", "failed"]
    body = []
    for summary in summaries:
        for figure in summary.figures:
            if figure.spread is None or figure.mean is None:
                continue
            against = UNKNOWN if figure.against_first is None else figure.against_first.text(2)
            spread, mean = figure.spread.text(2), figure.mean.text(2)
            failed = f"{summary.failed} of {summary.runs}"
            body.append([summary.method, figure.title, str(figure.count), spread, mean, against, failed])
    return [head, *body]


def short_table(summaries: Sequence[MethodSummary]) -> list[list[str]]:
    """Header and body of a table that fits a terminal."""
    head, *body = table(summaries)
    return [[line[0], line[1], line[2], line[4], line[5]] for line in [head, *body]]


def markdown(summaries: Sequence[MethodSummary]) -> str:
    """The table in Markdown."""
    head, *body = table(summaries)
    lines = [head, ["---", "---", *["---:"] * (len(head) - 2)], *body]
    return "".join(f"| {' | '.join(line)} |\n" for line in lines)
