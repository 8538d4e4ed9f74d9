"""The weight of an object that never hung free, by how little the table still holds it back.

Dragged, an object is held back by friction times its weight; tipped onto an edge, by friction times what the fingers
leave to the table. Both together tell friction and weight.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.optimize import least_squares

from drivers.core.contacts import Array
from sessions.perception.carrying.net_wrench import NetWrench
from sessions.perception.weighing.value import Value

_SPEED_SHARE = 0.5
"""Share of the largest speed below which the hand counts as turning round."""
_FREE_SHARE = 0.02
"""Of its weight: by this an object seems to be held back that hangs free."""
_MOST_LEFT = 0.5
"""Of the friction of the dragged object: an edge that is held back by more carries most of the weight, and the fingers
slip.
"""
_PULL_N, _PULL_SHARE, _CARRIED_SHARE = 0.05, 0.2, 0.04
"""Errors of a pull, and of what the fingers carry."""
_USUAL_FRICTION, _FRICTION_NATS = 0.3, 1.0
"""Of tables, and how far from that they may be."""
_MOST_UNSURE = 0.2
"""Share of the weight: less certain, it is not told."""


@dataclass(frozen=True)
class TablePull:
    """How the table holds an object back that is moved to and fro, in the mean of both ways.

    Attributes:
        friction_N: against the motion.
        carried_N: upward force of the fingertips meanwhile.
    """

    friction_N: float
    carried_N: float


def there_and_back(wrench: NetWrench) -> tuple[Array, Array, Array]:
    """The pull on the object along the motion (N, shape (n,)), and in which samples it moves one way and the other."""
    speed = np.gradient(wrench.palm_m[:, :2], axis=0)
    way = np.linalg.svd(wrench.palm_m[:, :2] - wrench.palm_m[:, :2].mean(axis=0))[2][0]
    along = speed @ way
    fast = _SPEED_SHARE * np.quantile(np.abs(along), 0.9)
    return wrench.force_N[:, :2] @ way, along > fast, along < -fast


def table_pull(wrench: NetWrench) -> TablePull | None:
    """The mean over what was moved to and fro; None if it was not moved both ways."""
    pull_N, there, back = there_and_back(wrench)
    if not (there.any() and back.any()):
        return None
    upward_N = wrench.force_N[:, 2]
    carried_N = (upward_N[there].mean() + upward_N[back].mean()) / 2
    return TablePull(float(pull_N[there].mean() - pull_N[back].mean()) / 2, float(carried_N))


def weight_on_edges(dragged: Sequence[TablePull], tipped: Sequence[TablePull]) -> Value | None:
    """Weight in newtons; None if it was not dragged, if no edge carried the smaller part of it, or if it is too unsure.

    Args:
        dragged: on the whole foot.
        tipped: on an edge.
    """
    if not dragged:
        return None
    flat_N = float(np.median([each.friction_N for each in dragged]))
    edges = [TablePull(max(each.friction_N - _FREE_SHARE * each.carried_N, 0.0), each.carried_N) for each in tipped]
    edges = [each for each in edges if each.friction_N < _MOST_LEFT * flat_N]
    if not edges:
        return None
    pull_N, carried_N = np.array([(each.friction_N, each.carried_N) for each in (*dragged, *edges)]).T

    def misfit(logarithms: Array) -> Array:
        friction, weight_N = np.exp(logarithms)
        expected_N = friction * np.maximum(weight_N - carried_N, 0.0)
        off = (pull_N - expected_N) / np.hypot(_PULL_N, _PULL_SHARE * expected_N)
        return np.append(off, np.log(friction / _USUAL_FRICTION) / _FRICTION_NATS)

    found = least_squares(misfit, np.log([_USUAL_FRICTION, max(1.1 * carried_N.max(), flat_N / _USUAL_FRICTION)]))
    by_logarithm = np.asarray(found.jac)
    weight_N, variance = float(np.exp(found.x[1])), np.linalg.inv(by_logarithm.T @ by_logarithm)[1, 1]
    share = float(np.hypot(np.sqrt(variance), _CARRIED_SHARE))
    return Value(weight_N, share * weight_N) if share < _MOST_UNSURE else None
