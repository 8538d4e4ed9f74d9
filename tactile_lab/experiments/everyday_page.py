"""The catalogue of everyday objects with a picture of each, from the file of finished runs.

``python -m tactile_lab.experiments.everyday_page RUNS.jsonl`` writes docs/everyday-objects.md and its pictures.
"""

from __future__ import annotations

import json
import sys
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from textwrap import fill
from typing import Any

from drivers.core.atomic_files import write_whole
from tactile_lab.experiments.cells import Row
from tactile_lab.experiments.data.silhouettes import VIEWS, Lines
from tactile_lab.experiments.figure_texts import UNKNOWN
from tactile_lab.experiments.results.pages import WIDTH
from tactile_lab.experiments.studies import everyday_sessions
from tactile_lab.experiments.summary import markdown

DOCS = Path("docs")
PAGE, PICTURES = "everyday-objects.md", "pictures/everyday"

_INTRODUCTION = """What came of whole sessions of the simulated hand (rig `sim`, five Nano17, 0.3 kg) on everyday
objects, as `tactile-lab run --rig sim --object mesh:FILE --dimension 3 --grasps {grasps} --seed {seeds} --pose POSE`
runs them: nothing is known of an object before. Seven are scans of the YCB set, which are not in the repository; the
others are made by `tactile_lab/experiments/data/household.py`. One session an object: what one seed shows, no
statistics. {count} of the experiment's {planned} objects and poses have been run."""

_KEY = """In the pictures: grey the object, blue the model (best fit), from the front and from above; dots are
contacts of closing fingers, squares those of touches without a grasp. No finger comes to the underside, nor into what
is narrow and deep: there the model guesses."""

_COLUMNS = (
    ("grasps and touches", "grasps_done", 0, 1.0),
    ("contacts", "contacts", 0, 1.0),
    ("Hausdorff where touched, mm", "touched_hausdorff_mm", 1, 1.0),
    ("touched, %", "touched_share", 0, 100.0),
    ("Hausdorff, mm", "hausdorff_mm", 1, 1.0),
    ("mean, mm", "mean_mm", 1, 1.0),
    ("registration, mm", "registration_mm", 1, 1.0),
    ("outside a grasp, N", "outside_N", 2, 1.0),
    ("in a grasp, N", "grasp_N", 1, 1.0),
    ("moved, mm", "moved_mm", 1, 1.0),
    ("simulated min", "minutes", 1, 1.0),
    ("processor min", "cpu_minutes", 1, 1.0),
)

_STYLE = """svg{background:#fff} .true{fill:#c9ced6;fill-rule:evenodd} .model{fill:none;stroke:#1d5fa8;stroke-width:.8}
.closed{fill:#c2570c} .probed{fill:#1a8f6a} text{font:5px system-ui,"DejaVu Sans",sans-serif;fill:#1b2330}"""
_MARGIN_mm, _DOT_mm = 8.0, 1.3


def everyday_page(rows: Sequence[Row], version: str) -> str:
    """The page in Markdown, of runs in space.

    Args:
        rows: one an object and pose; others with the same are left out.
        version: of the sources that made them.
    """
    rows = _one_each(rows)
    seeds = ", ".join(str(seed) for seed in sorted({row.cell.seed for row in rows}))
    grasps = ", ".join(str(count) for count in sorted({int(row.cell["grasps"]) for row in rows}))
    planned = sum(dict(setting)["dimension"] == 3 for setting in everyday_sessions.settings(0))
    introduction = _INTRODUCTION.format(grasps=grasps, seeds=seeds, count=len(rows), planned=planned)
    commands = [
        f"tactile-lab experiment everyday-objects --seeds {seeds} --only dimension=3 --grasps {grasps}",
        "python -m tactile_lab.experiments.everyday_page runs/experiments/everyday-objects/runs.jsonl",
    ]
    begin = [
        "# Everyday objects",
        fill(" ".join(introduction.split()), WIDTH, break_on_hyphens=False),
        "\n".join(["```", *commands, "```"]),
        f"Made by sources {version}.",
        markdown(_table(rows)).rstrip("\n"),
        fill(" ".join(_KEY.split()), WIDTH),
    ]
    return "\n\n".join([*begin, *(_entry(row) for row in rows)]) + "\n"


def _one_each(rows: Sequence[Row]) -> list[Row]:
    """The first run of each object and pose in space."""
    found: dict[tuple[str, str], Row] = {}
    for row in rows:
        if row.cell["dimension"] == 3 and row.figures is not None:
            found.setdefault((row.cell["object"], row.cell["pose"]), row)
    return list(found.values())


