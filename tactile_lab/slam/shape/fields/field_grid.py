"""A field tabulated on a regular grid, for evaluation at very many points (particle weighting, surface extraction)."""

from __future__ import annotations

from itertools import product
from typing import Protocol, Self, TypeAlias, TypeVar

import numpy as np
from numpy.typing import NDArray

from drivers.core.contacts import Array
from drivers.core.errors import ShapeError
from tactile_lab.slam.shape.fields.gpis import Gpis
from tactile_lab.slam.shape.fields.posterior import Prediction

Indices: TypeAlias = NDArray[np.intp]
Nodes = TypeVar("Nodes")

LARGEST_NODE_COUNT = 20_000_000
"""Larger grids would take gigabytes, and indicate a mistake in spacing or extent."""


class Field(Protocol):
    """Anything that predicts like a :class:`Gpis`."""

    def predict(self, points_m: Array, *, gradient: bool = False, variance: bool = False) -> Prediction:
        """The field at points of shape (q, d)."""


class SurfaceField(Field, Protocol):
    """A field whose zero level is a surface that contacts tell of."""

    @property
    def contacts_m(self) -> Array:
        """Shape (n, d)."""

    @property
    def sigma_inflation(self) -> float:
        """How many times larger than predicted the standard deviation of the surface is."""


class FieldGrid:
    """Values, gradients and variances of a field on a grid, with linear interpolation between the nodes.

    Beyond the grid the field is extrapolated as if everything there were outside: the border's value plus the distance
    to the border, with the border's gradient and variance.

    Attributes:
        lower_m: coordinates of the first node, shape (d,).
        spacing_m: distance of neighbouring nodes, the same along all axes.
        values_m: shape (n1, n2) or (n1, n2, n3).
    """

    def __init__(
        self,
        lower_m: Array,
        spacing_m: float,
        values_m: Array,
        gradients: Array | None = None,
        variances_m2: Array | None = None,
    ) -> None:
        self.lower_m, self.spacing_m, self.values_m = lower_m, spacing_m, values_m
        self._gradient_columns = None if gradients is None else list(np.ascontiguousarray(gradients.T))
        self._variances_m2 = variances_m2

    @classmethod
    def tabulate(
        cls,
        field: Field,
        lower_m: Array,
        upper_m: Array,
        spacing_m: float,
        *,
        gradient: bool = False,
        variance: bool = False,
        variance_step: int = 1,
    ) -> Self:
        """Evaluate a field on the grid from ``lower_m`` to at least ``upper_m`` (both of shape (d,)).

        ``variance_step`` is the factor by which the grid of the variances is coarser; these cost most and vary least,
        and are interpolated to the nodes.

        Raises:
            ShapeError: the grid would have more than :data:`LARGEST_NODE_COUNT` nodes.
        """
        lower_m = np.asarray(lower_m, dtype=float)
        shape, nodes = _nodes(lower_m, np.asarray(upper_m), spacing_m)
        found = field.predict(nodes, gradient=gradient, variance=variance and variance_step == 1)
        spread = found.variance_m2 if variance else None
        if variance and variance_step > 1:
            coarse = cls._of_variances(field, lower_m, nodes[-1], variance_step * spacing_m)
            spread = coarse.predict(nodes, variance=True).variance_m2
        return cls(lower_m, spacing_m, found.mean_m.reshape(shape), found.gradient if gradient else None, spread)

    @classmethod
    def _of_variances(cls, field: Field, lower_m: Array, upper_m: Array, spacing_m: float) -> Self:
        """Variances on a grid, in single precision where that is accurate enough."""
        shape, nodes = _nodes(lower_m, upper_m, spacing_m)
        if isinstance(field, Gpis):
            return cls(lower_m, spacing_m, np.zeros(shape), None, field.variance(nodes, rough=True))
        return cls(lower_m, spacing_m, np.zeros(shape), None, field.predict(nodes, variance=True).variance_m2)

    @classmethod
    def around(
        cls,
        gpis: Gpis,
        *,
        margin_m: float = 0.030,
        spacing_m: float = 0.002,
        gradient: bool = True,
        variance: bool = True,
        variance_step: int = 2,
    ) -> Self:
        """Tabulate a fitted field over its contacts and a margin around them; see :meth:`tabulate`."""
        lower_m, upper_m = gpis.contacts_m.min(axis=0) - margin_m, gpis.contacts_m.max(axis=0) + margin_m
        return cls.tabulate(
            gpis, lower_m, upper_m, spacing_m, gradient=gradient, variance=variance, variance_step=variance_step
        )

    def predict(self, points_m: Array, *, gradient: bool = False, variance: bool = False) -> Prediction:
        """Interpolate at points of shape (q, d).

        Raises:
            ShapeError: gradients or variances are requested, but the grid was tabulated without them.
        """
        corners, beyond_m = self._locate(np.asarray(points_m, dtype=float))
        mean = _interpolate(self.values_m.ravel(), corners) + beyond_m
        slope, spread = np.empty((0, self.values_m.ndim)), np.empty(0)
        if gradient:
            columns = _tabulate(self._gradient_columns, "gradients")
            slope = np.stack([_interpolate(column, corners) for column in columns], axis=1)
        if variance:
            spread = _interpolate(_tabulate(self._variances_m2, "variances"), corners)
        return Prediction(mean, slope, spread)

    @property
    def bytes_kept(self) -> int:
        """Size of its tables."""
        columns = [self.values_m, *(self._gradient_columns or [])]
        columns += [] if self._variances_m2 is None else [self._variances_m2]
        return sum(column.nbytes for column in columns)

    def _locate(self, points_m: Array) -> tuple[list[tuple[Indices, Array]], Array]:
        """Node index and weight of the corners of each point's cell, and the distance of outer points to the grid.

        Works axis by axis on contiguous columns, which is several times faster than on whole points.
        """
        first, beyond, shares = np.zeros(len(points_m), dtype=np.intp), np.zeros(len(points_m)), []
        for axis, count in enumerate(self.values_m.shape):
            place = (points_m[:, axis] - self.lower_m[axis]) * (1 / self.spacing_m)
            inside = np.clip(place, 0, count - 1)
            cell = np.minimum(inside.astype(np.intp), count - 2)
            beyond += (place - inside) ** 2
            first = first * count + cell
            shares.append((1 - inside + cell, inside - cell))
        corners = [(first + step, _product(shares, sides)) for sides, step in self._corner_steps()]
        return corners, self.spacing_m * np.sqrt(beyond)

    def _corner_steps(self) -> list[tuple[tuple[int, ...], int]]:
        """For each corner of a cell, its side along each axis and its memory offset from the first corner."""
        corners = list(product((0, 1), repeat=self.values_m.ndim))
        return [(sides, int(np.ravel_multi_index(sides, self.values_m.shape))) for sides in corners]


