"""Covariance functions of the surface field, with the derivatives that normals need.

Every kernel here is radial and twice differentiable, so it is written as ``k(x, z) = phi(s)`` with
``s = |x - z|^2``. Two derivatives of ``phi`` then give every covariance between values and gradients,
in any dimension, with ``d = x - z``:

    cov(f(x),    f(z))    =  phi
    cov(df(x)_i, f(z))    =  2 phi' d_i
    cov(f(x),    df(z)_j) = -2 phi' d_j
    cov(df(x)_i, df(z)_j) = -4 phi'' d_i d_j - 2 phi' [i = j]

Kernels work in any units: with points and field in metres, amplitudes are in square metres and lengths in metres.
Adjustable parameters are passed to optimisers as logarithms.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import NamedTuple, Protocol, Self

import numpy as np

from drivers.core.contacts import Array


class Profile(NamedTuple):
    """``phi`` and its derivatives with respect to the squared distance, each of the shape of the squared distances."""

    value: Array
    first: Array
    second: Array


class Kernel(Protocol):
    """A radial covariance function with adjustable parameters."""

    @property
    def amplitude(self) -> float:
        """Prior variance of the field, ``phi(0)``."""

    @property
    def log_parameters(self) -> Array:
        """Logarithms of the parameters that may be optimised, amplitude first."""

    def with_log_parameters(self, log_parameters: Array) -> Self:
        """The same kernel with other parameters."""

    def profile(self, squared: Array) -> Profile:
        """``phi`` and two derivatives at squared distances."""

    def log_parameter_profiles(self, squared: Array) -> list[Profile]:
        """Derivatives of :meth:`profile` with respect to each logarithmic parameter."""


@dataclass(frozen=True)
class _Scaled:
    """Kernels with an amplitude and a length."""

    amplitude: float
    length: float

    @property
    def log_parameters(self) -> Array:
        return np.log([self.amplitude, self.length])

    def with_log_parameters(self, log_parameters: Array) -> Self:
        amplitude, length = np.exp(log_parameters)
        return replace(self, amplitude=float(amplitude), length=float(length))


class SquaredExponential(_Scaled):
    """``amplitude * exp(-r^2 / length^2)`` (eq. 2.15; note the missing factor 2 of the usual form)."""

    def profile(self, squared: Array) -> Profile:
        inverse = self.length**-2
        value = self.amplitude * np.exp(-inverse * squared)
        return Profile(value, -inverse * value, inverse**2 * value)

    def log_parameter_profiles(self, squared: Array) -> list[Profile]:
        phi = self.profile(squared)
        scaled = squared * self.length**-2
        by_length = Profile(2 * scaled * phi.value, 2 * (scaled - 1) * phi.first, 2 * (scaled - 2) * phi.second)
        return [phi, by_length]


class Matern52(_Scaled):
    """Matérn kernel of smoothness 5/2: fields with continuous second derivatives, less stiff than (2.15)."""

    def profile(self, squared: Array) -> Profile:
        """Computed in place where possible, because there are many numbers and few operations on each."""
        rate, scaled, second = self._terms(squared)
        value = scaled / 3
        value += 1
        value *= scaled
        value += 1
        value *= second
        scaled += 1
        first = scaled
        first *= second
        first *= -(rate**2) / 6
        second *= rate**4 / 12
        return Profile(value, first, second)

    def log_parameter_profiles(self, squared: Array) -> list[Profile]:
        rate, scaled, decay = self._terms(squared)
        by_length = Profile(
            decay * scaled**2 * (1 + scaled) / 3,
            rate**2 / 6 * decay * (2 * (1 + scaled) - scaled**2),
            rate**4 / 12 * decay * (scaled - 4),
        )
        return [self.profile(squared), by_length]

    def _terms(self, squared: Array) -> tuple[float, Array, Array]:
        rate = np.sqrt(5.0) / self.length
        scaled = np.sqrt(squared)
        scaled *= rate
        decay = np.exp(-scaled)
        decay *= self.amplitude
        return float(rate), scaled, decay


@dataclass(frozen=True)
class ThinPlate:
    """``amplitude * (2 r^3 - 3 R r^2 + R^3) / R^3`` with the radius R (eq. 2.17, there with amplitude ``R^3 / 12``).

    The thin plate is only conditionally positive definite: it is a covariance within a domain whose largest distance is
    at most R, so R has to cover the data and the query points. Points farther apart than R count as independent. The
    second derivative grows without bound towards ``r = 0``, where it only ever appears multiplied by ``d_i d_j``; it is
    set to zero there.
    """

    radius: float
    amplitude: float

    @property
    def log_parameters(self) -> Array:
        return np.log([self.amplitude])

    def with_log_parameters(self, log_parameters: Array) -> Self:
        return replace(self, amplitude=float(np.exp(log_parameters[0])))

    def profile(self, squared: Array) -> Profile:
        ratio = np.minimum(np.sqrt(squared) / self.radius, 1.0)
        inside = (ratio > 0) & (ratio < 1)
        slope = self.amplitude / self.radius**2
        second = np.divide(1.5 * slope / self.radius**2, ratio, out=np.zeros_like(ratio), where=inside)
        return Profile(self.amplitude * (1 - ratio) ** 2 * (1 + 2 * ratio), -3 * slope * (1 - ratio), second)

    def log_parameter_profiles(self, squared: Array) -> list[Profile]:
        return [self.profile(squared)]


def differences(points: Array, others: Array) -> Array:
    """``points - others`` for all pairs, shape (d, n, m), contiguous for each coordinate."""
    return points.T[:, :, None] - others.T[:, None, :]


def covariance(kernel: Kernel, points: Array, gradient_count: int) -> Array:
    """Prior covariance of the values at n points and of the gradients at the first of them.

    Args:
        kernel: the covariance function.
        points: shape (n, d).
        gradient_count: gradients are observed at ``points[:gradient_count]``.

    Returns:
        Symmetric matrix of n + gradient_count * d rows: all values, then the gradients' first
        components, then their second ones, and so on.
    """
    deltas = differences(points, points)
    phi = kernel.profile(np.einsum("dnm,dnm->nm", deltas, deltas))
    n, m, dimension = len(points), gradient_count, points.shape[1]
    matrix = np.empty((n + m * dimension, n + m * dimension))
    matrix[:n, :n] = phi.value
    slope, curvature = -2 * phi.first, -4 * phi.second[:m, :m]
    for j in range(dimension):
        columns = slice(n + j * m, n + (j + 1) * m)
        matrix[:n, columns] = slope[:, :m] * deltas[j, :, :m]
        matrix[columns, :n] = matrix[:n, columns].T
        weighted = curvature * deltas[j, :m, :m]
        for i in range(j + 1):
            block = weighted * deltas[i, :m, :m]
            if i == j:
                block += slope[:m, :m]
            rows = slice(n + i * m, n + (i + 1) * m)
            matrix[rows, columns] = block
            matrix[columns, rows] = block
    return matrix


def cross_covariance(kernel: Kernel, queries: Array, points: Array, gradient_count: int) -> Array:
    """Prior covariance of the values at q places with the rows of :func:`covariance`, shape (q, rows)."""
    n, m, dimension = len(points), gradient_count, points.shape[1]
    deltas = differences(queries, points)
    phi = kernel.profile(np.einsum("dnm,dnm->nm", deltas, deltas))
    matrix = np.empty((len(queries), n + m * dimension))
    matrix[:, :n] = phi.value
    slope = -2 * phi.first[:, :m]
    for j in range(dimension):
        np.multiply(slope, deltas[j, :, :m], out=matrix[:, n + j * m : n + (j + 1) * m])
    return matrix


def cross_covariance_with_gradients(kernel: Kernel, queries: Array, points: Array, gradient_count: int) -> Array:
    """Prior covariance of values and gradients at q places, in the order of :func:`covariance`, with its rows.

    Shape (q + q d, rows).
    """
    n, m, dimension, count = len(points), gradient_count, points.shape[1], len(queries)
    deltas = differences(queries, points)
    phi = kernel.profile(np.einsum("dnm,dnm->nm", deltas, deltas))
    matrix = np.empty((count * (dimension + 1), n + m * dimension))
    matrix[:count] = cross_covariance(kernel, queries, points, gradient_count)
    for i in range(dimension):
        rows = slice(count * (i + 1), count * (i + 2))
        matrix[rows, :n] = 2 * phi.first * deltas[i]
        for j in range(dimension):
            block = -4 * phi.second[:, :m] * deltas[i, :, :m] * deltas[j, :, :m]
            matrix[rows, n + j * m : n + (j + 1) * m] = block - 2 * phi.first[:, :m] if i == j else block
    return matrix


def log_parameter_traces(kernel: Kernel, points: Array, gradient_count: int, weights: Array) -> Array:
    """``sum(weights * dK/dlog(parameter))`` for each parameter, K being :func:`covariance`.

    The weights (symmetric, of K's shape) are first gathered onto ``phi``, ``phi'`` and ``phi''``, so
    that no derivative of K is ever formed.
    """
    n, m, dimension = len(points), gradient_count, points.shape[1]
    deltas = differences(points, points)
    on_value, on_first, on_second = weights[:n, :n], np.zeros((n, n)), np.zeros((m, m))
    for j in range(dimension):
        columns = slice(n + j * m, n + (j + 1) * m)
        on_first[:, :m] -= 4 * weights[:n, columns] * deltas[j, :, :m]
        on_first[:m, :m] -= 2 * weights[columns, columns]
        for i in range(dimension):
            rows = slice(n + i * m, n + (i + 1) * m)
            on_second -= 4 * weights[rows, columns] * deltas[i, :m, :m] * deltas[j, :m, :m]
    profiles = kernel.log_parameter_profiles(np.einsum("dnm,dnm->nm", deltas, deltas))
    return np.array(
        [
            np.vdot(on_value, p.value) + np.vdot(on_first, p.first) + np.vdot(on_second, p.second[:m, :m])
            for p in profiles
        ]
    )
