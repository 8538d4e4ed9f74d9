"""Predictions of the field of :mod:`tactile_lab.slam.shape.fields.gpis`, from the weights of its observations."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.spatial.distance import cdist

from drivers.core.contacts import Array
from tactile_lab.slam.shape.fields.kernels import Kernel
from tactile_lab.slam.shape.fields.priors import PriorMean


@dataclass(frozen=True)
class Prediction:
    """The field at q places.

    Attributes:
        mean_m: shape (q,), positive outside.
        gradient: shape (q, d); empty if not asked for.
        variance_m2: shape (q,); empty if not asked for.
    """

    mean_m: Array
    gradient: Array
    variance_m2: Array


@dataclass(frozen=True)
class PosteriorMean:
    """The mean (2.18) and its gradient, without forming the covariance with all rows.

    Attributes:
        kernel, prior: of the field.
        points_m: observed places, shape (n, d); the first of them with gradients.
        on_values: weights of their values, shape (n,).
        on_gradients: weights of the gradients, shape (g, d).
    """

    kernel: Kernel
    prior: PriorMean
    points_m: Array
    on_values: Array
    on_gradients: Array

    def at(self, queries_m: Array, *, gradient: bool) -> tuple[Array, Array]:
        """Mean, shape (q,), and its gradient, shape (q, d), left zero unless asked for."""
        count = len(self.on_gradients)
        touched = self.points_m[:count]
        phi = self.kernel.profile(cdist(queries_m, self.points_m, "sqeuclidean"))
        along = queries_m @ self.on_gradients.T - np.sum(touched * self.on_gradients, axis=1)
        slope = phi.first[:, :count]
        mean = self.prior.value(queries_m) + phi.value @ self.on_values - 2 * np.einsum("qn,qn->q", slope, along)
        if not gradient:
            return mean, np.zeros_like(queries_m)
        pull = 2 * phi.first * self.on_values
        pull[:, :count] -= 4 * phi.second[:, :count] * along
        change = queries_m * pull.sum(axis=1)[:, None] - pull @ self.points_m - 2 * slope @ self.on_gradients
        return mean, self.prior.gradient(queries_m) + change
