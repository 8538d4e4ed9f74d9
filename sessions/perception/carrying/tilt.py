"""Whether a carried object tips over: its sides lean, which the normals at the contacts show.

A body that leans by a small angle about a horizontal axis has its normals tilted up on one side and down on the other.
A fingertip that slides along a curved side changes its normal too, but not against the one on the opposite side.
"""

from __future__ import annotations

import numpy as np

from drivers.core.contacts import Array
from sessions.perception.carrying.tip_steps import TipSteps

_SPAN_s = 0.15
"""At either end, over which normals are averaged."""
_LEAST_rad, _FIT_rad = float(np.deg2rad(12.0)), float(np.deg2rad(6.0))
_LEAST_FINGERS = 3
_LEAST_SPREAD = 0.3
"""Normals that all have nearly one direction do not show a turn about it; what noise makes of that does not count."""


def tilt_rad(steps: TipSteps) -> float:
    """How far the object leans at the end against the beginning; 0 if it stands, or if its normals do not tell."""
    span = max(1, round(_SPAN_s / float(np.sort(steps.step_s)[len(steps) // 2])))
    first, last = (_mean_normals(steps, part) for part in (slice(None, span), slice(-span, None)))
    both = ~np.isnan(first[:, 0]) & ~np.isnan(last[:, 0])
    if both.sum() < _LEAST_FINGERS:
        return 0.0
    rises = last[both, 2] - first[both, 2]
    across = np.column_stack([last[both, 1], -last[both, 0]])  # z of (axis x normal), by the axis' x and y
    axis, *_ = np.linalg.lstsq(across, rises, rcond=_LEAST_SPREAD)
    leaning_rad, rest = float(np.linalg.norm(axis)), rises - across @ axis
    fits = float(np.sqrt(np.mean(rest**2))) < max(_FIT_rad, leaning_rad / 3)
    return leaning_rad if fits and leaning_rad > _LEAST_rad else 0.0


def _mean_normals(steps: TipSteps, part: slice) -> Array:
    """Mean normal of each finger over a part of the steps, shape (5, 3); NaN where it seldom touches."""
    felt = steps.felt[part]
    sums = np.einsum("nf,nfi->fi", felt, steps.normals[part])
    enough = felt.mean(axis=0) > 0.5
    means = sums / np.maximum(felt.sum(axis=0), 1)[:, None]
    return np.asarray(np.where(enough[:, None], means, np.nan))