def _table(rows: Sequence[Row]) -> list[list[str]]:
    head = ["object", "pose", "ended", *(title for title, *_ in _COLUMNS)]
    return [head, *([_name(row), row.cell["pose"], *_figures(row)] for row in rows)]


def _figures(row: Row) -> Iterator[str]:
    figures = row.figures or {}
    yield str(figures.get("ending", UNKNOWN))
    for _, key, digits, factor in _COLUMNS:
        value = figures.get(key)
        yield UNKNOWN if value is None else f"{factor * value:.{digits}f}"


def _entry(row: Row) -> str:
    figures: Mapping[str, Any] = row.figures or {}
    shown = f"![{_title(row)}]({PICTURES}/{_file(row)})" if "picture" in figures else "There is no model."
    return f"## {_title(row)}\n\n{fill(_sentence(figures['ending'], figures['reason']), WIDTH)}\n\n{shown}"


def _sentence(ending: str, reason: str) -> str:
    return f"Ended {ending}: {reason}."


def _name(row: Row) -> str:
    return str(row.cell["object"]).removeprefix("ycb:").replace("_", " ")


def _title(row: Row) -> str:
    return f"{_name(row).capitalize()}, {row.cell['pose']}"


def _file(row: Row) -> str:
    return f"{_name(row).replace(' ', '-')}-{row.cell['pose']}.svg"


def pictures(rows: Sequence[Row]) -> dict[str, str]:
    """The pictures as SVG, by the names of their files."""
    found = {_file(row): (row.figures or {}).get("picture") for row in _one_each(rows)}
    return {name: draw_object(shown) for name, shown in found.items() if shown is not None}


def draw_object(shown: Mapping[str, Any]) -> str:
    """The views of one object side by side, as SVG; all places in millimetres.

    Args:
        shown: "true" and perhaps "model", closed lines by the name of the view; "closed" and "probed", places by view.
    """
    parts, left_mm, height_mm = [], 0.0, 0.0
    for view in VIEWS:
        low, high = _bounds([*shown["true"][view], *shown.get("model", {}).get(view, [])])
        x_mm, y_mm = left_mm + _MARGIN_mm - low[0], high[1] + _MARGIN_mm
        parts.append(f'<g transform="translate({x_mm:.1f} {y_mm:.1f}) scale(1 -1)">{_view(shown, view)}</g>')
        title = (
            f"from {'the front' if view == 'front' else 'above'}, {high[0] - low[0]:.0f} x {high[1] - low[1]:.0f} mm"
        )
        parts.append(f'<text x="{left_mm + _MARGIN_mm:.1f}" y="5">{title}</text>')
        left_mm += high[0] - low[0] + 2 * _MARGIN_mm
        height_mm = max(height_mm, high[1] - low[1] + 2 * _MARGIN_mm)
    box = f'viewBox="0 0 {left_mm:.0f} {height_mm:.0f}" width="{3 * left_mm:.0f}" height="{3 * height_mm:.0f}"'
    return f'<svg xmlns="http://www.w3.org/2000/svg" {box}><style>{_STYLE}</style>{"".join(parts)}</svg>\n'


def _view(shown: Mapping[str, Any], view: str) -> str:
    half, side = _DOT_mm, 2 * _DOT_mm
    lines = [f'<path class="{kind}" d="{_path(shown[kind][view])}"/>' for kind in ("true", "model") if kind in shown]
    dots = [f'<circle class="closed" cx="{x}" cy="{y}" r="{half}"/>' for x, y in shown["closed"][view]]
    squares = [
        f'<rect class="probed" x="{x - half:.1f}" y="{y - half:.1f}" width="{side}" height="{side}"/>'
        for x, y in shown["probed"][view]
    ]
    return "".join([*lines, *dots, *squares])


def _path(lines: Lines) -> str:
    return "".join("M" + "L".join(f"{x} {y}" for x, y in line) + "Z" for line in lines)


def _bounds(lines: Lines) -> tuple[tuple[float, float], tuple[float, float]]:
    right, up = zip(*(place for line in lines for place in line), strict=True)
    return (min(right), min(up)), (max(right), max(up))


def main(file: str) -> None:
    """Write the page and its pictures from a file of finished runs."""
    head, *lines = Path(file).read_text(encoding="utf-8").splitlines()
    rows = [Row.from_json(json.loads(line)) for line in lines]
    (DOCS / PICTURES).mkdir(exist_ok=True)
    write_whole(DOCS / PAGE, everyday_page(rows, json.loads(head)["version"]))
    for name, text in pictures(rows).items():
        write_whole(DOCS / PICTURES / name, text)


if __name__ == "__main__":
    main(sys.argv[1])
