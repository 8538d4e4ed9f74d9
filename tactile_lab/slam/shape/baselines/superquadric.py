"""Superquadrics (eq. 2.1): their distance field, and the best fit to given contacts.

In the plane the figure is the superellipse with one exponent. Both are written with nested p-norms, which stay finite
for boxes (small exponents) where the powers of the usual inside-outside function overflow.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.optimize import least_squares
from scipy.spatial.transform import Rotation

from drivers.core.contacts import Array
from tactile_lab.slam.shape.fields.observations import check_contacts

EXPONENT_BOUNDS = (0.1, 1.9)
"""Range of exponents: from a box with hardly rounded edges to nearly an octahedron."""

SEMI_AXIS_BOUNDS_m = (0.003, 0.5)
_SIZE_LOG_SIGMA = 1.0
"""Prior standard deviation of the logarithms of the semi-axes (a factor e), for sides without contacts."""
_EXPONENT_SIGMA = 1.0
_LOSS_SCALE = 2.0
"""Beyond this many standard deviations the influence of a contact stops growing."""
_START_EXPONENTS = (0.4, 1.0)
_FIRST_EVALUATIONS, _EVALUATIONS = 12, 60
_FINISHED = 2
"""Number of initial values, the best after the first evaluations, that are optimized to the end."""
_STEP = 1e-5


@dataclass(frozen=True)
class Superquadric:
    """A superquadric in space or a superellipse in the plane.

    Attributes:
        centre_m: shape (d,).
        axes: its axes as rows, orthonormal, shape (d, d).
        semi_axes_m: a1, a2 (and a3) of (2.1), shape (d,).
        exponents: epsilon_1 and epsilon_2 of (2.1); in the plane only epsilon_2.
    """

    centre_m: Array
    axes: Array
    semi_axes_m: Array
    exponents: Array

    def value(self, points_m: Array) -> Array:
        """Distance to the surface along the ray from the centre, positive outside, shape (n,); at the centre minus
        the mean semi-axis."""
        radius, norm, _ = self._norm_and_gradient(points_m)
        return np.where(radius > 0, radius - _ray_length(radius, norm), -self.semi_axes_m.mean())

    def gradient(self, points_m: Array) -> Array:
        """Gradient of :meth:`value`, shape (n, d); zero at the centre."""
        radius, norm, by_place = self._norm_and_gradient(points_m)
        outward = np.divide(points_m - self.centre_m, radius[:, None], where=radius[:, None] > 0, out=0 * points_m)
        ray = _ray_length(radius, norm)
        safe = np.where(norm > 0, norm, 1.0)
        return np.asarray(outward * (1 - 1 / safe)[:, None] + (ray / safe)[:, None] * by_place) * (radius > 0)[:, None]

    def _norm_and_gradient(self, points_m: Array) -> tuple[Array, Array, Array]:
        """Distance from the centre; the norm that is one on the surface; its gradient with respect to the point, shape
        (n, d).
        """
        offset = points_m - self.centre_m
        local = offset @ self.axes.T / self.semi_axes_m
        size = np.abs(local)
        norm, first, second = _p_norm(size[:, 0], size[:, 1], 2 / self.exponents[-1])
        columns = [first, second]
        if local.shape[1] == 3:
            norm, by_flat, by_height = _p_norm(norm, size[:, 2], 2 / self.exponents[0])
            columns = [by_flat * first, by_flat * second, by_height]
        by_place = (np.column_stack(columns) * np.sign(local) / self.semi_axes_m) @ self.axes
        return np.linalg.norm(offset, axis=1), norm, by_place


def _ray_length(radius: Array, norm: Array) -> Array:
    """Distance from the centre to the surface along the ray through each point."""
    return np.divide(radius, norm, where=norm > 0, out=np.zeros_like(radius))


def _p_norm(a: Array, b: Array, power: float) -> tuple[Array, Array, Array]:
    """``(a^p + b^p)^(1/p)`` of numbers that are not negative, and its derivatives by a and by b."""
    larger, smaller = np.maximum(a, b), np.minimum(a, b)
    safe = np.where(larger > 0, larger, 1.0)
    norm = larger * (1 + (smaller / safe) ** power) ** (1 / power)
    safe = np.where(norm > 0, norm, 1.0)
    return norm, (a / safe) ** (power - 1), (b / safe) ** (power - 1)


@dataclass(frozen=True)
class SuperquadricFit:
    """The result of :func:`fit_superquadric`.

    Attributes:
        superquadric: the best one.
        log_evidence: by the Bayesian information criterion, comparable with a field's log marginal likelihood.
        parameters: centre, rotation, logarithms of the semi-axes, exponents.
        covariance: of the parameters, shape (p, p); zero for those held fixed.
    """

    superquadric: Superquadric
    log_evidence: float
    parameters: Array
    covariance: Array

    def sigma(self, points_m: Array) -> Array:
        """Standard deviation of the surface near points of shape (n, d), from the covariance of the parameters."""
        dimension, effects = points_m.shape[1], []
        for step in _STEP * np.eye(len(self.parameters)):
            ahead, behind = (_from_parameters(self.parameters + s * step, dimension).value(points_m) for s in (1, -1))
            effects.append((ahead - behind) / (2 * _STEP))
        seen = np.array(effects)
        return np.asarray(np.sqrt(np.einsum("in,ij,jn->n", seen, self.covariance, seen)))


def fit_superquadric(
    points_m: Array, normals: Array, point_sigma_m: Array, normal_sigma_rad: Array, *, exponents: Array | None = None
) -> SuperquadricFit:
    """The superquadric with the largest posterior density, by robust least squares from several initial values.

    Centre, directions, semi-axes and exponents are fitted together to distances from the surface and directions of its
    normals, each weighted by its standard deviation. Sizes have a wide prior, so that contacts on one side give a
    superquadric that is small and uncertain on the others. (The thesis's sources use a genetic algorithm. Starting
    along the principal axes of the points and of the normals, with each axis in turn as the third, finds the same
    optimum in a fraction of the time.)

    Args:
        points_m: shape (n, 2) or (n, 3).
        normals: outward unit normals, shape (n, d).
        point_sigma_m: shape (n,), metres.
        normal_sigma_rad: shape (n,), radians.
        exponents: held fixed at these values if given; ones for an ellipsoid.

    Raises:
        ShapeError: the contacts cannot be used, see :func:`check_contacts`.
    """
    check_contacts(points_m, normals, point_sigma_m, normal_sigma_rad)
    fit = _Fit(points_m, normals, point_sigma_m, normal_sigma_rad, exponents)
    sketches = sorted((fit.from_start(start, _FIRST_EVALUATIONS) for start in fit.starts()), key=lambda each: each[0])
    results = [fit.from_start(sketch[1], _EVALUATIONS) for sketch in sketches[:_FINISHED]]
    _, parameters, covariance = min(results, key=lambda each: each[0])
    evidence = fit.log_likelihood(parameters) - 0.5 * len(covariance) * np.log(len(points_m) * (fit.dimension + 1))
    best = _from_parameters(parameters, fit.dimension)
    return SuperquadricFit(best, float(evidence), parameters, fit.spread(covariance))


class _Fit:
    """Residuals of the contacts, and initial values."""

    def __init__(
        self, points_m: Array, normals: Array, point_sigma_m: Array, normal_sigma: Array, exponents: Array | None
    ) -> None:
        self.points_m, self.normals = points_m, normals
        self.dimension = points_m.shape[1]
        self._point_sigma_m, self._normal_sigma = np.maximum(point_sigma_m, 1e-5), np.maximum(normal_sigma, 1e-3)
        self._exponents = exponents
        self._middle = (points_m.min(axis=0) + points_m.max(axis=0)) / 2
        self._size = float(np.clip(np.ptp(points_m, axis=0).max() / 2, *SEMI_AXIS_BOUNDS_m))
        turns = 1 if self.dimension == 2 else 3
        self._free = np.arange(self.dimension * 2 + turns + (0 if exponents is not None else self.dimension - 1))

    def starts(self) -> list[Array]:
        shapes = [self._exponents] if self._exponents is not None else _START_EXPONENTS
        frames = [_principal_axes(self.points_m - self.points_m.mean(axis=0)), _principal_axes(self.normals)]
        if self.dimension == 3:
            frames = [np.roll(axes, turn, axis=0) for axes in frames for turn in range(3)]
        return [self._start(axes, np.broadcast_to(shape, self.dimension - 1)) for axes in frames for shape in shapes]

    def from_start(self, start: Array, evaluations: int) -> tuple[float, Array, Array]:
        """Cost, parameters, and covariance of the free parameters at the optimum reached from an initial value."""
        held = start.copy()

        def residuals(free: Array) -> Array:
            held[self._free] = free
            return self._residuals(held)

        lower, upper = self._bounds()
        begin = np.clip(start[self._free], lower + 1e-9, upper - 1e-9)
        found = least_squares(
            residuals, begin, bounds=(lower, upper), loss="soft_l1", f_scale=_LOSS_SCALE, max_nfev=evaluations
        )
        held[self._free] = found.x
        jacobian = np.asarray(found.jac, dtype=float)
        information = jacobian.T @ jacobian
        return float(found.cost), held, np.linalg.inv(information + 1e-9 * np.diag(np.diag(information) + 1.0))

    def log_likelihood(self, parameters: Array) -> float:
        """Gaussian log likelihood of all values and gradients, as in a field's marginal likelihood."""
        squared = self._contact_residuals(parameters) ** 2
        scale = np.log(self._point_sigma_m).sum() + self.dimension * np.log(self._normal_sigma).sum()
        return float(-0.5 * squared.sum() - scale - 0.5 * len(squared) * np.log(2 * np.pi))

    def spread(self, free_covariance: Array) -> Array:
        """The full covariance, in which parameters held fixed are certain."""
        size = 2 * self.dimension + (1 if self.dimension == 2 else 3) + self.dimension - 1
        covariance = np.zeros((size, size))
        covariance[np.ix_(self._free, self._free)] = free_covariance
        return covariance

    def _residuals(self, parameters: Array) -> Array:
        shape = _from_parameters(parameters, self.dimension)
        sizes = np.log(shape.semi_axes_m / self._size) / _SIZE_LOG_SIGMA
        shares = (shape.exponents - 1.0) / _EXPONENT_SIGMA
        return np.concatenate([self._contact_residuals(parameters), sizes, shares])

    def _contact_residuals(self, parameters: Array) -> Array:
        shape = _from_parameters(parameters, self.dimension)
        gradient = shape.gradient(self.points_m)
        slope = np.maximum(np.linalg.norm(gradient, axis=1), 0.3)
        turned = (gradient / slope[:, None] - self.normals) / self._normal_sigma[:, None]
        return np.concatenate([shape.value(self.points_m) / slope / self._point_sigma_m, turned.ravel()])

    def _start(self, axes: Array, exponents: Array) -> Array:
        extents = np.ptp(self.points_m @ axes.T, axis=0) / 2
        log_sizes = np.log(np.clip(extents, 0.3 * self._size, None))
        turn = [np.arctan2(axes[0, 1], axes[0, 0])] if self.dimension == 2 else Rotation.from_matrix(axes).as_rotvec()
        return np.concatenate([self._middle, turn, log_sizes, exponents])

    def _bounds(self) -> tuple[Array, Array]:
        place = 4 * self._size + 0.05
        turns = 1 if self.dimension == 2 else 3
        logs = np.log(SEMI_AXIS_BOUNDS_m)
        lower = [*(self._middle - place), *[-np.inf] * turns, *[logs[0]] * self.dimension]
        upper = [*(self._middle + place), *[np.inf] * turns, *[logs[1]] * self.dimension]
        shapes = [[bound] * (self.dimension - 1) for bound in EXPONENT_BOUNDS]
        count = len(self._free)
        return np.array(lower + shapes[0])[:count], np.array(upper + shapes[1])[:count]


def _from_parameters(parameters: Array, dimension: int) -> Superquadric:
    """Parameters in this order: centre, rotation (angle or rotation vector), logarithms of the semi-axes, exponents."""
    centre, rest = parameters[:dimension], parameters[dimension:]
    if dimension == 2:
        cosine, sine = np.cos(rest[0]), np.sin(rest[0])
        axes, rest = np.array([[cosine, sine], [-sine, cosine]]), rest[1:]
    else:
        axes, rest = Rotation.from_rotvec(rest[:3]).as_matrix(), rest[3:]
    return Superquadric(centre, axes, np.exp(rest[:dimension]), rest[dimension:])


def _principal_axes(directions: Array) -> Array:
    """Right-handed orthonormal axes as rows, that of largest spread first."""
    axes = np.linalg.eigh(directions.T @ directions)[1].T[::-1].copy()
    if np.linalg.det(axes) < 0:
        axes[-1] *= -1
    return np.asarray(axes)
