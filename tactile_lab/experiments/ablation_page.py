"""Writes the page of the ablation, and its column on the estimator's page, from the file of finished runs.

``python -m tactile_lab.experiments.ablation_page RUNS.jsonl`` writes docs/results/ablation.md and the column "worth" of
docs/estimator.md.
"""

from __future__ import annotations

import json
import sys
from collections.abc import Sequence
from pathlib import Path

from tactile_lab.evaluation.spread import Interval, quantile
from tactile_lab.experiments.cells import Row
from tactile_lab.experiments.figure_texts import UNKNOWN, paired
from tactile_lab.experiments.groups import LEFT_OUT, NOTHING, Column, Group, group_runs
from tactile_lab.experiments.runs.ablation_runs import (
    BIASED,
    CARRIED,
    GRASPS,
    LEFT,
    LONG,
    PLANE,
    SPACE,
    THINGS,
    WITHOUT,
    WRONG,
)
from tactile_lab.experiments.summary import markdown

PAGE, MAP = Path("docs/results/ablation.md"), Path("docs/estimator.md")
_HAUSDORFF = Column("Hausdorff", "hausdorff_mm", 2, kind="paired", most=20.0)
_SHOWN = (
    Column("registration, mm", "registration_mm", 2, kind="paired", most=10.0),
    _HAUSDORFF,
    Column("within 2 sigma", "within_2_sigma", 2, kind="paired"),
    Column("failed share", "failed", 2, kind="paired"),
)
_TIMES = (("steps", "step_ms"), ("end", "finish_ms"))
_NEGLIGIBLE = 0.005
"""Smaller mean differences are shown as zero, in the unit of the figure."""
_NOTHING = "0"

_INTRODUCTION = """# What each mechanism of the default method is worth

```
tactile-lab experiment ablation --seeds {seeds}
python -m tactile_lab.experiments.ablation_page runs/experiments/ablation/runs.jsonl
```

Version `{version}`. Simulated contacts (1 mm, 5 degrees) at full motion noise, five fingers, 12 grasps ({long} in
the long session); one contact in ten is wrong under "wrong contacts". Every run without a mechanism is compared with
the run of the same grasps that has all of them: mean difference and its 95 % interval (bootstrap over runs). Positive
is worse, but for "within 2 sigma". Bold: the interval does not hold zero. Registration counts up to 10 mm and Hausdorff
distance up to 20 mm, so that one lost object does not hide the others. "Same" is the number of runs that come out the
same to a micrometre; of these, those in which the mechanism itself reports that it changed nothing were not run
again. Means of fewer than five runs have no interval: they are anecdotes. Time is processor time without the
mechanism over that with all, of the runs that were made twice. Under "carried off" somebody puts the object elsewhere,
by up to 15 cm and any angle, after two thirds of the grasps. Under "left in place" nothing carries it, and every fourth
closing pushes it by 6 mm per axis and 10 degrees (standard deviations). Under "everyday things" nothing carries the
things either, every fourth closing pushes them by 3 mm and 3 degrees, grasps are spread over their whole height, and
Hausdorff distance and "within 2 sigma" are of what lies within 15 mm of a contact. Under "biased fingers" each
finger feels surfaces too far out or in by one error throughout, 0.8 mm (standard deviation), and its contacts state so.
{count} runs. Mechanisms that are "gone" were deleted for what is seen here
([decision 35](../decisions/0035-ablation.md)). The page holds for the version above only: `tactile-lab experiment age`
does not know it.

"""


def ablation_page(rows: Sequence[Row], version: str) -> str:
    """The page in Markdown."""
    seeds = sorted({row.cell.seed for row in rows})
    long = max((row.cell["grasps"] for row in rows if row.cell["condition"] == LONG), default=GRASPS[LONG])
    text = _INTRODUCTION.format(version=version, seeds=f"{seeds[0]}-{seeds[-1]}", count=len(rows), long=long)
    for condition in (PLANE, WRONG, SPACE, THINGS, BIASED, CARRIED, LEFT, LONG):
        groups = _groups(rows, condition)
        if len(groups) > 1:
            text += f"## {condition.capitalize()}\n\n{_full(groups)}\n\n{markdown(_table(groups))}\n"
    return text


def worth(rows: Sequence[Row], name: str) -> str:
    """The loss in Hausdorff distance without a mechanism, in the plane, with wrong contacts and in space, mm.

    Where these show nothing of it: in the condition that was made for it, with its name.
    """
    parts = [_loss(rows, name, condition) for condition in (PLANE, WRONG, SPACE)]
    if {UNKNOWN, _NOTHING}.issuperset(parts):
        for condition in (THINGS, BIASED, CARRIED, LEFT, LONG):
            if (part := _loss(rows, name, condition)) != UNKNOWN:
                return f"{part} {condition}"
    return " / ".join(parts)


