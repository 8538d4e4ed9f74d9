"""Tables of groups of runs: spreads over seeds and shapes, and failures with their reasons."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from tactile_lab.experiments.figure_texts import figure_json, texts, titles
from tactile_lab.experiments.groups import Column, Group, varying_settings


def table(
    groups: Sequence[Group], columns: Sequence[Column], units: Mapping[str, str], names: Sequence[str] | None = None
) -> list[list[str]]:
    """Header and body of the table as texts.

    Args:
        groups: one per row of the table.
        columns: figures to show.
        units: units of settings, by their names.
        names: settings to show; None for those that differ.
    """
    names = varying_settings(groups) if names is None else names
    head = [f"{name}, {units[name]}" if name in units else name for name in names]
    head += ["runs", *(title for column in columns for title in titles(column)), "failed", "why"]
    body = []
    for group in groups:
        cells = [text for column in columns for text in texts(group, column, groups)]
        failed = f"{len(group.failures)} ({100 * group.failed_share:.0f} %)" if group.failures else "0"
        body.append([*(str(group[name]) for name in names), str(len(group.rows)), *cells, failed, reasons(group)])
    return [head, *body]


def short_table(groups: Sequence[Group], columns: Sequence[Column]) -> list[list[str]]:
    """Header and body of a table that fits a terminal: settings that differ, the first two figures, and failures."""
    names, shown = varying_settings(groups), columns[:2]
    body = [[str(group[name]) for name in names] for group in groups]
    for line, group in zip(body, groups, strict=True):
        line += [text for column in shown for text in texts(group, column, groups)]
        line.append(f"{len(group.failures)} of {len(group.rows)}")
    return [[*names, *(title for column in shown for title in titles(column)), "failed"], *body]


def reasons(group: Group) -> str:
    """Why runs failed, the most frequent reason first, and with which seeds."""
    seeds: dict[str, list[int]] = {}
    for seed, reason in group.failures:
        seeds.setdefault(reason, []).append(seed)
    ordered = sorted(seeds.items(), key=lambda item: -len(item[1]))
    return "; ".join(f"{reason}: {len(found)} ({_shorten(sorted(set(found)))})" for reason, found in ordered)


def _shorten(seeds: list[int], most: int = 3) -> str:
    shown = ", ".join(map(str, seeds[:most]))
    return shown if len(seeds) <= most else f"{shown} and {len(seeds) - most} more"


def markdown(rows: Sequence[Sequence[str]]) -> str:
    """Header and body as a Markdown table; the last column is text, the others are numbers or names."""
    head, *body = rows
    lines = [head, ["---", *["---:"] * (len(head) - 2), "---"], *body]
    return "".join(
        "| " + " | ".join(" ".join(cell.replace("|", "\\|").split()) for cell in row) + " |\n" for row in lines
    )


def group_json(group: Group, columns: Sequence[Column]) -> dict[str, Any]:
    """A group as plain data: setting, numbers of runs, failures, and the spread of every figure of the table."""
    spreads = {column.key: figure_json(group, column) for column in columns}
    failures = [{"seed": seed, "reason": reason} for seed, reason in group.failures]
    return {"setting": dict(group.setting), "runs": len(group.rows), "failures": failures, "figures": spreads}
