"""The likelihood of all poses together, the shape integrated out.

Contacts placed by wrong poses make a surface that a Gaussian process finds improbable. So the log marginal
likelihood (2.16) of all contacts, values and normals, is a function of all poses: no shape has to be fixed
while poses are corrected, and its derivative by every contact is known in closed form. With the motion model
(3.7) between successive poses it is the posterior of the trajectory.
"""

from __future__ import annotations

from functools import singledispatch

import numpy as np
from scipy.linalg import lapack
from scipy.optimize import minimize

from tactile_lab.geometry.contacts import Array
from tactile_lab.shape.kernels import Kernel, Matern52, Profile, SquaredExponential, ThinPlate, covariance, differences
from tactile_lab.shape.priors import PriorMean
from tactile_lab.shape.settings import initial_kernel, observe, prior_mean
from tactile_lab.tracking.contact_map import ContactMap
from tactile_lab.tracking.motion import MotionNoise, compose, deviation

STIFF_BEYOND_SIGMA = 3.2
_STIFFNESS = 10.0
"""Slips are bounded by the hand's grip: beyond some sigma the motion prior gets stiffer than a Gaussian."""

_UNITS = np.array([1e-3, 1e-3, 1e-3 / 0.035])
"""Millimetres, and the angle that moves a contact 35 mm from the origin by one: the optimiser's variables."""

_JITTER = 1e-9


