"""Warnings about untrustworthy results, with or without ground truth."""

from __future__ import annotations

import numpy as np

from drivers.core.contact_checks import touched_one_side
from tactile_lab.evaluation.files.results import Results
from tactile_lab.slam.doubt.known_part import LARGEST_SIGMA_m
from tactile_lab.slam.doubt.status import LEAST_KNOWN_SHARE


def result_warnings(results: Results) -> tuple[str, ...]:
    """All warnings about the results of an estimation."""
    said = (_warn_if_lost(results), _one_sided(results), _no_shape(results), _warn_of_guesses(results))
    doubts = [doubt["words"] for doubt in results.slam.get("doubts", ())]
    return (*results.slam.get("warnings", ()), *(text for text in said if text), *doubts)


def _warn_if_lost(results: Results) -> str:
    if results.status != "lost":
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
    """Older results have no known share: there the standard deviation alone says what is a guess."""
    if (sigma_m := results.sigma_quantiles_m) is None:
        return ""
    known = results.known_share
    share = float(np.mean(sigma_m <= LARGEST_SIGMA_m)) if known is None else known
    return f"{1 - share:.0%} of the shape is a guess: nothing was touched near it" if share < LEAST_KNOWN_SHARE else ""
