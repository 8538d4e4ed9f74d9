"""Gaussian process implicit surface: the shape of an object from contacts and their normals (chapter 2).

The surface is the zero level of a field f, positive outside (2.3). With the normals as observed
gradients f is nearly a signed distance in metres: ``f / |grad f|`` is a distance and
``sqrt(variance) / |grad f|`` its standard deviation.
"""

from __future__ import annotations

from collections.abc import Iterator
from functools import cached_property
from typing import Self

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import Bounds, minimize
from scipy.spatial.distance import cdist

from drivers.core.contacts import Array
from drivers.core.errors import ShapeError
from tactile_lab.slam.shape.fields.kernels import (
    Kernel,
    covariance,
    cross_covariance,
    cross_covariance_with_gradients,
    log_parameter_traces,
)
from tactile_lab.slam.shape.fields.leave_one_out import inflation, negative_log_densities
from tactile_lab.slam.shape.fields.observations import POINTS_A_CONTACT, Observations, check_contacts
from tactile_lab.slam.shape.fields.posterior import PosteriorMean, Prediction
from tactile_lab.slam.shape.fields.priors import PriorMean
from tactile_lab.slam.shape.fields.row_factor import RowFactor
from tactile_lab.slam.shape.fields.settings import GpisSettings, initial_kernel, observe, prior_mean

_BLOCK_ENTRIES = 1 << 19
"""Entries of the largest temporary matrix in a prediction: 4 MiB, which fits the cache."""

_SINGLE_PRECISION_RATIO = 1000.0
"""Largest ratio of the prior's variance to a value's noise at which single precision keeps sigma to half a percent."""

_AMPLITUDE_BOUNDS_m = (1e-3, 0.3)
_LENGTH_BOUNDS_m = (0.010, 0.300)
_NOISE_SCALE_BOUNDS = (0.3, 10.0)