def _nodes(lower_m: Array, upper_m: Array, spacing_m: float) -> tuple[tuple[int, ...], Array]:
    """Number of nodes along each axis from ``lower_m`` to at least ``upper_m``, and all of them, shape (n, d)."""
    shape = tuple(np.maximum(np.ceil((upper_m - lower_m) / spacing_m - 1e-9).astype(int) + 1, 2).tolist())
    if np.prod(shape, dtype=float) > LARGEST_NODE_COUNT:
        raise ShapeError(
            f"a grid of {' x '.join(map(str, shape))} nodes is too large", hint="Choose a coarser resolution"
        )
    return shape, lower_m + spacing_m * np.moveaxis(np.indices(shape), 0, -1).reshape(-1, len(shape))


def _product(shares: list[tuple[Array, Array]], sides: tuple[int, ...]) -> Array:
    weight = shares[0][sides[0]]
    for share, side in zip(shares[1:], sides[1:], strict=True):
        weight = weight * share[side]
    return weight


def _interpolate(nodes: Array, corners: list[tuple[Indices, Array]]) -> Array:
    """Weighted sum over the corners of a field given at the nodes, shape (n,)."""
    return sum((nodes.take(index, mode="clip") * weight for index, weight in corners), np.zeros(1))


def _tabulate(nodes: Nodes | None, name: str) -> Nodes:
    if nodes is None:
        raise ShapeError(f"this grid was tabulated without {name}", hint=f"Tabulate it with {name[:-1]}=True")
    return nodes
