"""Locates the edge of a printed square in the grey levels across it, however blurred, and measures the blur.

Across a side of a marker's black square the print is, from inside to outside: inner modules, a module of black, half a
module of white, and whatever lies beyond. Blur turns the three steps into rises and falls, which overlap unless the
blur is much smaller than the half module. So all three are fitted together::

    level(x) = base + A Phi((x - e) / s) + B Phi((x - e - h) / s) + C Phi((x - e + 2 h) / s)

with the cumulative normal distribution Phi, edge e, blur s, and the half module h, which is known from the print's
geometry. For wider white borders, as on boards, B is zero. Gauss-Newton finds e and s, linear least squares the levels.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.special import ndtr

from drivers.core.contacts import Array

_ROUNDS, _FIRST_ROUNDS = 1, 4
_START_EDGES_px = np.linspace(-1.5, 1.5, 5)
_START_BLURS_px = np.array([0.5, 0.7, 1.0, 1.4, 2.0, 2.8])
SMALLEST_BLUR_px, LARGEST_BLUR_px = 0.3, 4.0
_LEVEL_NOISE = 0.01
"""Noise of a mean profile relative to the edge's contrast A; it weights the data against the priors below."""
_EXPECTED = np.array([[0.0, 0.5, 1.0, 0.0], [0.0, 0.5, 0.0, 1.0]]) / np.array([[0.5], [0.4]])
"""Priors: B = (-0.5 +- 0.5) A, as black, white or grey follows the white; C = (-0.5 +- 0.4) A, by the white share
inside.
"""
_DAMPING = 0.02
_ROUNDING = 1e-9
_PLACE_NOISE = 0.03
_PLACE_LEVELS = np.array([0.15, 0.15, 0.3, 0.4])
"""Variation along a side: of base, A, B and C relative to A; and of the edge, in pixels."""
_PLACE_EDGE_px = 1.0


@dataclass(frozen=True, eq=False)
class Profiles:
    """Fitted profiles across k sides.

    Attributes:
        across_px: distances outward at which the levels were sampled, shape (k, n).
        half_module_px: width of the white border, shape (k,).
        edge_px: position of the edge, shape (k,).
        blur_px: standard deviation of the blur, shape (k,).
        levels: base, A, B and C, grey levels, shape (k, 4).
    """

    across_px: Array
    half_module_px: Array
    edge_px: Array
    blur_px: Array
    levels: Array

    def places(self, levels: Array) -> tuple[Array, Array]:
        """The edge (px) and its contrast at single places along the sides, both (k, m), from levels (k, m, n).

        Takes one linear step from the mean profile; the levels may vary a little along the side.
        """
        steps, slopes, _ = _steps(self.across_px, self.edge_px, self.blur_px, self.half_module_px)
        contrast = self.levels[:, 1]
        rows = np.concatenate([steps, -(slopes[..., 0] * contrast[:, None])[..., None]], axis=2)
        loose = np.concatenate([np.tile(_PLACE_LEVELS, (len(contrast), 1)), _PLACE_EDGE_px / contrast[:, None]], axis=1)
        normal = rows.swapaxes(1, 2) @ rows + (_PLACE_NOISE / loose)[..., None] ** 2 * np.eye(5)
        gains = np.linalg.solve(normal, rows.swapaxes(1, 2))
        left = levels - (steps @ self.levels[..., None])[..., 0][:, None]
        change = left @ gains.swapaxes(1, 2)
        return self.edge_px[:, None] + change[..., 4], contrast[:, None] + change[..., 1]


def fit_profiles(
    across_px: Array, levels: Array, half_module_px: Array, blur_px: Array | None = None
) -> Profiles | None:
    """Fit profiles to mean grey levels (k, n) at ``across_px`` (k, n); None if a side shows no edge.

    Args:
        across_px: distances outward from where the edge is expected.
        levels: grey levels there.
        half_module_px: width of the white border, shape (k,).
        blur_px: approximate blur of the sides, shape (k,), if edges are near where they are expected; None if unknown.
    """
    profiles = _first(across_px, levels, half_module_px, blur_px)
    for _ in range(_FIRST_ROUNDS if blur_px is None else _ROUNDS):
        if np.any(profiles.levels[:, 1] <= 0.0):
            return None
        profiles = _improve(profiles, levels)
    return None if np.any(profiles.levels[:, 1] <= 0.0) else profiles


