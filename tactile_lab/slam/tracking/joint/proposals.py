"""Poses proposed by the measurement: motion samples driven onto the modelled surface.

The idea of the manifold particle filter (thesis section 5.2.2): contacts constrain the pose to a thin set, which blind
samples of the motion model rarely hit. Each sample slides there by a few steps of a robust Gauss-Newton iteration, all
samples at once; samples that end at the same place are one proposal.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from typing import Protocol

import numpy as np
from numpy.typing import NDArray
from pydantic import Field as Limit
from scipy.special import ndtri

from drivers.core.configuration import StrictModel
from drivers.core.contacts import Array
from tactile_lab.slam.shape.fields.posterior import Prediction
from tactile_lab.slam.tracking.contacts.contact_set import ContactSet
from tactile_lab.slam.tracking.contacts.measured_law import heavy_tailed_cost, heavy_tailed_weight
from tactile_lab.slam.tracking.contacts.motion import MotionNoise
from tactile_lab.slam.tracking.contacts.pose_vectors import PLANAR, PoseVectors
from tactile_lab.slam.tracking.joint.low_discrepancy import sobol_points

UNEXPLAINED_COST = 2.0
"""A contact in a hundred is wrong, and then anywhere within 10 cm with any normal, which costs 0. The remainder keeps
right contacts that are alone on faces touched once.
"""

_ROBUST_SQUARED = 9.0
"""Residuals beyond three sigma lose their influence (Geman-McClure), which keeps basins wide."""

_LONGEST_STEP_m = 0.012
_LONGEST_TURN_rad = 0.35

_OTHER_PLACE = 2.0
_VARIANCE_EVERY = 3
"""Number of steps after which the field's variance is computed again."""


class ProposalSettings(StrictModel):
    """How poses are proposed.

    Attributes:
        samples: quasi-random samples of the motion model, half of them with its wider standard deviation.
        steps: Gauss-Newton steps.
        kept: largest number of different proposals.
        distinct_m, distinct_rad: proposals closer than both count as equal.
        unexplained_cost: negative log likelihood of a contact that nothing explains (wrong part of a finger, another
            object); no contact costs more.
        normal_length_m: a map uncertain by sigma predicts normals to ``sigma / normal_length_m`` radians.
    """

    samples: int = Limit(default=96, ge=2)
    steps: int = Limit(default=6, ge=1)
    kept: int = Limit(default=12, ge=1)
    distinct_m: float = Limit(default=0.0025, gt=0)
    distinct_rad: float = Limit(default=0.08, gt=0)
    unexplained_cost: float = Limit(default=UNEXPLAINED_COST, gt=0)
    normal_length_m: float = Limit(default=0.018, gt=0)


class Matched(Protocol):
    """A surface onto which contacts can be driven: a field or a solid."""

    def predict(self, points_m: Array, *, gradient: bool = False, variance: bool = False) -> Prediction:
        """The field at points of shape (q, d)."""

    def variance(self, points_m: Array, *, rough: bool = False) -> Array:
        """Its variance there, shape (q,), m^2."""


@dataclass(frozen=True)
class Fit:
    """Fit of poses, linearised.

    Attributes:
        cost: negative log of likelihood times motion prior, shape (n,).
        information: Gauss-Newton approximation of its second derivative, shape (n, size, size).
        gradient: shape (n, size).
    """

    cost: Array
    information: Array
    gradient: Array