class PoseEvidence:
    """Negative log posterior of the poses of a map's grasps, up to a constant. The first pose is given."""

    def __init__(self, contact_map: ContactMap, noise: MotionNoise) -> None:
        """
        Args:
            contact_map: grasps, motions, kernel parameters; the present poses place the prior mean.
            noise: of the motion model.
        """
        self._map, self._noise = contact_map, noise
        self._world = contact_map.contacts_world
        self._grasp_of = contact_map.grasp_indices
        self._motions = np.array([grasp.motion for grasp in contact_map.placed])
        contacts = contact_map.contacts
        seen = observe(
            contacts.points_m, contacts.normals, contacts.point_sigma_m, contacts.normal_sigma_rad, contact_map.settings
        )
        self._noise_variance = seen.noise_variance
        self._kernel: Kernel = initial_kernel(seen, contact_map.settings)
        self._prior: PriorMean = prior_mean(contacts.points_m, contact_map.settings)

    def value(self, rows: Array) -> float:
        """The negative log posterior at poses of shape (k, 3)."""
        points, normals = self._in_object_frame(rows)
        factor, residual, weights = self._factorised(points, normals)
        return self._misfit(factor, residual, weights) + self._motion_cost(rows)[0]

    def value_and_gradient(self, rows: Array) -> tuple[float, Array]:
        """The negative log posterior and its derivative by each pose, shape (k, 3)."""
        points, normals = self._in_object_frame(rows)
        factor, residual, weights = self._factorised(points, normals)
        by_points, by_normals = self._contact_gradient(points, factor, weights)
        cost, gradient = self._motion_cost(rows)
        return self._misfit(factor, residual, weights) + cost, gradient + self._by_poses(
            rows, points, normals, by_points, by_normals
        )

    def value_and_leave_one_out_costs(self, rows: Array) -> tuple[float, Array]:
        """The negative log posterior, and for each contact that of its density given all others, shape (n,).

        The marginal likelihood of all contacts is that of the others times this, so these costs tell what would be
        gained by leaving a contact out. They follow from the blocks of the inverse covariance alone.
        """
        points, normals = self._in_object_frame(rows)
        factor, residual, weights = self._factorised(points, normals)
        value = self._misfit(factor, residual, weights) + self._motion_cost(rows)[0]
        count, rows_each = len(points), points.shape[1] + 1
        blocks = np.einsum("aibi->iab", _inverse(factor).reshape(rows_each, count, rows_each, count))
        own = weights.reshape(rows_each, count).T
        misfits = np.einsum("ia,ia->i", own, np.linalg.solve(blocks, own[..., None])[..., 0])
        return value, np.asarray(0.5 * (misfits - np.linalg.slogdet(blocks)[1]))

    def maximised(self, rows: Array, max_iterations: int, accuracy: float = 0.01) -> tuple[Array, float]:
        """Poses of largest posterior near the given ones, and the negative log posterior there (L-BFGS).

        Args:
            rows: where to start, shape (k, 3).
            max_iterations: of the optimiser.
            accuracy: steps that gain less end it.
        """
        scale = max(abs(self.value(rows)), 1.0)

        def objective(variables: Array) -> tuple[float, Array]:
            value, gradient = self.value_and_gradient(moved(variables))
            return value, (gradient[1:] * _UNITS).ravel()

        def moved(variables: Array) -> Array:
            return np.asarray(rows + np.vstack([np.zeros(3), variables.reshape(-1, 3) * _UNITS]))

        found = minimize(
            objective,
            np.zeros(3 * (len(rows) - 1)),
            jac=True,
            method="L-BFGS-B",
            options={"maxiter": max_iterations, "ftol": accuracy / scale, "gtol": 1e-3, "maxcor": 20},
        )
        return moved(found.x), float(found.fun)

    def _in_object_frame(self, rows: Array) -> tuple[Array, Array]:
        cosine, sine = np.cos(rows[self._grasp_of, 2]), np.sin(rows[self._grasp_of, 2])
        points, normals = self._world.points_m.copy(), self._world.normals.copy()
        points[:, :2] -= rows[self._grasp_of, :2]
        for vectors in (points, normals):
            x, y = vectors[:, 0].copy(), vectors[:, 1].copy()
            vectors[:, 0], vectors[:, 1] = cosine * x + sine * y, cosine * y - sine * x
        return points, normals

    def _factorised(self, points: Array, normals: Array) -> tuple[Array, Array, Array]:
        matrix = covariance(self._kernel, points, len(points))
        diagonal = np.diag(matrix) * (1 + _JITTER) + self._noise_variance
        np.fill_diagonal(matrix, diagonal)
        factor, problem = lapack.dpotrf(matrix.T, lower=1, clean=1, overwrite_a=1)
        if problem:  # contacts thrown onto each other by a wild step of the line search
            factor, _ = lapack.dpotrf(np.diag(diagonal), lower=1)
        residual = np.concatenate([-self._prior.value(points), (normals - self._prior.gradient(points)).T.ravel()])
        weights, _ = lapack.dpotrs(factor, residual, lower=1)
        return factor, residual, np.asarray(weights)

    @staticmethod
    def _misfit(factor: Array, residual: Array, weights: Array) -> float:
        return float(0.5 * residual @ weights + np.log(np.diag(factor)).sum())

    def _contact_gradient(self, points: Array, factor: Array, weights: Array) -> tuple[Array, Array]:
        """Derivatives of the misfit by each contact's point and normal, shape (n, d) each."""
        count, dimension = points.shape
        by_normals = weights[count:].reshape(dimension, count).T
        by_points = covariance_pull(self._kernel, points, _inverse(factor) - np.outer(weights, weights)) / 2
        by_points -= weights[:count, None] * self._prior.gradient(points)
        by_points -= _directional_change(self._prior, points, by_normals)
        return by_points, by_normals

    def _by_poses(self, rows: Array, points: Array, normals: Array, by_points: Array, by_normals: Array) -> Array:
        """Chain rule from contacts in the object frame to poses in the world."""
        cosine, sine = np.cos(rows[self._grasp_of, 2]), np.sin(rows[self._grasp_of, 2])
        each = np.empty((len(points), 3))
        each[:, 0] = -(cosine * by_points[:, 0] - sine * by_points[:, 1])
        each[:, 1] = -(sine * by_points[:, 0] + cosine * by_points[:, 1])
        each[:, 2] = by_points[:, 0] * points[:, 1] - by_points[:, 1] * points[:, 0]
        each[:, 2] += by_normals[:, 0] * normals[:, 1] - by_normals[:, 1] * normals[:, 0]
        gradient = np.zeros_like(rows)
        np.add.at(gradient, self._grasp_of, each)
        return gradient

    def _motion_cost(self, rows: Array) -> tuple[float, Array]:
        """The motion model (3.7), negative log and derivative."""
        scaled = deviation(rows[1:], compose(self._motions[1:], rows[:-1])) / self._noise.sigmas
        slip = np.column_stack([np.hypot(scaled[:, 0], scaled[:, 1]), np.abs(scaled[:, 2])])
        excess = np.maximum(slip - STIFF_BEYOND_SIGMA, 0.0)
        cost = 0.5 * np.sum(slip**2) + 0.5 * _STIFFNESS * np.sum(excess**2)
        stretch = 1 + _STIFFNESS * excess / np.maximum(slip, 1e-12)
        pull = scaled * stretch[:, [0, 0, 1]] / self._noise.sigmas
        gradient = np.zeros_like(rows)
        gradient[1:] += pull
        cosine, sine = np.cos(self._motions[1:, 2]), np.sin(self._motions[1:, 2])
        gradient[:-1, 0] -= cosine * pull[:, 0] + sine * pull[:, 1]
        gradient[:-1, 1] -= cosine * pull[:, 1] - sine * pull[:, 0]
        gradient[:-1, 2] -= pull[:, 2]
        return float(cost), gradient