def _loss(rows: Sequence[Row], name: str, condition: str) -> str:
    groups = _groups(rows, condition)
    found = [paired(group, _HAUSDORFF, groups) for group in groups if group[LEFT_OUT] == name]
    known = found[0] if found and found[0] is not None and found[0].low is not None else None
    return _bold(known, 2, with_interval=False)


def with_worth(page: str, rows: Sequence[Row]) -> str:
    """A page in which table lines that begin with the name of a mechanism end with what it is worth."""
    known = {row.cell[LEFT_OUT] for row in rows}
    lines = page.split("\n")
    for number, line in enumerate(lines):
        cells = line.split(" | ")
        if line.startswith("| ") and cells[0][2:] in known:
            lines[number] = " | ".join([*cells[:-1], f"{worth(rows, cells[0][2:])} |"])
    return "\n".join(lines)


def _groups(rows: Sequence[Row], condition: str) -> list[Group]:
    return group_runs([row for row in rows if row.cell["condition"] == condition], over=("shape", "grasps"))


def _full(groups: Sequence[Group]) -> str:
    full = next(group for group in groups if group[LEFT_OUT] == NOTHING)
    spreads = [
        f"{title} {full.spread(key).text(2)} mm"
        for title, key in (("registration", "registration_mm"), ("Hausdorff distance", "hausdorff_mm"))
    ]
    shapes = dict.fromkeys(str(row.cell["shape"]) for row in full.rows)
    seeds = sorted({row.cell.seed for row in full.rows})
    return (
        f"All mechanisms: {', '.join(spreads)} (median / p90 / maximum), {len(full.failures)} of {len(full.rows)} runs "
        f"failed, a step takes {quantile(full.pool('step_ms'), 0.5):.0f} ms and the end "
        f"{full.spread('finish_ms').median / 1e3:.1f} s (medians). {', '.join(shapes)}; "
        f"seeds {seeds[0]} to {seeds[-1]}."
    )


def _table(groups: Sequence[Group]) -> list[list[str]]:
    head = ["without", "runs", "same", *(column.title for column in _SHOWN), "time of steps", "time of the end"]
    body = []
    for group in groups:
        if group[LEFT_OUT] == NOTHING:
            continue
        same = sum(bool((row.figures or {}).get("same")) for row in group.rows)
        found = [_bold(paired(group, column, groups), column.digits) for column in _SHOWN]
        times = [_ratio(group, groups, key) for _, key in _TIMES]
        body.append([_titled(str(group[LEFT_OUT])), str(len(group.rows)), str(same), *found, *times])
    return [head, *body]


def _titled(name: str) -> str:
    return name if name in WITHOUT else f"{name} (gone)"


def _bold(interval: Interval | None, digits: int, *, with_interval: bool = True) -> str:
    if interval is None:
        return UNKNOWN
    if abs(interval.mean) < _NEGLIGIBLE:
        return _NOTHING
    text = interval.text(digits) if with_interval else f"{interval.mean:+.{digits}f}"
    return f"**{text}**" if interval.excludes_zero(_NEGLIGIBLE) else text


def _ratio(group: Group, groups: Sequence[Group], key: str) -> str:
    """Total processor time relative to the same runs with all mechanisms, for the runs that were made again."""
    made = {(row.cell["shape"], row.cell.seed) for row in group.rows if (row.figures or {}).get("rerun")}
    full = next(other for other in groups if other[LEFT_OUT] == NOTHING)
    totals = [
        sum(_total(row, key) for row in rows if (row.cell["shape"], row.cell.seed) in made)
        for rows in (group.rows, full.rows)
    ]
    return f"{100 * totals[0] / totals[1]:.0f} %" if totals[1] else UNKNOWN


def _total(row: Row, key: str) -> float:
    value = (row.figures or {}).get(key, 0.0)
    return float(sum(value) if isinstance(value, list) else value)


def main(file: str) -> None:
    """Write both pages from a file of finished runs."""
    head, *lines = Path(file).read_text(encoding="utf-8").splitlines()
    rows = [Row.from_json(json.loads(line)) for line in lines]
    PAGE.parent.mkdir(exist_ok=True)
    PAGE.write_text(ablation_page(rows, json.loads(head)["version"]), encoding="utf-8")
    MAP.write_text(with_worth(MAP.read_text(encoding="utf-8"), rows), encoding="utf-8")


if __name__ == "__main__":
    main(sys.argv[1])
