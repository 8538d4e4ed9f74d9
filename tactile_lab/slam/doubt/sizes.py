"""The outer size of a shape with its uncertainty, as somebody with a caliper would measure it.

A jaw of the caliper lies on a place that was touched, or on one that is a guess. Touched at both ends a size is as
certain as those places. Otherwise only the span of what was touched is known, and the size is the model's opinion.

A place's standard deviation is what is left at the best fit, in which a shift of both ends the same way is taken out:
the errors that are left at both make a size larger, or both make it smaller, and their standard deviations add up.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import ConvexHull

from drivers.core.contacts import Array
from tactile_lab.slam.doubt.status import Doubt
from tactile_lab.slam.shape.surfaces.surface import Contour, SurfaceMesh

SIDES = ("length", "width", "height")
"""The longer and the shorter side of the smallest rectangle around the shape seen from above, and its height."""

LARGEST_SIGMA_m = 0.014
"""Standard deviation of a size of a complete shape."""

_JAW_m = 0.0005
"""Points this close to the outermost one touch a caliper's jaw too; their standard deviations are averaged."""


@dataclass(frozen=True)
class Span:
    """A distance between two ends with its standard deviation, metres: the sum of those of both ends."""

    length_m: float
    sigma_m: float


@dataclass(frozen=True)
class Size:
    """One outer dimension of a shape.

    Attributes:
        whole: of all of it. An end that was touched anywhere is as certain as there, whatever its rim is.
        touched: between the outermost places of the shape that were touched; None if nothing was.
        is_guess: whether an end was touched nowhere.
    """

    whole: Span
    touched: Span | None
    is_guess: bool


def unknown_sizes(shape: Contour | SurfaceMesh | None, contacts_m: Array) -> list[Doubt]:
    """A doubt where an end of the shape is a guess: most of a surface may be known, and yet not how long it is.

    Args:
        shape: object frame, with its known part.
        contacts_m: those that the estimate uses, object frame, shape (n, d).
    """
    if shape is None:
        return []
    points_m = shape.points_m if isinstance(shape, Contour) else shape.vertices
    found = zip(SIDES, sizes(points_m, shape.sigma_m, shape.known, contacts_m), strict=False)
    unknown = [_in_words(name, size) for name, size in found if size.whole.sigma_m > LARGEST_SIGMA_m]
    if not unknown:
        return []
    return [Doubt("unknown-size", f"an end of it was not touched: {', '.join(unknown)}", grave=False)]


def _in_words(name: str, size: Size) -> str:
    told = f"{name} {1e3 * size.whole.length_m:.0f} ± {1e3 * size.whole.sigma_m:.0f} mm"
    if size.touched is None or not size.is_guess:
        return told
    return f"{told} (touched over {1e3 * size.touched.length_m:.0f} mm)"


def sizes(
    points_m: Array,
    sigma_m: Array | None = None,
    known: NDArray[np.bool_] | None = None,
    contacts_m: Array | None = None,
) -> Sequence[Size]:
    """Length, width and, of points in space, height.

    Args:
        points_m: of an outline, shape (n, 2), or a surface, shape (n, 3).
        sigma_m: their standard deviations, shape (n,); none by default.
        known: which of them the contacts tell of, shape (n,); all by default.
        contacts_m: in the same frame, shape (m, d): nothing beyond them was touched, however far they tell of a
            straight side; by default all that is known was touched.
    """
    sigma_m = np.zeros(len(points_m)) if sigma_m is None else sigma_m
    known = np.ones(len(points_m), dtype=bool) if known is None else known
    directions = np.eye(points_m.shape[1])
    directions[:2, :2] = _rectangle(points_m[:, :2])
    met_m = points_m[known] if contacts_m is None else contacts_m
    return [_size(points_m @ each, sigma_m, known, met_m @ each) for each in directions]


def _rectangle(points_m: Array) -> tuple[Array, Array]:
    """Directions of the longer and the shorter side of the smallest rectangle around points of shape (n, 2).

    One of its sides lies along a side of their convex hull.
    """
    hull = points_m[ConvexHull(points_m).vertices]
    sides = np.roll(hull, -1, axis=0) - hull
    along = sides / np.linalg.norm(sides, axis=1, keepdims=True)
    across = np.column_stack([-along[:, 1], along[:, 0]])
    spans = np.ptp(hull @ along.T, axis=0), np.ptp(hull @ across.T, axis=0)
    best = int(np.argmin(spans[0] * spans[1]))
    longer_first = spans[0][best] >= spans[1][best]
    return (along[best], across[best]) if longer_first else (across[best], along[best])


def _size(places_m: Array, sigma_m: Array, known: NDArray[np.bool_], met_m: Array) -> Size:
    jaws = _jaws(places_m)
    felt = [jaw & known for jaw in jaws]
    ends = [touched if touched.any() else jaw for touched, jaw in zip(felt, jaws, strict=True)]
    return Size(
        _span(places_m, sigma_m, ends), _touched(places_m, sigma_m, known, met_m), not all(jaw.any() for jaw in felt)
    )


def _touched(places_m: Array, sigma_m: Array, known: NDArray[np.bool_], met_m: Array) -> Span | None:
    """Between the outermost places that are known and lie between contacts."""
    if not len(met_m):
        return None
    between = known & (places_m >= met_m.min() - _JAW_m) & (places_m <= met_m.max() + _JAW_m)
    return _span(places_m[between], sigma_m[between], _jaws(places_m[between])) if between.any() else None


def _jaws(places_m: Array) -> list[NDArray[np.bool_]]:
    """Which places along a line each jaw of the caliper touches."""
    return [places_m <= places_m.min() + _JAW_m, places_m >= places_m.max() - _JAW_m]


def _span(places_m: Array, sigma_m: Array, ends: list[NDArray[np.bool_]]) -> Span:
    return Span(float(np.ptp(places_m)), float(sum(sigma_m[end].mean() for end in ends)))
