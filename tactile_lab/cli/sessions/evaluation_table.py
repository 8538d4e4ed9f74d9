"""The evaluation as text of 80 columns: shape, pose and other metrics."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from rich.table import Table
from rich.text import Text

from tactile_lab.cli.console import answer, answers, count
from tactile_lab.evaluation.registration import registration_verdict
from tactile_lab.evaluation.table import further_text, one_draw

UNKNOWN = "–"

_SHAPE = (
    ("Hausdorff distance", "hausdorff_mm", 2, "mm", "maximum, both directions"),
    ("Mean distance", "mean_distance_mm", 2, "mm", "both directions"),
    ("Chamfer distance", "chamfer_mm", 2, "mm", "sum of both directions"),
    ("F-score at 1 mm", "fscore_1mm", 3, "  ", "both surfaces"),
    ("F-score at 2 mm", "fscore_2mm", 3, "  ", "both surfaces"),
    ("Overlap", "iou", 3, "  ", "intersection over union"),
)
_JUDGED = (
    ("poses", "Poses, first grasp"),
    ("poses_common", "Poses, common frame"),
    ("surface", "Surface, best fit"),
)
_POSE = (("Position error", "mm", "mm"), ("Rotation error", "deg", "° "))


def show_evaluation(content: Mapping[str, Any]) -> None:
    """Print the content of ``evaluation.json``; unknown values show as a dash."""
    made = f"{content['dimension']}-D, method {content['method']}, seed {content['seed']}"
    basis = f"{count(content['grasps'], 'grasp')}, {count(content['contacts'], 'contact')}"
    answers().print()
    answer(
        f"Evaluation of {content['object']} ({made}; {basis})",
        "bold",
    )
    for grid in (_shape(content), _pose(content.get("pose") or {}), *_consistency(content), _rest(content)):
        answers().print()
        answers().print(grid)
    answers().print()


def _shape(content: Mapping[str, Any]) -> Table:
    first, best = content.get("shape") or {}, content.get("shape_best_fit") or {}
    grid = _grid(("shape, aligned by", "first grasp", "best fit"), "")
    for label, key, digits, unit, note in _SHAPE:
        grid.add_row(label, _figure(first.get(key), unit, digits), _figure(best.get(key), unit, digits), note)
    return grid


def _pose(pose: Mapping[str, Any]) -> Table:
    grid = _grid(("pose", "RMS", "at the end", "between grasps", "drift per grasp"))
    for label, key, unit in _POSE:
        keys = (f"rmse_{key}", f"final_{key}", f"step_{key}", f"drift_{key}_per_grasp")
        grid.add_row(label, *(_figure(pose.get(name), unit) for name in keys))
    return grid


def _consistency(content: Mapping[str, Any]) -> list[Table]:
    """How often the truth is inside the stated regions; nothing without the truth."""
    judged = content.get("consistency") or {}
    known = [(label, judged[key]) for key, label in _JUDGED if judged.get(key)]
    if not known:
        return []
    grid = _grid(("truth inside the stated", *(f"{100 * level:.0f} %" for level in judged["levels"])), "")
    for label, found in known:
        scored = f"NEES {found['nees']:.2f}" if "nees" in found else f"mean {found['signed_mm']:+.2f} mm"
        grid.add_row(label, *(f"{100 * share:.0f} %" for share in found["inside"]), scored)
    words = one_draw(content.get("uncertainty") or {}) if judged.get("surface") else ""
    return [grid, *([_grid((words[0].upper() + words[1:],))] if words else [])]


def _rest(content: Mapping[str, Any]) -> Table:
    sensing, loops, time, truth = (content.get(key) or {} for key in ("sensing", "loops", "time", "truth"))
    share = f"from the true surface, 95 % below {_figure(sensing.get('p95_mm'), 'mm')}"
    spread = f"95 % below {_figure(time.get('step_ms_p95'), 'ms', 0)}; {_figure(time.get('total_s'), 's', 1)} in all"
    seen = f"of {count(content['grasps'], 'grasp')} known"
    grid = _grid(("other metrics", ""), "")
    grid.add_row("Registration error", _figure(content.get("registration_rms_mm"), "mm"), _verdict(content))
    aligned = content.get("pose_umeyama") or {}
    grid.add_row("Aligned position error", _figure(aligned.get("rmse_mm"), "mm"), "RMS after rigid alignment (Umeyama)")
    grid.add_row("Contact error, median", _figure(sensing.get("median_mm"), "mm"), share)
    if loops.get("tested"):
        wrong = f"accepted of {_count(loops['tested'])} tested, {_count(loops.get('wrong'))} of them wrong"
        grid.add_row("Loops", _figure(loops.get("accepted"), "  ", 0), wrong)
    grid.add_row("True poses", _figure(truth.get("seen"), "  ", 0), seen)
    grid.add_row("Time per step, median", _figure(time.get("step_ms_median"), "ms", 0), spread)
    grid.add_row("Status", f"{content.get('status', UNKNOWN)}   ", _touched(content))
    for name, value in (content.get("further") or {}).items():
        grid.add_row(name, f"{further_text(value)}   ", "")
    return grid


def _touched(content: Mapping[str, Any]) -> str:
    share = content.get("known_share")
    return "" if share is None else f"{share:.0%} of the shape was touched"


def _verdict(content: Mapping[str, Any]) -> Text:
    error_mm = content.get("registration_rms_mm")
    if error_mm is None:
        return Text("unknown without ground truth")
    passed, words = registration_verdict(error_mm, content.get("symmetry_turns"))
    return Text(words, style="green" if passed else "bold red")


def _grid(titles: tuple[str, ...], *notes: str) -> Table:
    """A table without rules: a label, right-aligned figures, left-aligned notes."""
    grid = Table(box=None, pad_edge=False, padding=(0, 2, 0, 0), header_style="dim")
    grid.add_column(titles[0], min_width=21, no_wrap=True)
    for title in titles[1:]:
        grid.add_column(title, justify="right", min_width=11, no_wrap=True)
    for note in notes:
        grid.add_column(note, style="dim")
    return grid


def _figure(value: float | None, unit: str, digits: int = 2) -> str:
    return f"{UNKNOWN} {' ' * len(unit)}" if value is None else f"{value:.{digits}f} {unit}"


def _count(value: int | None) -> str:
    return UNKNOWN if value is None else str(value)
