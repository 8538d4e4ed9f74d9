"""Damped Gauss-Newton steps (Levenberg-Marquardt) over whatever has a cost."""

from __future__ import annotations

from collections.abc import Callable
from typing import Protocol, TypeVar

import numpy as np

from drivers.core.contacts import Array

_FIRST_DAMPING = 1e-3
_LARGEST_DAMPING = 1e6


class Rated(Protocol):
    """A solution with its cost."""

    @property
    def cost(self) -> float: ...


_Solution = TypeVar("_Solution", bound=Rated)


def descend(
    start: _Solution,
    normal_equations: Callable[[_Solution], tuple[Array, Array]],
    moved: Callable[[_Solution, Array], _Solution],
    iterations: int,
) -> _Solution:
    """The solution of least cost near another.

    Args:
        start: where to begin.
        normal_equations: information and gradient at a solution, shapes (m, m) and (m,).
        moved: a solution after a change of its unknowns, shape (m,).
        iterations: at most.
    """
    best, damping = start, _FIRST_DAMPING
    for _ in range(iterations):
        information, gradient = normal_equations(best)
        before = best.cost
        while damping < _LARGEST_DAMPING:
            damped = information + damping * np.diag(np.diag(information))
            candidate = moved(best, np.asarray(-np.linalg.solve(damped, gradient)))
            if candidate.cost < best.cost:
                best, damping = candidate, max(damping / 8, 1e-9)
                break
            damping *= 5
        if before - best.cost < 1e-3:
            break
    return best
