"""Why a result may be wrong, in words, and the other placings of grasps that the contacts allow."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from tactile_lab.evaluation.result_warnings import result_warnings
from tactile_lab.report.content import ReportContent
from tactile_lab.report.markup import Markup, element, table

_TITLES = ("grasps", "probability", "turned by", "moved by", "all contacts, RMS")


def doubts_card(content: ReportContent) -> Markup:
    """All warnings about the result, and its alternatives; nothing if there are none."""
    told = [element("li", text) for text in result_warnings(content.results)]
    others = content.results.slam.get("alternatives") or ()
    if not told and not others:
        return Markup("")
    parts = [element("h3", "What to doubt"), element("ul", *told)] if told else []
    if others:
        rows = [_row(alternative) for alternative in others]
        note = "Other placings that the contacts allow, with their probabilities; the rest is the estimate's."
        parts += [element("h3", "Alternatives"), element("div", table(_TITLES, rows), class_="scroll")]
        parts.append(element("p", note, class_="note"))
    return element("div", *parts, class_="card wide")


def _row(alternative: Mapping[str, Any]) -> list[str | Markup]:
    """One placing, grasps counted from 1."""
    first, last = alternative["grasps"][0] + 1, alternative["grasps"][-1] + 1
    whole = len(alternative["grasps"]) == last - first + 1
    which = str(first) if first == last else f"{first} to {last}"
    return [
        which if whole else ", ".join(str(grasp + 1) for grasp in alternative["grasps"]),
        f"{alternative['probability']:.0%}",
        f"{np.degrees(alternative['turn_rad']):.0f}°",
        f"{1e3 * alternative['shift_m']:.0f} mm",
        f"{1e3 * alternative['rms_m']:.1f} mm",
    ]
