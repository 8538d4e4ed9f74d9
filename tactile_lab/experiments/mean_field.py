"""How many grasps are still to go if each uncovers its mean share of every place: compiled."""

from __future__ import annotations

from typing import Any

import numpy as np

from tactile_lab.shape.compiled import compiled

_NOTHING = 1e-3
"""Places: where a grasp uncovers fewer, so many more are to go that their number does not matter."""


@compiled
def grasps_to_go(untouched: Any, means: Any, allowed: Any) -> Any:
    """Of the grasps that uncover most each, until ``allowed`` places are left; the last one counts in part.

    Args:
        untouched: of every place its share, shape (k,).
        means: probability that a grasp with a candidate touches a place, shape (k, a).
        allowed: how many places may be left.
    """
    left, open_places = untouched.copy(), np.sum(untouched)
    gains = np.zeros(means.shape[1], dtype=means.dtype)
    count = 0.0
    while open_places > allowed:
        gains[:] = 0.0
        for place in range(left.shape[0]):
            if left[place] > 0.0:
                for candidate in range(means.shape[1]):
                    gains[candidate] += left[place] * means[place, candidate]
        best = np.argmax(gains)
        if open_places - gains[best] <= allowed or gains[best] < _NOTHING:
            return count + (open_places - allowed) / max(gains[best], _NOTHING)
        for place in range(left.shape[0]):
            left[place] *= 1.0 - means[place, best]
        open_places -= gains[best]
        count += 1.0
    return count


@compiled
def after_grasps(untouched: Any, candidates: Any, touched: Any, means: Any, allowed: Any) -> Any:
    """What is left after one grasp more, for each of its possible outcomes.

    Args:
        untouched: places, one or zero, in each of several states, shape (b, k).
        candidates: what may be grasped in each, shape (b, t).
        touched: places in the outcomes of every candidate, shape (a, m, k).
        means, allowed: as above.

    Returns:
        Grasps to go, and how many places were touched for the first time, shape (b, t, m, 2).
    """
    found = np.zeros((candidates.shape[0], candidates.shape[1], touched.shape[1], 2))
    left = np.zeros(untouched.shape[1], dtype=untouched.dtype)
    for state in range(candidates.shape[0]):
        for option in range(candidates.shape[1]):
            for outcome in range(touched.shape[1]):
                new = 0.0
                for place in range(left.shape[0]):
                    left[place] = untouched[state, place]
                    if touched[candidates[state, option], outcome, place]:
                        new += left[place]
                        left[place] = 0.0
                found[state, option, outcome, 0] = grasps_to_go(left, means, allowed)
                found[state, option, outcome, 1] = new
    return found
