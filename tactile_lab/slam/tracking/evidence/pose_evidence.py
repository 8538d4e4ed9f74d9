"""The likelihood of all poses together, the shape integrated out.

Contacts placed by wrong poses make a surface that is improbable under the Gaussian process. So the log marginal
likelihood (2.16) of all contacts, values and normals, is a function of all poses: no shape has to be fixed
while poses are corrected, and its derivative by every contact is known in closed form. With the motion model
(3.7) between successive poses it is the posterior of the trajectory.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import singledispatch

import numpy as np
from scipy.linalg import lapack
from scipy.optimize import minimize

from drivers.core.contacts import Array
from tactile_lab.slam.shape.fields.kernels import (
    Kernel,
    Matern52,
    Profile,
    SquaredExponential,
    ThinPlate,
    cross_covariance,
)
from tactile_lab.slam.shape.fields.priors import PriorMean
from tactile_lab.slam.shape.fields.settings import initial_kernel, observe, prior_mean
from tactile_lab.slam.tracking.contacts.contact_map import ContactMap
from tactile_lab.slam.tracking.contacts.motion import MotionNoise
from tactile_lab.slam.tracking.evidence.evidence_kernels import assemble, pull
from tactile_lab.slam.tracking.evidence.motion_cost import MotionCost

_JITTER = 1e-9
_LEAST_INFORMATION = 1e-9
"""Added to the information relative to its diagonal, for poses without contacts."""


@dataclass(frozen=True)
class _Placed:
    """Contacts in the object frame for some poses, their squared distances with the kernel's profile there, and the
    factorised covariance of what they observe."""

    points: Array
    normals: Array
    squared: Array
    phi: Profile
    factor: Array
    residual: Array
    weights: Array

    @property
    def misfit(self) -> float:
        """Negative log likelihood up to a constant (2.16)."""
        return float(0.5 * self.residual @ self.weights + np.log(np.diag(self.factor)).sum())


class PoseEvidence:
    """Negative log posterior of the poses of a map's grasps, up to a constant. The first pose is given."""

    def __init__(self, contact_map: ContactMap, noise: MotionNoise) -> None:
        """
        Args:
            contact_map: grasps, motions, kernel parameters; the present poses place the prior mean.
            noise: of the motion model.
        """
        self._space = contact_map.space
        self._motion = MotionCost.of(contact_map, noise)
        self._world = contact_map.contacts_world
        self._grasp_of = contact_map.grasp_indices
        contacts = contact_map.contacts
        seen = observe(
            contacts.points_m, contacts.normals, contacts.point_sigma_m, contacts.normal_sigma_rad, contact_map.settings
        )
        self._noise_variance = seen.noise_variance
        self._kernel: Kernel = initial_kernel(seen, contact_map.settings)
        self._prior: PriorMean = prior_mean(contacts.points_m, contacts.normals, contact_map.settings)
        self._last: tuple[Array, _Placed] | None = None

    def value(self, rows: Array) -> float:
        """The negative log posterior at poses of shape (k, size)."""
        return self._place_contacts(rows).misfit + self._motion.value(rows)

    def value_and_gradient(self, rows: Array) -> tuple[float, Array]:
        """The negative log posterior and its derivative by each pose, shape (k, size)."""
        placed = self._place_contacts(rows)
        cost, gradient = self._motion.value_and_gradient(rows)
        np.add.at(gradient, self._grasp_of, self._by_contacts(rows, placed))
        return placed.misfit + cost, gradient

    def information(self, rows: Array) -> Array:
        """Approximate second derivative of the negative log posterior by all poses but the first.

        A contact that moves along its normal changes the field like a different observed value at its place
        (Gauss-Newton); the inverse is the poses' joint covariance.

        Returns:
            Shape ((k - 1) size, (k - 1) size), positive definite.
        """
        whitened = self._whitened_change(rows, self._place_contacts(rows))
        total = whitened.T @ whitened + self._motion.information(rows)
        total[np.diag_indices_from(total)] *= 1 + _LEAST_INFORMATION
        return np.asarray(total)

    def field_change(self, rows: Array, places_m: Array) -> Array:
        """Derivatives of the field's mean at places by all poses but the first.

        Args:
            rows: poses, shape (k, size).
            places_m: object frame, shape (q, d).

        Returns:
            Shape (q, (k - 1) size); metres by metres and radians.
        """
        placed = self._place_contacts(rows)
        near = cross_covariance(self._kernel, places_m, placed.points, len(placed.points))
        whitened, _ = lapack.dtrtrs(placed.factor, near.T, lower=1)
        return np.asarray(whitened.T @ self._whitened_change(rows, placed))

    def _whitened_change(self, rows: Array, placed: _Placed) -> Array:
        """Whitened derivatives of the contacts' observations by all poses but the first."""
        size = self._space.size
        count, dimension = placed.points.shape
        seen = np.zeros(((dimension + 1) * count, len(rows), size))
        contact = np.arange(count)
        poses, still = rows[self._grasp_of], np.zeros_like(placed.normals)
        seen[contact, self._grasp_of] = -self._space.by_row(poses, placed.points, placed.normals, placed.normals, still)
        for axis in range(dimension):
            unit = np.broadcast_to(np.eye(dimension)[axis], placed.normals.shape)
            turned = self._space.by_row(poses, placed.points, placed.normals, still, unit)
            seen[(axis + 1) * count + contact, self._grasp_of] = turned
        whitened, _ = lapack.dtrtrs(placed.factor, seen.reshape(len(seen), -1)[:, size:], lower=1)
        return np.asarray(whitened)

    def maximise(self, rows: Array, max_iterations: int, accuracy: float = 0.1) -> tuple[Array, float]:
        """Poses of largest posterior near the given ones, and the negative log posterior there.

        L-BFGS on variables that are uncorrelated and of unit variance by :meth:`information`: half the iterations
        of millimetres and degrees.

        Args:
            rows: initial poses, shape (k, size).
            max_iterations: of the optimiser.
            accuracy: gain below which it stops.
        """
        if len(rows) == 1:
            return rows, self.value(rows)
        rows = np.vstack([rows[:1], self._space.move(rows[1:], np.zeros_like(rows[1:]))])  # as the first step has them
        spread = np.linalg.inv(np.linalg.cholesky(self.information(rows))).T
        scale = max(abs(self.value(rows)), 1.0)

        def moved(variables: Array) -> Array:
            steps = (spread @ variables).reshape(-1, self._space.size)
            return np.vstack([rows[:1], self._space.move(rows[1:], steps)])

        def objective(variables: Array) -> tuple[float, Array]:
            value, gradient = self.value_and_gradient(moved(variables))
            return value, spread.T @ gradient[1:].ravel()

        found = minimize(
            objective,
            np.zeros(len(spread)),
            jac=True,
            method="L-BFGS-B",
            options={"maxiter": max_iterations, "ftol": accuracy / scale, "gtol": 1e-3, "maxcor": 20},
        )
        return moved(found.x), float(found.fun)

    def _place_contacts(self, rows: Array) -> _Placed:
        """The contacts for some poses; the last ones are cached, as the same are often requested in turn."""
        if self._last is None or not np.array_equal(self._last[0], rows):
            self._last = rows.copy(), self._compute(rows)
        return self._last[1]

    def _compute(self, rows: Array) -> _Placed:
        points, normals = self._space.to_object(rows[self._grasp_of], self._world.points_m, self._world.normals)
        squared = _squared_distances(points)
        phi = self._kernel.profile(squared)
        matrix = assemble(points, *phi, self._noise_variance, _JITTER)
        diagonal = np.diag(matrix).copy()
        factor, problem = lapack.dpotrf(matrix.T, lower=1, clean=1, overwrite_a=1)
        if problem:  # contacts thrown onto each other by a wild step of the line search
            factor, _ = lapack.dpotrf(np.diag(diagonal), lower=1)
        residual = np.concatenate([-self._prior.value(points), (normals - self._prior.gradient(points)).T.ravel()])
        weights, _ = lapack.dpotrs(factor, residual, lower=1)
        return _Placed(points, normals, squared, phi, factor, residual, np.asarray(weights))

    def _by_contacts(self, rows: Array, placed: _Placed) -> Array:
        """Derivative of the misfit by the pose of each contact's grasp, shape (n, size)."""
        points, normals, weights, phi = placed.points, placed.normals, placed.weights, placed.phi
        count, dimension = points.shape
        by_normals = np.ascontiguousarray(weights[count:].reshape(dimension, count).T)
        third = third_derivative(self._kernel, placed.squared, phi)
        inverse, _ = lapack.dpotri(placed.factor, lower=1)
        by_points = pull(points, phi.first, phi.second, third, inverse, weights)
        by_points -= weights[:count, None] * self._prior.gradient(points)
        by_points -= _directional_change(self._prior, points, by_normals)
        return self._space.by_row(rows[self._grasp_of], points, normals, by_points, by_normals)


def _squared_distances(points: Array) -> Array:
    deltas = points.T[:, :, None] - points.T[:, None, :]
    return np.asarray(np.einsum("dnm,dnm->nm", deltas, deltas))


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
