"""A field in space of what is alike along an edge, as cartons, bars and handles are.

Its covariance is a sum: that of a field in space, and for each of three perpendicular directions one that is constant
along the direction and falls off across it. Contacts far apart along an edge or a wall then belong to one section, as
dense as in the plane. What is not alike, rounded edges, crowned lids and tapered sides, is left to the field in space.
How much of each there is follows from the marginal likelihood: a direction along which nothing is alike loses its
amplitude.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from typing import Self

import numpy as np

from drivers.core.contacts import Array
from tactile_lab.slam.shape.fields.gpis import Gpis
from tactile_lab.slam.shape.fields.kernels import (
    Kernel,
    Matern52,
    covariance,
    cross_covariance,
    log_parameter_traces,
)
from tactile_lab.slam.shape.fields.observations import Observations
from tactile_lab.slam.shape.fields.posterior import PosteriorMean
from tactile_lab.slam.shape.fields.priors import PriorMean, ZeroMean
from tactile_lab.slam.shape.fields.row_factor import RowFactor
from tactile_lab.slam.shape.fields.settings import GpisSettings

PRICE_nats = 7.0
"""A nat for each parameter that a field in space does not have: three amplitudes, three lengths and a heading. The
evidence is a maximum over them (Akaike's criterion).
"""
_SPACE_AMPLITUDE_m, _AMPLITUDE_m, _LENGTH_m = 0.010, 0.020, 0.050
"""Where the search for the parameters starts: mostly alike."""
_AMPLITUDE_BOUNDS_m, _LENGTH_BOUNDS_m = (1e-4, 0.3), (0.010, 0.300)
_KERNEL_STEPS, _MOST_FOR_KERNEL = 30, 120
"""More contacts than this do not change the parameters much, and each step takes the third power of their number."""
_SIDEWAYS = 0.5
"""A contact tells about the heading if its unit normal's horizontal part is longer than this."""


@dataclass(frozen=True)
class Section:
    """The part of a field that is constant along one direction.

    Attributes:
        plane: orthonormal rows across the direction, shape (2, 3).
        kernel: covariance in this plane.
    """

    plane: Array
    kernel: Matern52

    def on(self, points_m: Array) -> Array:
        """Points of shape (n, 3) in the plane, shape (n, 2)."""
        return np.asarray(points_m @ self.plane.T)

    def rows_in_space(self, rows: Array, points: int) -> Array:
        """Rows of values and planar gradients, shape (points + 2 m, k), as those in space, shape (points + 3 m, k)."""
        return self._turn(rows, points, self.plane.T)

    def rows_in_plane(self, rows: Array, points: int) -> Array:
        """The transpose of :meth:`rows_in_space`."""
        return self._turn(rows, points, self.plane)

    @staticmethod
    def _turn(rows: Array, points: int, matrix: Array) -> Array:
        gradients = rows[points:].reshape(matrix.shape[1], -1, rows.shape[1])
        turned = np.tensordot(matrix, gradients, axes=1).reshape(-1, rows.shape[1])
        return np.concatenate([rows[:points], turned])


class DrawnField(Gpis):
    """A field with sections; used like a :class:`Gpis`, whose kernel is that of the part in space.

    Attributes:
        sections: parts that are constant along a direction; none in a field that is made by :meth:`fit`.
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
        sections: tuple[Section, ...] = (),
    ) -> None:
        self.sections = sections
        super().__init__(contacts_m, normals, settings, observations, kernel, prior, noise_scale, factor)

    @classmethod
    def along_edges(cls, gpis: Gpis) -> Self:
        """The field of the same contacts, alike along the vertical and along the most common headings of walls.

        Its parameters are at a maximum of the marginal likelihood, of a selection of the contacts if there are many.

        Args:
            gpis: fitted in space, normals observed; the third axis is vertical.
        """
        count, start = len(gpis.contacts_m), Matern52(_AMPLITUDE_m**2, _LENGTH_m)
        sections = tuple(Section(plane, start) for plane in _planes(_heading_rad(gpis.normals)))
        seen, space = gpis.observations, Matern52(_SPACE_AMPLITUDE_m**2, _LENGTH_m)
        given = gpis.contacts_m, gpis.normals, gpis.settings, seen, space, gpis.prior, gpis.noise_scale
        field = cls(*given, sections=sections)
        if count <= _MOST_FOR_KERNEL:
            return field.optimise(max_iterations=_KERNEL_STEPS)
        some = np.linspace(0, count - 1, _MOST_FOR_KERNEL).astype(np.intp)
        return field.with_log_parameters(field.of_some(some).optimise(max_iterations=_KERNEL_STEPS).log_parameters)

    @property
    def log_parameters(self) -> Array:
        """Logarithms of amplitude and length in space, then of those of each section."""
        return np.concatenate([self.kernel.log_parameters, *(each.kernel.log_parameters for each in self.sections)])

    def with_log_parameters(self, log_parameters: Array) -> Self:
        """The same contacts and sections with other parameters and, if one more is given, another noise scale."""
        size, count = len(self.kernel.log_parameters), len(self.log_parameters)
        own, others = log_parameters[:size], np.reshape(log_parameters[size:count], (-1, 2))
        pairs = zip(self.sections, others, strict=True)
        sections = tuple(replace(each, kernel=each.kernel.with_log_parameters(found)) for each, found in pairs)
        noise_scale = float(np.exp(log_parameters[count])) if len(log_parameters) > count else self.noise_scale
        kernel, seen = self.kernel.with_log_parameters(own), self.observations
        given = self.contacts_m, self.normals, self.settings, seen, kernel, self.prior, noise_scale
        return type(self)(*given, sections=sections)

    def joint_covariance(self, points_m: Array) -> Array:
        """As of :class:`Gpis`."""
        points_m = np.asarray(points_m, dtype=float)
        prior = covariance(self.kernel, points_m, 0)
        for section in self.sections:
            prior += covariance(section.kernel, section.on(points_m), 0)
        return np.asarray(prior - self._factor.explained_covariance(self._cross_covariance(points_m)))

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
        given = contacts_m, normals, self.settings, observations, kernel, prior, noise_scale, factor
        return type(self)(*given, sections=self.sections)

    def _prior_covariance(self) -> Array:
        points_m, count = self.observations.points_m, self._gradient_count
        matrix = covariance(self.kernel, points_m, count)
        for section in self.sections:
            rows = section.rows_in_space(covariance(section.kernel, section.on(points_m), count), len(points_m))
            matrix += section.rows_in_space(rows.T, len(points_m))
        return matrix

    def _cross_covariance(self, queries: Array) -> Array:
        points_m, count = self.observations.points_m, self._gradient_count
        matrix = cross_covariance(self.kernel, queries, points_m, count)
        for section in self.sections:
            rows = cross_covariance(section.kernel, section.on(queries), section.on(points_m), count)
            matrix += section.rows_in_space(rows.T, len(points_m)).T
        return matrix

    def _kernel_traces(self, weights: Array) -> Array:
        points_m, count = self.observations.points_m, self._gradient_count
        traces = [log_parameter_traces(self.kernel, points_m, count, weights)]
        for section in self.sections:
            on_plane = section.rows_in_plane(section.rows_in_plane(weights, len(points_m)).T, len(points_m))
            traces.append(log_parameter_traces(section.kernel, section.on(points_m), count, on_plane))
        return np.concatenate(traces)

    def _extended_factor(self, observations: Observations) -> RowFactor | None:
        """None: the factor is computed again."""
        return None

    @cached_property
    def _posterior(self) -> _SectionedMean:  # type: ignore[override]
        points_m, space = self.observations.points_m, super()._posterior
        planar = tuple(
            PosteriorMean(each.kernel, ZeroMean(), each.on(points_m), space.on_values, each.on(space.on_gradients))
            for each in self.sections
        )
        return _SectionedMean(space, self.sections, planar)

    @property
    def _prior_variance(self) -> float:
        return self.kernel.amplitude + sum(section.kernel.amplitude for section in self.sections)

    def _bounds(self, noise: bool, longest_m: float) -> Array:
        limits = super()._bounds(noise, longest_m)
        size = len(self.kernel.log_parameters)
        amplitudes_m2 = np.square(_AMPLITUDE_BOUNDS_m)
        sections = [amplitudes_m2, (_LENGTH_BOUNDS_m[0], longest_m)] * len(self.sections)
        return np.array([amplitudes_m2, *limits[1:size], *sections, *limits[size:]])


@dataclass(frozen=True)
class _SectionedMean:
    """Sum of posterior means: of the part in space, and of sections in their planes."""

    space: PosteriorMean
    sections: tuple[Section, ...]
    planar: tuple[PosteriorMean, ...]

    def at(self, queries_m: Array, *, gradient: bool) -> tuple[Array, Array]:
        """See :meth:`PosteriorMean.at`."""
        mean, slope = self.space.at(queries_m, gradient=gradient)
        for section, part in zip(self.sections, self.planar, strict=True):
            added, change = part.at(section.on(queries_m), gradient=gradient)
            mean, slope = mean + added, slope + change @ section.plane
        return mean, slope


def _heading_rad(normals: Array) -> float:
    """The most common heading of walls with these normals, shape (n, 3), up to a quarter turn."""
    level = normals[:, 0] + 1j * normals[:, 1]
    walls = level[np.abs(level) > _SIDEWAYS]
    fourfold = np.sum(np.abs(walls) * np.exp(4j * np.angle(walls)))
    return float(np.angle(fourfold) / 4)


def _planes(heading_rad: float) -> tuple[Array, ...]:
    """Planes across the vertical and across two horizontal directions, each of shape (2, 3)."""
    cosine, sine = np.cos(heading_rad), np.sin(heading_rad)
    x, y, z = np.array([cosine, sine, 0.0]), np.array([-sine, cosine, 0.0]), np.array([0.0, 0.0, 1.0])
    return np.stack([x, y]), np.stack([y, z]), np.stack([z, x])
