"""Warnings about untrustworthy results, with or without ground truth."""

from __future__ import annotations

import numpy as np

from drivers.core.contact_checks import touched_one_side
from tactile_lab.evaluation.files.results import Results

UNSUPPORTED_SIGMA_m = 0.005
"""Where the shape is less certain than this it is only interpolated between contacts."""

_WORTH_TELLING = 0.1


def result_warnings(results: Results) -> tuple[str, ...]:
    """All warnings about the results of an estimation."""
    said = (_warn_if_lost(results), _one_sided(results), _no_shape(results), _warn_of_guesses(results))
    return (*results.slam.get("warnings", ()), *(text for text in said if text))


def _warn_if_lost(results: Results) -> str:
    if results.slam["status"] == "ok":
        return ""
    untracked = sum(step["verdict"] == "untracked" for step in results.slam["steps"])
    return f"the object is lost: {untracked} of {len(results.slam['steps'])} grasps could not be registered"


def _one_sided(results: Results) -> str:
    if touched_one_side([rows.normals_world for rows in results.contacts]):
        return "every grasp touched only one side of the object: its other sides are unknown"
    return ""


def _no_shape(results: Results) -> str:
    return "no closed shape could be estimated from the contacts" if results.sigma_quantiles_m is None else ""


def _warn_of_guesses(results: Results) -> str:
    if (sigma_m := results.sigma_quantiles_m) is None:
        return ""
    share = float(np.mean(sigma_m > UNSUPPORTED_SIGMA_m))
    if share <= _WORTH_TELLING:
        return ""
    return f"{share:.0%} of the shape is a guess between contacts: uncertain by more than 5 mm"
