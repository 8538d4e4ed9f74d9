"""Poses proposed by the measurement: motion samples driven onto the modelled surface.

The idea of the manifold particle filter (thesis section 5.2.2): contacts pin the pose down to a thin set of
poses, which blind samples of the motion model rarely hit. Each sample slides there by a few steps of a robust
Gauss-Newton iteration, all samples at once; samples that end at the same place are one proposal.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache

import numpy as np
from pydantic import Field as Limit
from scipy.stats import norm, qmc

from tactile_lab.geometry.contacts import Array
from tactile_lab.geometry.poses import wrap_angle_rad
from tactile_lab.shape.field_grid import Field
from tactile_lab.strict_yaml import StrictModel
from tactile_lab.tracking.contact_set import ContactSet
from tactile_lab.tracking.measurement import placed
from tactile_lab.tracking.motion import MotionNoise, deviation

_ROBUST_SQUARED = 9.0
"""Residuals beyond three sigma lose their pull (Geman-McClure), which keeps basins wide."""

_LONGEST_STEP = np.array([0.012, 0.012, 0.35])
_DAMPING = np.array([10.0, 10.0, 1e-3])


class ProposalSettings(StrictModel):
    """How poses are proposed.

    Attributes:
        samples: quasi-random samples of the motion model, half of them with twice its standard deviation.
        steps: Gauss-Newton steps.
        kept: at most so many different proposals.
        distinct_m, distinct_rad: proposals closer than both are the same.
        unexplained_cost: negative log likelihood of a contact that nothing explains (wrong part of a finger, another
            object); no contact costs more.
        normal_length_m: a map uncertain by sigma predicts normals to ``sigma / normal_length_m`` radians.
    """

    samples: int = Limit(default=256, ge=2)
    steps: int = Limit(default=6, ge=1)
    kept: int = Limit(default=12, ge=1)
    distinct_m: float = Limit(default=0.0025, gt=0)
    distinct_rad: float = Limit(default=0.08, gt=0)
    unexplained_cost: float = Limit(default=5.0, gt=0)
    normal_length_m: float = Limit(default=0.018, gt=0)


@dataclass(frozen=True)
class Fit:
    """How poses fit, linearised.

    Attributes:
        cost: negative log of likelihood times motion prior, shape (n,).
        information: Gauss-Newton approximation of its second derivative, shape (n, 3, 3).
        gradient: shape (n, 3).
    """

    cost: Array
    information: Array
    gradient: Array


def propose(
    predicted: Array, contacts: ContactSet, field: Field, noise: MotionNoise, settings: ProposalSettings
) -> tuple[Array, Array]:
    """Different poses that explain the contacts, the best first.

    Args:
        predicted: the pose predicted by the hand's motion, a row.
        contacts: of the grasp, world frame.
        field: the modelled surface.
        noise: of the motion model.
        settings: see there.

    Returns:
        Rows of shape (m, 3), and for each the negative log of likelihood times motion prior, shape (m,).
    """
    spread = quasi_normal(settings.samples) * noise.sigmas
    spread[settings.samples // 2 :] *= 2.0
    spread[0] = 0.0
    rows = predicted + spread
    for _ in range(settings.steps):
        fit = fit_poses(rows, predicted, contacts, field, noise, settings)
        step = -np.linalg.solve(fit.information + np.diag(_DAMPING), fit.gradient[..., None])[..., 0]
        rows = rows + step * np.minimum(
            1.0, 1.0 / np.max(np.abs(step) / _LONGEST_STEP, axis=1, keepdims=True, initial=1e-12)
        )
    rows[:, 2] = wrap_angle_rad(rows[:, 2])
    cost = fit_poses(rows, predicted, contacts, field, noise, settings).cost
    chosen = _distinct(rows, cost, settings)
    return rows[chosen], cost[chosen]


def fit_poses(
    rows: Array, predicted: Array, contacts: ContactSet, field: Field, noise: MotionNoise, settings: ProposalSettings
) -> Fit:
    """Distances and normals of all contacts at poses of shape (n, 3), each contact on its own."""
    points, normals = placed(rows, contacts)
    found = field.predict(points.reshape(-1, contacts.dimension), gradient=True, variance=True)
    assert found.gradient is not None
    assert found.variance_m2 is not None
    values = found.mean_m.reshape(points.shape[:2])
    slopes = found.gradient.reshape(points.shape)
    variance = found.variance_m2.reshape(values.shape)
    value_variance = contacts.point_sigma_m**2 + variance
    normal_variance = contacts.normal_sigma_rad**2 + np.minimum(variance / settings.normal_length_m**2, 1.0)
    tilts = slopes - normals
    tilt = np.einsum("nmd,nmd->nm", tilts, tilts) / normal_variance
    distance = values**2 / value_variance
    away = deviation(rows, predicted) / noise.sigmas
    each = 0.5 * (distance + np.log(value_variance) + tilt + contacts.dimension * np.log(normal_variance))
    cost = -np.logaddexp(-each, -settings.unexplained_cost).sum(axis=1)
    by_pose = _value_rows(rows, points, slopes)
    turned = np.stack([normals[..., 1], -normals[..., 0]], axis=-1)
    pull = values / (value_variance * (1 + distance / _ROBUST_SQUARED))
    grip = 1 / (value_variance * (1 + distance / _ROBUST_SQUARED))
    twist = 1 / (normal_variance * (1 + tilt / _ROBUST_SQUARED))
    information = np.einsum("nmi,nm,nmj->nij", by_pose, grip, by_pose) + np.diag(noise.sigmas**-2)
    information[:, 2, 2] += np.einsum("nmd,nmd,nm->n", turned, turned, twist)
    gradient = np.einsum("nmi,nm->ni", by_pose, pull) + away / noise.sigmas
    gradient[:, 2] -= np.einsum("nmd,nmd,nm->n", turned, tilts[..., :2], twist)
    return Fit(cost + 0.5 * np.sum(away**2, axis=1), information, gradient)


def _value_rows(rows: Array, points: Array, slopes: Array) -> Array:
    """Derivative of the field's value at each contact by the pose, shape (n, m, 3)."""
    cosine, sine = np.cos(rows[:, 2, None]), np.sin(rows[:, 2, None])
    along_x = -(cosine * slopes[..., 0] - sine * slopes[..., 1])
    along_y = -(sine * slopes[..., 0] + cosine * slopes[..., 1])
    turning = slopes[..., 0] * points[..., 1] - slopes[..., 1] * points[..., 0]
    return np.stack([along_x, along_y, turning], axis=-1)


def _distinct(rows: Array, cost: Array, settings: ProposalSettings) -> list[int]:
    chosen: list[int] = []
    for index in np.argsort(cost, kind="stable").tolist():
        gaps = deviation(rows[chosen], rows[index])
        near = (np.hypot(gaps[:, 0], gaps[:, 1]) < settings.distinct_m) & (np.abs(gaps[:, 2]) < settings.distinct_rad)
        if not near.any():
            chosen.append(index)
        if len(chosen) == settings.kept:
            break
    return chosen


@cache
def _sobol_normals(count: int) -> Array:
    exponent = int(np.ceil(np.log2(count)))
    uniform = qmc.Sobol(3, scramble=True, rng=np.random.default_rng(0)).random_base2(exponent)[:count]
    return np.asarray(norm.ppf(np.clip(uniform, 1e-6, 1 - 1e-6)))


def quasi_normal(count: int) -> Array:
    """Evenly spread standard normal vectors of three components, always the same, shape (count, 3)."""
    return _sobol_normals(count).copy()