def propose(
    predicted: Array,
    contacts: ContactSet,
    field: Matched,
    noise: MotionNoise,
    settings: ProposalSettings,
    space: PoseVectors = PLANAR,
) -> tuple[Array, Fit]:
    """Different poses that explain the contacts, best first.

    Args:
        predicted: the pose predicted by the hand's motion, a pose vector.
        contacts: of the grasp, world frame.
        field: the modelled surface.
        noise: of the motion model.
        settings: see there.
        space: kind of the pose vectors.

    Returns:
        Pose vectors of shape (m, size), and their fit.
    """
    spread = quasi_normal(settings.samples, space.size)
    spread[: settings.samples // 2] *= space.sigmas(noise)
    spread[settings.samples // 2 :] *= space.sigmas(noise.wide)
    spread[0] = 0.0
    match = GraspMatch(predicted, contacts, field, noise, settings, space)
    longest, damping = _limits(space)
    rows = space.move(predicted, spread)
    variance_m2 = match.variance(rows)
    for step in range(settings.steps):
        if step and step % _VARIANCE_EVERY == 0:
            variance_m2 = match.variance(rows)
        fit = match.fit(rows, variance_m2)
        steps = -np.linalg.solve(fit.information + damping, fit.gradient[..., None])[..., 0]
        largest = np.max(np.abs(steps) / longest, axis=1, keepdims=True, initial=1e-12)
        rows = space.move(rows, steps / np.maximum(1.0, largest))
    fit = match.fit(rows, match.variance(rows))
    chosen = _distinct(rows, fit.cost, settings, space)
    return rows[chosen], Fit(fit.cost[chosen], fit.information[chosen], fit.gradient[chosen])


class GraspMatch:
    """Fit of one grasp's contacts to a field at many poses, each contact independently."""

    def __init__(
        self,
        predicted: Array,
        contacts: ContactSet,
        field: Matched,
        noise: MotionNoise,
        settings: ProposalSettings,
        space: PoseVectors = PLANAR,
    ) -> None:
        self._predicted, self._contacts, self._field = predicted, contacts, field
        self._settings, self._space, self._sigmas = settings, space, space.sigmas(noise)
        self._is_heavy_tailed = noise.is_heavy_tailed

    def variance(self, rows: Array) -> Array:
        """The field's variance at every contact for poses of shape (n, size), shape (n, m)."""
        points, _ = self._place(rows)
        found = self._field.variance(points.reshape(-1, self._contacts.dimension), rough=True)
        return np.asarray(found.reshape(points.shape[:2]))

    def fit(self, rows: Array, variance_m2: Array) -> Fit:
        """Cost, gradient and information of poses of shape (n, size), given the field's variance there.

        The variance changes little over a step, and costs more than everything else.
        """
        contacts = self._contacts
        points, normals = self._place(rows)
        found = self._field.predict(points.reshape(-1, contacts.dimension), gradient=True)
        values, slopes = found.mean_m.reshape(points.shape[:2]), found.gradient.reshape(points.shape)
        value_variance = contacts.point_sigma_m**2 + variance_m2
        vagueness = np.minimum(variance_m2 / self._settings.normal_length_m**2, 1.0)
        normal_variance = contacts.normal_sigma_rad**2 + vagueness
        tilts = normals - slopes
        tilt = np.einsum("nmd,nmd->nm", tilts, tilts) / normal_variance
        distance = values**2 / value_variance
        away = self._space.deviation(rows, self._predicted) / self._sigmas
        each = 0.5 * (distance + np.log(value_variance) + tilt + contacts.dimension * np.log(normal_variance))
        slip, pull = self._prior(away)
        cost = -np.logaddexp(-each, -self._settings.unexplained_cost).sum(axis=1) + slip
        still, poses = np.zeros_like(points), rows[:, None]
        grip = 1 / (value_variance * (1 + distance / _ROBUST_SQUARED))
        twist = 1 / (normal_variance * (1 + tilt / _ROBUST_SQUARED))
        by_value = self._space.by_row(poses, points, normals, slopes, still)
        information = np.einsum("nmi,nm,nmj->nij", by_value, grip, by_value)
        information += pull[..., None] * np.diag(self._sigmas**-2)
        gradient = np.einsum("nmi,nm->ni", by_value, grip * values) + pull * (away / self._sigmas)
        for axis in range(contacts.dimension):
            unit = np.broadcast_to(np.eye(contacts.dimension)[axis], points.shape)
            by_normal = self._space.by_row(poses, points, normals, still, unit)[..., self._space.translations :]
            turning = slice(self._space.translations, None)
            information[:, turning, turning] += np.einsum("nmi,nm,nmj->nij", by_normal, twist, by_normal)
            gradient[:, turning] += np.einsum("nmi,nm->ni", by_normal, twist * tilts[..., axis])
        return Fit(cost, information, gradient)

    def _prior(self, away: Array) -> tuple[Array, Array]:
        """Cost of the slips, in sigma, shape (n, size); and how hard they pull, relative to a normal distribution."""
        if not self._is_heavy_tailed:
            return 0.5 * np.sum(away**2, axis=1), np.ones_like(away)
        turns = self._space.translations
        parts = np.array([turns, self._space.size - turns])
        squared = np.add.reduceat(away**2, [0, turns], axis=1)
        pull = np.repeat(heavy_tailed_weight(squared, parts), parts, axis=1)
        return heavy_tailed_cost(squared, parts).sum(axis=1), pull

    def _place(self, rows: Array) -> tuple[Array, Array]:
        return self._space.to_object(rows[:, None], self._contacts.points_m, self._contacts.normals)


def elsewhere(rows: Array, row: Array, settings: ProposalSettings, space: PoseVectors) -> NDArray[np.bool_]:
    """Which poses, shape (n, size), are other places than one: farther than twice the distinct distances."""
    gaps, split = space.deviation(rows, row), space.translations
    far = np.linalg.norm(gaps[:, :split], axis=1) > _OTHER_PLACE * settings.distinct_m
    far |= np.linalg.norm(gaps[:, split:], axis=1) > _OTHER_PLACE * settings.distinct_rad
    return np.asarray(far)


def _limits(space: PoseVectors) -> tuple[Array, Array]:
    """Longest step and damping of each component of a pose vector."""
    turning = np.arange(space.size) >= space.translations
    return np.where(turning, _LONGEST_TURN_rad, _LONGEST_STEP_m), np.diag(np.where(turning, 1e-3, 10.0))


def _distinct(rows: Array, cost: Array, settings: ProposalSettings, space: PoseVectors) -> list[int]:
    """Indices of the best of all poses that are close to each other."""
    order = np.argsort(cost, kind="stable")
    chosen: list[int] = []
    while len(order) and len(chosen) < settings.kept:
        chosen.append(int(order[0]))
        gaps = space.deviation(rows[order], rows[order[0]])
        far = np.linalg.norm(gaps[:, : space.translations], axis=1) >= settings.distinct_m
        far |= np.linalg.norm(gaps[:, space.translations :], axis=1) >= settings.distinct_rad
        far[0] = False
        order = order[far]
    return chosen


@cache
def _sobol_normals(count: int, size: int) -> Array:
    uniform = sobol_points(count, size, np.random.default_rng(0).spawn(1)[0])
    return np.asarray(ndtri(np.clip(uniform, 1e-6, 1 - 1e-6)))


def quasi_normal(count: int, size: int) -> Array:
    """Evenly spread standard normal vectors, always the same, shape (count, size)."""
    return _sobol_normals(count, size).copy()