class Gpis:
    """A fitted field; immutable. Made by :meth:`fit`.

    Attributes:
        contacts_m: the contacts, shape (n, d), metres, in the frame of the caller (usually the object's).
        normals: their outward unit normals, shape (n, d).
        settings: as given to :meth:`fit`.
        kernel: the covariance function with its current parameters.
        prior: the prior mean.
        noise_scale: factor on all standard deviations of observations, 1 unless optimised.
    """

    def __init__(
        self,
        contacts_m: Array,
        normals: Array,
        settings: GpisSettings,
        observations: Observations,
        kernel: Kernel,
        prior: PriorMean,
        noise_scale: float = 1.0,
        factor: RowFactor | None = None,
    ) -> None:
        self.contacts_m, self.normals, self.settings = contacts_m, normals, settings
        self.observations, self.kernel, self.prior, self.noise_scale = observations, kernel, prior, noise_scale
        self._gradient_count = len(observations.gradients)
        self._residual = self._observed_minus_prior()
        self._factor = factor or self._factorise()
        self._weights = self._factor.solve(self._residual)

    @classmethod
    def fit(
        cls,
        points_m: Array,
        normals: Array,
        point_sigma_m: Array | float = 0.001,
        normal_sigma_rad: Array | float = 0.1,
        settings: GpisSettings | None = None,
    ) -> Self:
        """Fit the field to contacts (algorithm 2.1).

        Args:
            points_m: contact points, shape (n, 2) or (n, 3), metres.
            normals: unit normals out of the object, shape (n, d).
            point_sigma_m: standard deviation of the points along their normals, shape (n,) or one for all.
            normal_sigma_rad: standard deviation of the normals, shape (n,) or one for all.
            settings: the defaults if None.

        Raises:
            ShapeError: the contacts cannot be used (see :func:`check_contacts`), or their covariance is not positive
                definite even with jitter.
        """
        settings = settings or GpisSettings()
        points_m, normals = np.array(points_m, dtype=float), np.array(normals, dtype=float)
        point_sigma_m, normal_sigma_rad = _one_each(point_sigma_m, points_m), _one_each(normal_sigma_rad, points_m)
        check_contacts(points_m, normals, point_sigma_m, normal_sigma_rad)
        observations = observe(points_m, normals, point_sigma_m, normal_sigma_rad, settings)
        kernel, prior = initial_kernel(observations, settings), prior_mean(points_m, normals, settings)
        return cls(points_m, normals, settings, observations, kernel, prior)

    def extend(
        self,
        points_m: Array,
        normals: Array,
        point_sigma_m: Array | float = 0.001,
        normal_sigma_rad: Array | float = 0.1,
    ) -> Self:
        """The field with contacts appended; kernel, noise scale and prior are unchanged.

        With normals the Cholesky factor is extended, at a cost of order ``n^2`` for few contacts; a new fit costs
        ``n^3``. Arguments and errors as of :meth:`fit`.
        """
        points_m, normals = np.array(points_m, dtype=float), np.array(normals, dtype=float)
        sigmas = _one_each(point_sigma_m, points_m), _one_each(normal_sigma_rad, points_m)
        check_contacts(points_m, normals, *sigmas)
        points_m, normals = np.vstack([self.contacts_m, points_m]), np.vstack([self.normals, normals])
        point_sigma, normal_sigma = map(np.concatenate, zip(self._contact_sigmas(), sigmas, strict=True))
        check_contacts(points_m, normals, point_sigma, normal_sigma)
        observations = observe(points_m, normals, point_sigma, normal_sigma, self.settings)
        factor = self._extended_factor(observations) if self.settings.observations == "normals" else None
        return self._again(points_m, normals, observations, self.kernel, self.prior, self.noise_scale, factor)

    def of_some(self, kept: NDArray[np.intp]) -> Self:
        """The field of a subset of contacts, given by indices, with the same kernel; normals are observed."""
        seen = self.observations
        sigmas = seen.value_sigma_m[kept], seen.gradient_sigma[kept]
        return self.refit(self.contacts_m[kept], self.normals[kept], *sigmas)

    def refit(
        self,
        points_m: Array,
        normals: Array,
        point_sigma_m: Array,
        normal_sigma_rad: Array,
        noise_scale: float = 1.0,
    ) -> Self:
        """The field of other contacts with the same kernel; arguments and errors as of :meth:`fit`."""
        check_contacts(points_m, normals, point_sigma_m, normal_sigma_rad)
        observations = observe(points_m, normals, point_sigma_m, normal_sigma_rad, self.settings)
        prior = prior_mean(points_m, normals, self.settings)
        return self._again(points_m, normals, observations, self.kernel, prior, noise_scale)

    def optimise(
        self, *, noise: bool = False, max_iterations: int = 30, longest_m: float = _LENGTH_BOUNDS_m[1]
    ) -> Self:
        """The field with the kernel's parameters (and the noise scale) at a maximum of the marginal likelihood.

        L-BFGS on the logarithms of the parameters with the analytic gradient, from the present values and within bounds
        that keep the covariance well-conditioned. A present value outside the bounds is moved inside; the kernel's
        length stays below ``longest_m``.
        """
        bounds = np.log(self._bounds(noise, longest_m))
        start = np.append(self.log_parameters, np.log(self.noise_scale))[: len(bounds)]

        def objective(log_parameters: Array) -> tuple[float, Array]:
            candidate = self.with_log_parameters(log_parameters)
            return -candidate.log_marginal_likelihood(), -candidate.log_marginal_likelihood_gradient()[: len(bounds)]

        found = minimize(
            objective,
            np.clip(start, bounds[:, 0], bounds[:, 1]),
            jac=True,
            method="L-BFGS-B",
            bounds=Bounds(bounds[:, 0], bounds[:, 1]),
            options={"maxiter": max_iterations, "ftol": 1e-6},
        )
        return self.with_log_parameters(found.x)

    @property
    def log_parameters(self) -> Array:
        """Logarithms of the kernel's parameters that may be optimised."""
        return self.kernel.log_parameters

    def with_log_parameters(self, log_parameters: Array) -> Self:
        """The same contacts with other kernel parameters and, if one more is given, another noise scale."""
        count = len(self.kernel.log_parameters)
        kernel = self.kernel.with_log_parameters(log_parameters[:count])
        noise_scale = float(np.exp(log_parameters[count])) if len(log_parameters) > count else self.noise_scale
        return self._again(self.contacts_m, self.normals, self.observations, kernel, self.prior, noise_scale)

    def _again(
        self,
        contacts_m: Array,
        normals: Array,
        observations: Observations,
        kernel: Kernel,
        prior: PriorMean,
        noise_scale: float = 1.0,
        factor: RowFactor | None = None,
    ) -> Self:
        """A field of the same kind and settings."""
        return type(self)(contacts_m, normals, self.settings, observations, kernel, prior, noise_scale, factor)

    def log_marginal_likelihood(self) -> float:
        """``log p(observations | parameters)``.

        This is (2.16) with its sign: the thesis prints the negative logarithm, without its constant, under
        the name L, and maximises L.
        """
        misfit = self._residual @ self._weights
        return float(-0.5 * (misfit + self._factor.log_determinant + len(self._residual) * np.log(2 * np.pi)))

    def log_marginal_likelihood_gradient(self) -> Array:
        """Its derivatives by the kernel's ``log_parameters`` and, last, by ``log(noise_scale)``."""
        outer = np.outer(self._weights, self._weights) - self._factor.inverse()
        by_kernel = self._kernel_traces(outer)
        by_noise = 2 * self.noise_scale**2 * (np.diag(outer) @ self.observations.noise_variance)
        return 0.5 * np.append(by_kernel, by_noise)

    def log_density_given_others(self, asked: NDArray[np.intp]) -> float:
        """Logarithm of the joint density of some contacts, value and normal, given all others.

        Args:
            asked: indices of the contacts, shape (a,).
        """
        together = self._rows_of(asked).reshape(1, -1)
        cost = negative_log_densities(self._factor, self._weights, together)[0]
        return float(-cost - 0.5 * together.size * np.log(2 * np.pi))

    def leave_one_out_costs(self, asked: NDArray[np.intp]) -> Array:
        """Negative log density of some contacts, value and normal, each given all others, up to a constant.

        The marginal likelihood of all contacts is that of the others times this density, so these costs show the gain
        from leaving a contact out.

        Args:
            asked: indices of the contacts, shape (a,); costs are in the same order.
        """
        return negative_log_densities(self._factor, self._weights, self._rows_of(asked))

    def _rows_of(self, asked: NDArray[np.intp]) -> NDArray[np.intp]:
        """Rows of each of some contacts, shape (a, e): its value and normal, or the thesis's points on and off it."""
        count = 1 + self.contacts_m.shape[1] if self._gradient_count else POINTS_A_CONTACT
        return np.asarray(asked[:, None] + len(self.contacts_m) * np.arange(count))

    @cached_property
    def sigma_inflation(self) -> float:
        """How many times larger than stated the standard deviation of the surface is, at least 1.

        From :func:`tactile_lab.slam.shape.fields.leave_one_out.inflation`; 1 with off-surface points.
        """
        if self._gradient_count == 0:
            return 1.0
        return inflation(self._factor, self._weights, len(self.observations.points_m), self.contacts_m.shape[1])

    def mean(self, points_m: Array) -> Array:
        """Posterior mean (2.13, 2.18) at points of shape (q, d); shape (q,), metres."""
        return self.predict(points_m).mean_m

    def gradient(self, points_m: Array) -> Array:
        """Gradient of the posterior mean at points of shape (q, d); shape (q, d)."""
        return self.predict(points_m, gradient=True).gradient

    def variance(self, points_m: Array, *, rough: bool = False) -> Array:
        """Posterior variance (2.14) at points of shape (q, d); shape (q,), square metres.

        ``rough`` allows single precision, wherever that changes sigma by less than half a percent.
        """
        points_m = np.asarray(points_m, dtype=float)
        noise = self.noise_scale**2 * self.observations.value_sigma_m.min() ** 2
        fits = self._prior_variance < _SINGLE_PRECISION_RATIO * noise
        single = self._factor.in_single_precision() if rough and fits else None
        return np.concatenate([self._variance(points_m[block], single) for block in self._blocks(len(points_m))])

    def joint_covariance(self, points_m: Array) -> Array:
        """Posterior covariance of the values at points of shape (q, d) with each other, shape (q, q), square metres."""
        points_m = np.asarray(points_m, dtype=float)
        prior = self.kernel.profile(cdist(points_m, points_m, "sqeuclidean")).value
        return np.asarray(prior - self._factor.explained_covariance(self._cross_covariance(points_m)))

    def predict(self, points_m: Array, *, gradient: bool = False, variance: bool = False) -> Prediction:
        """The field at points of shape (q, d), in blocks, so that memory stays bounded for any q.

        Equation 2.18 as usual, ``m + k (K + noise)^-1 (y - m)``; the thesis prints a minus sign there.
        """
        points_m = np.asarray(points_m, dtype=float)
        mean, slope = np.empty(len(points_m)), np.empty(points_m.shape)
        for block in self._blocks(len(points_m)):
            mean[block], slope[block] = self._posterior.at(points_m[block], gradient=gradient)
        return Prediction(mean, slope if gradient else slope[:0], self.variance(points_m) if variance else mean[:0])

    def _contact_sigmas(self) -> tuple[Array, Array]:
        """Standard deviations of points and normals; models with off-surface points neither know nor use those of
        normals.
        """
        seen, count = self.observations, len(self.contacts_m)
        return seen.value_sigma_m[:count], seen.gradient_sigma if self._gradient_count else np.zeros(count)

    def _observed_minus_prior(self) -> Array:
        seen, count = self.observations, self._gradient_count
        values = seen.values_m - self.prior.value(seen.points_m)
        gradients = seen.gradients - self.prior.gradient(seen.points_m[:count])
        return np.concatenate([values, gradients.T.ravel()])

    def _factorise(self) -> RowFactor:
        """The Cholesky factor of ``K + noise``, with the least jitter that it needs."""
        factor = RowFactor.of(self._prior_covariance(), self.noise_scale**2 * self.observations.noise_variance)
        if factor is None:
            raise ShapeError(
                "the covariance of the contacts is not positive definite",
                where=f"{len(self.contacts_m)} contacts, {self.kernel}",
                hint="Use a shorter kernel length, or larger standard deviations of the contacts",
            )
        return factor

    def _prior_covariance(self) -> Array:
        return covariance(self.kernel, self.observations.points_m, self._gradient_count)

    def _cross_covariance(self, queries: Array) -> Array:
        """Prior covariance of the values at q places with all rows, shape (q, rows)."""
        return cross_covariance(self.kernel, queries, self.observations.points_m, self._gradient_count)

    def _kernel_traces(self, weights: Array) -> Array:
        """See :func:`log_parameter_traces`."""
        return log_parameter_traces(self.kernel, self.observations.points_m, self._gradient_count, weights)

    def _extended_factor(self, observations: Observations) -> RowFactor | None:
        """The factor extended to these observations with normals, the first of which are the present ones."""
        old, total, dimension = len(self.contacts_m), len(observations.points_m), self.contacts_m.shape[1]
        new = observations.points_m[old:]
        corner = covariance(self.kernel, new, len(new))
        places = np.arange(total * (dimension + 1)).reshape(dimension + 1, total)
        noise = self.noise_scale**2 * observations.noise_variance[places[:, old:].ravel()]
        np.fill_diagonal(corner, np.diag(corner) + noise)
        cross = cross_covariance_with_gradients(self.kernel, new, self.contacts_m, old)
        return self._factor.extend(cross, corner, places[:, :old].ravel(), places[:, old:].ravel())

    @cached_property
    def _posterior(self) -> PosteriorMean:
        points_m = self.observations.points_m
        on_gradients = self._weights[len(points_m) :].reshape(points_m.shape[1], self._gradient_count).T
        return PosteriorMean(self.kernel, self.prior, points_m, self._weights[: len(points_m)], on_gradients)

    def _variance(self, queries: Array, single: Array | None) -> Array:
        rows = self._cross_covariance(queries)
        prior = self._prior_variance
        floor = np.finfo(float).eps * prior
        return np.asarray(np.maximum(prior - self._factor.explained_variance(rows, single), floor))

    @property
    def _prior_variance(self) -> float:
        return self.kernel.amplitude

    def _blocks(self, count: int) -> Iterator[slice]:
        size = max(1, _BLOCK_ENTRIES // len(self._residual))
        for first in range(0, max(count, 1), size):
            yield slice(first, min(first + size, count))

    def _bounds(self, noise: bool, longest_m: float) -> Array:
        amplitude = np.square(_AMPLITUDE_BOUNDS_m)
        kernel = [amplitude, (_LENGTH_BOUNDS_m[0], longest_m)][: len(self.kernel.log_parameters)]
        return np.array([*kernel, _NOISE_SCALE_BOUNDS] if noise else kernel)


def _one_each(sigma: Array | float, points_m: Array) -> Array:
    """A standard deviation for each contact, also if one is given for all."""
    return np.full(len(points_m), float(sigma)) if np.ndim(sigma) == 0 else np.array(sigma, dtype=float)