def _first(across_px: Array, levels: Array, half_module_px: Array, blur_px: Array | None) -> Profiles:
    """The best of a few initial edges and blurs, each with its best levels."""
    edges, blurs = np.zeros((len(levels), 1)), np.ones((len(levels), 1))
    if blur_px is None:
        some_edges, some_blurs = (grid.ravel() for grid in np.meshgrid(_START_EDGES_px, _START_BLURS_px))
        edges, blurs = edges + some_edges, blurs * some_blurs
    else:
        blurs = blurs * blur_px[:, None]
    steps, _, _ = _steps(across_px[:, None], edges, blurs, half_module_px[:, None])
    found, cost = _step_heights(steps, levels[:, None])
    best = np.argmin(np.where(found[..., 1] > 0.0, cost, np.inf), axis=1)
    side = np.arange(len(levels))
    return Profiles(across_px, half_module_px, edges[side, best], blurs[side, best], found[side, best])


def _improve(old: Profiles, levels: Array) -> Profiles:
    """One damped Gauss-Newton step, which moves the edge by at most a pixel and the blur by at most a third."""
    steps, slopes, scaled = _steps(old.across_px, old.edge_px, old.blur_px, old.half_module_px)
    by_edge = -slopes @ old.levels[:, 1:, None]
    by_blur = -(slopes * scaled) @ old.levels[:, 1:, None]
    rows = np.concatenate([steps, by_edge, by_blur], axis=2)
    expected = np.zeros((len(levels), 4, 6))
    expected[:, :2, :4] = _LEVEL_NOISE * _EXPECTED
    expected[:, 2, 4] = _DAMPING * old.levels[:, 1] / old.half_module_px
    expected[:, 3, 5] = _DAMPING * old.levels[:, 1] / old.blur_px
    found = _least_squares(rows, levels, expected)
    edge_px = old.edge_px + np.clip(found[:, 4], -1.0, 1.0)
    blur_px = old.blur_px * np.clip(1.0 + found[:, 5] / old.blur_px, 0.7, 1.4)
    blur_px = np.clip(blur_px, SMALLEST_BLUR_px, LARGEST_BLUR_px)
    steps, _, _ = _steps(old.across_px, edge_px, blur_px, old.half_module_px)
    return Profiles(old.across_px, old.half_module_px, edge_px, blur_px, _step_heights(steps, levels)[0])


def _step_heights(steps: Array, levels: Array) -> tuple[Array, Array]:
    """Base, A, B and C (..., 4) that fit levels (..., n) best, and the remaining sum of squares, shape (...)."""
    expected = _LEVEL_NOISE * np.broadcast_to(_EXPECTED, (*steps.shape[:-2], 2, 4))
    heights = _least_squares(steps, levels, expected)
    left = levels - (steps @ heights[..., None])[..., 0]
    return heights, np.sum(left**2, axis=-1) + np.sum((expected @ heights[..., None]) ** 2, axis=(-2, -1))


def _steps(across_px: Array, edge_px: Array, blur_px: Array, half_module_px: Array) -> tuple[Array, Array, Array]:
    """A constant one and the three blurred steps of height one, shape (..., n, 4).

    Also returns the slopes of the steps per pixel, and the distances from the steps in units of the blur, both (..., n,
    3).
    """
    from_edge = across_px - edge_px[..., None]
    blur_px, half_module_px = blur_px[..., None, None], half_module_px[..., None]
    scaled = np.stack([from_edge, from_edge - half_module_px, from_edge + 2 * half_module_px], axis=-1) / blur_px
    slopes = np.exp(-(scaled**2) / 2) / (np.sqrt(2 * np.pi) * blur_px)
    return np.concatenate([np.ones((*scaled.shape[:-1], 1)), ndtr(scaled)], axis=-1), slopes, scaled


def _least_squares(rows: Array, values: Array, expected: Array) -> Array:
    """Unknowns (..., m) that bring ``rows`` (..., n, m) to the values (..., n) and ``expected`` (..., k, m) to zero."""
    normal = rows.swapaxes(-1, -2) @ rows + expected.swapaxes(-1, -2) @ expected
    size = np.trace(normal, axis1=-2, axis2=-1)[..., None, None]
    normal = normal + _ROUNDING * size * np.eye(normal.shape[-1])
    return np.asarray(np.linalg.solve(normal, rows.swapaxes(-1, -2) @ values[..., None])[..., 0])
