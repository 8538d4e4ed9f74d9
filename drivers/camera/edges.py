"""Corners of a black square from its edges, to a few hundredths of a pixel, and the blur of each edge.

OpenCV's corner refinement finds the point to which all gradients around it are orthogonal. At the convex corner of a
blurred square this point lies inside the true corner (by a quarter pixel on each axis at the rig's resolution), so
squares look too small. Blur does not move a straight edge. Therefore lines are fitted to the edges here, and
intersected. The blurred outer end of the white border reaches the edge as well; :mod:`drivers.camera.profiles` takes
care that it does not move the edge.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from drivers.camera.frames import Image, SeenMarker
from drivers.camera.opencv import cv2
from drivers.camera.profiles import Profiles, fit_profiles
from drivers.core.contacts import Array

_ALONG = np.linspace(0.12, 0.88, 28)  # the part of a side in which its edge is measured; blur rounds the ends
_STEPS = 25  # samples across the edge
_INSIDE, _OUTSIDE = -1.7, 1.9  # range across the edge, in half modules: into the black module, and beyond the white
_REACH_blurs = 2.5  # farther away the blurred edge has reached its final levels
_SMALLEST_REACH_px, _LARGEST_REACH_px = 1.5, 6.0
_PASSES = 2
_FARTHEST_px = 5.0
"""A corner that moved this far from the initial guess, or by a module, belongs to another edge."""
_SCATTER_px = 0.05
_BOWED_px = 90.0
"""Lens distortion bends shorter edges by less than their noise (for up to a tenth of barrel distortion)."""


def refine_square(image: Image, corners_px: Array, modules: int) -> SeenMarker:
    """Refine the corners (4, 2) of a dark square on white from a guess within a few pixels, clockwise in the picture.

    This takes several passes: noise pulls an edge towards the place where it was searched, and the search range depends
    on the blur. If an edge cannot be found, the guess is returned with an infinite blur.

    Args:
        image: grey levels.
        corners_px: the guess.
        modules: number of modules along a side of the marker's black square; at least half a module of white surrounds
            it.
    """
    lost = SeenMarker(corners_px, np.inf)
    farthest_px = min(_FARTHEST_px, float(np.ptp(corners_px, axis=0).max()) / modules)
    found, blur_px = corners_px, None
    for _ in range(_PASSES):
        sides = _Sides.of(found, modules)
        middles, across_px = sides.middles, sides.across_px(blur_px)
        levels = _levels(image, middles, sides.outward, across_px)
        profiles = fit_profiles(across_px, levels.mean(axis=1), sides.half_module_px, blur_px)
        corners = None if profiles is None else _corners(sides, profiles, levels)
        if profiles is None or corners is None or np.abs(corners - corners_px).max() > farthest_px:
            return lost
        found, blur_px = corners, profiles.blur_px
    return lost if blur_px is None else SeenMarker(found, float(blur_px.max()))


@dataclass(frozen=True, eq=False)
class _Sides:
    """The four sides of a square: from each corner to the next.

    Attributes:
        corners_px: start points, shape (4, 2).
        along_px: vectors from start to end, shape (4, 2).
        outward: outward unit normals, shape (4, 2).
        half_module_px: width of the white border at the middle of each side, shape (4,).
    """

    corners_px: Array
    along_px: Array
    outward: Array
    half_module_px: Array

    @staticmethod
    def of(corners_px: Array, modules: int) -> _Sides:
        """The sides of a square with corners (4, 2); the white border's width follows from the square's homography."""
        along_px = np.roll(corners_px, -1, axis=0) - corners_px
        outward = np.stack([along_px[:, 1], -along_px[:, 0]], axis=1)
        outward /= np.linalg.norm(outward, axis=1, keepdims=True)
        square = np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]], np.float32)
        mapping = cv2.getPerspectiveTransform(square, corners_px.astype(np.float32))
        far = 1.0 + 1.0 / modules
        ends = np.array([[[0.0, -far], [far, 0.0], [0.0, far], [-far, 0.0]]])
        half_module_px = np.sum((cv2.perspectiveTransform(ends, mapping)[0] - corners_px) * outward, axis=1)
        return _Sides(corners_px, along_px, outward, np.maximum(half_module_px, 0.5))

    @property
    def lengths_px(self) -> Array:
        """Shape (4,)."""
        return np.asarray(np.linalg.norm(self.along_px, axis=1))

    @property
    def middles(self) -> Array:
        """Points at which the edges are measured, shape (4, places, 2)."""
        return np.asarray(self.corners_px[:, None] + _ALONG[:, None] * self.along_px[:, None])

    def across_px(self, blur_px: Array | None) -> Array:
        """Distances outward at which grey levels are sampled, shape (4, n); ``blur_px`` (4,) if it is known."""
        reach = _LARGEST_REACH_px if blur_px is None else _REACH_blurs * blur_px
        reach = np.clip(reach, _SMALLEST_REACH_px, _LARGEST_REACH_px)
        inside = np.clip(_INSIDE * self.half_module_px, -reach, -_SMALLEST_REACH_px)
        outside = np.clip(_OUTSIDE * self.half_module_px, _SMALLEST_REACH_px, reach)
        return np.linspace(inside, outside, _STEPS, axis=1)


def _corners(sides: _Sides, profiles: Profiles, levels: Array) -> Array | None:
    """The corners (4, 2) at which the edges intersect; None if too little of an edge is visible."""
    offsets_px, contrast = profiles.places(levels)
    is_edge = contrast > 0.5 * np.median(contrast, axis=1, keepdims=True)
    if np.any(is_edge.sum(axis=1) < len(_ALONG) // 2):
        return None
    bows = _bows(offsets_px, is_edge, sides.lengths_px > _BOWED_px)
    unit = sides.along_px / sides.lengths_px[:, None]
    begin, end = (_tangents(bows, share, sides, unit) for share in (0.0, 1.0))
    return _crossings(begin, (np.roll(end[0], 1, axis=0), np.roll(end[1], 1, axis=0)))


def _bows(offsets_px: Array, is_edge: NDArray[np.bool_], is_long: NDArray[np.bool_]) -> Array:
    """Parabolas through the offsets along the sides, c0 + c1 u + c2 u^2 with u from 0 to 1 along the side, shape (4,
    3).

    Offsets beyond three times the median are ignored; c2 is zero for short sides.
    """
    powers = _ALONG[:, None] ** np.arange(3)
    powers = powers * np.stack([np.ones(4), np.ones(4), is_long], axis=1)[:, None]
    unused = np.eye(3) * np.stack([np.zeros(4), np.zeros(4), ~is_long], axis=1)[:, None]
    weights = is_edge.astype(float)
    for _ in range(2):
        weighted = powers.swapaxes(1, 2) * weights[:, None]
        bows = np.linalg.solve(weighted @ powers + unused, weighted @ offsets_px[..., None])
        away = np.abs(offsets_px - (powers @ bows)[..., 0])
        middle = np.nanmedian(np.where(is_edge, away, np.nan), axis=1, keepdims=True)
        weights = (is_edge & (away <= np.maximum(3.0 * middle, _SCATTER_px))).astype(float)
    return np.asarray(bows[..., 0])


def _tangents(bows: Array, share: float, sides: _Sides, unit: Array) -> tuple[Array, Array]:
    """Points and directions, (4, 2) each, of the edges at one end of the sides."""
    aside = bows @ [1.0, share, share**2]
    slope = bows @ [0.0, 1.0, 2.0 * share] / sides.lengths_px
    points = sides.corners_px + share * sides.along_px + aside[:, None] * sides.outward
    return points, unit + slope[:, None] * sides.outward


def _crossings(one: tuple[Array, Array], two: tuple[Array, Array]) -> Array:
    """Intersections of lines that are given by points and directions (4, 2), shape (4, 2)."""
    (p, u), (q, v) = one, two
    along = np.linalg.solve(np.stack([u, -v], axis=2), (q - p)[..., None])[:, 0]
    return np.asarray(p + along * u)


def _levels(image: Image, middles: Array, outward: Array, across_px: Array) -> Array:
    """Grey levels along lines across the edges, shape (4, places along, places across)."""
    points = middles[:, :, None] + across_px[:, None, :, None] * outward[:, None, None]
    maps = points.reshape(-1, _STEPS, 2).astype(np.float32)
    levels = cv2.remap(image, maps[..., 0], maps[..., 1], cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)
    return np.asarray(levels, float).reshape(4, -1, _STEPS)