def _inverse(factor: Array) -> Array:
    """Inverse of the matrix with this lower Cholesky factor."""
    lower, _ = lapack.dpotri(factor, lower=1)
    return np.asarray(np.tril(lower) + np.tril(lower, -1).T)


def covariance_pull(kernel: Kernel, points: Array, weights: Array) -> Array:
    """Derivative of ``sum(weights * K)`` by each point, K being the covariance of values and gradients at all.

    Every pair of contacts contributes ``A phi + (B . d) phi' + (d^T C d) phi'' + D phi'`` with d the vector
    between them and A to D picked from the symmetric weights; its derivative by d needs one more derivative of phi.

    Args:
        kernel: the covariance function.
        points: shape (n, d).
        weights: symmetric, of the covariance's shape.

    Returns:
        Shape (n, d).
    """
    count, dimension = points.shape
    blocks = weights.reshape(dimension + 1, count, dimension + 1, count).transpose(0, 2, 1, 3)
    on_values, cross, on_gradients = blocks[0, 0], -4 * blocks[0, 1:], -4 * blocks[1:, 1:]
    deltas = differences(points, points)
    squared = np.einsum("dnm,dnm->nm", deltas, deltas)
    phi = kernel.profile(squared)
    turned = np.einsum("ijnm,jnm->inm", on_gradients + on_gradients.transpose(1, 0, 2, 3), deltas)
    quadratic = np.einsum("inm,inm->nm", turned, deltas) / 2
    trace = np.einsum("iinm->nm", on_gradients) / 2
    linear = np.einsum("dnm,dnm->nm", cross, deltas)
    radial = on_values * phi.first + (linear + trace) * phi.second + quadratic * third_derivative(kernel, squared, phi)
    slopes = 2 * deltas * radial + cross * phi.first + turned * phi.second
    return np.asarray((slopes.sum(axis=2) - slopes.sum(axis=1)).T)


@singledispatch
def third_derivative(kernel: Kernel, squared: Array, phi: Profile) -> Array:
    """Third derivative of phi by the squared distance, zero at distance zero where it may diverge.

    It only ever appears times the third power of the distance.
    """
    raise TypeError(f"no third derivative for {type(kernel).__name__}")


@third_derivative.register
def _(kernel: SquaredExponential, squared: Array, phi: Profile) -> Array:
    return np.asarray(-phi.second / kernel.length**2)


@third_derivative.register
def _(kernel: Matern52, squared: Array, phi: Profile) -> Array:
    rate = np.sqrt(5.0) / kernel.length
    return np.asarray(-0.5 * rate * phi.second * _inverse_power(squared, 0.5))


@third_derivative.register
def _(kernel: ThinPlate, squared: Array, phi: Profile) -> Array:
    return np.asarray(-0.5 * phi.second * _inverse_power(squared, 1.0))


def _inverse_power(squared: Array, power: float) -> Array:
    return np.asarray(np.divide(1.0, squared**power, out=np.zeros_like(squared), where=squared > 1e-18))


def _directional_change(prior: PriorMean, points: Array, directions: Array) -> Array:
    """Second derivative of the prior times a direction at each point, by central differences."""
    lengths = np.maximum(np.linalg.norm(directions, axis=1, keepdims=True), 1e-12)
    step = 1e-5 * directions / lengths
    change = prior.gradient(points + step) - prior.gradient(points - step)
    return np.asarray(change * lengths / 2e-5)
