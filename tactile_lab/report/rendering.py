"""Shaded pictures of a coloured mesh, for paper and for pages without scripts."""

from __future__ import annotations

import base64
import struct
import zlib
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from drivers.core.contacts import Array

SUPERSAMPLING = 2
_LIGHT = np.array([-0.35, 0.55, 0.76])
_AMBIENT = 0.45
_STRIPES_px, _STRIPE_px, _IN_STRIPES = 10, 4, 0.68
"""Period and width of the stripes over what is a guess, and how much of the light is left in them."""
_PNG_UP, _PNG_RGBA = 2, 6


@dataclass(frozen=True)
class View:
    """A viewing direction: azimuth about z from +x and elevation above the table, radians."""

    name: str
    azimuth_rad: float
    elevation_rad: float

    def camera_R_object(self) -> Array:
        """Rotation of shape (3, 3) into camera axes: x to the right, y up, z towards the eye."""
        ca, sa = np.cos(self.azimuth_rad), np.sin(self.azimuth_rad)
        ce, se = np.cos(self.elevation_rad), np.sin(self.elevation_rad)
        return np.array([[-sa, ca, 0.0], [-se * ca, -se * sa, ce], [ce * ca, ce * sa, se]])


VIEWS = (
    View("from the front, right", np.radians(-55), np.radians(28)),
    View("from the back, left", np.radians(125), np.radians(28)),
    View("from above", np.radians(-90), np.radians(89.9)),
)


def render(
    vertices_m: Array,
    faces: NDArray[np.int64],
    vertex_rgb: NDArray[np.uint8],
    vertex_is_guess: NDArray[np.bool_],
    view: View,
    size_px: int,
) -> NDArray[np.uint8]:
    """A picture of shape (size, size, 4), red green blue alpha, transparent outside the mesh.

    Faces are painted from the far to the near ones (orthographic view), each with its mean colour under one
    soft light; the picture is drawn larger and averaged down. Guesses are striped, so that grey paper shows them.
    """
    canvas = size_px * SUPERSAMPLING
    seen = (vertices_m - _centre(vertices_m)) @ view.camera_R_object().T
    radius = float(np.linalg.norm(vertices_m - _centre(vertices_m), axis=1).max())
    pixels = canvas / 2 + seen[:, :2] * [1.0, -1.0] * (0.47 * canvas / radius)
    corners = seen[faces]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    normals /= np.linalg.norm(normals, axis=1, keepdims=True).clip(1e-30)
    front = np.flatnonzero(normals[:, 2] > 0)
    order = front[np.argsort(corners[front, :, 2].mean(axis=1), kind="stable")]
    shade = _AMBIENT + (1 - _AMBIENT) * np.clip(normals[order] @ (_LIGHT / np.linalg.norm(_LIGHT)), 0.0, 1.0)
    colours = vertex_rgb[faces[order]].astype(float).mean(axis=1) * shade[:, None]
    is_striped = np.asarray(vertex_is_guess[faces[order]].any(axis=1))
    return _paint(pixels[faces[order]], colours, is_striped, canvas, size_px)


def _paint(
    triangles_px: Array, colours: Array, is_striped: NDArray[np.bool_], canvas: int, size_px: int
) -> NDArray[np.uint8]:
    """Triangles of shape (n, 3, 2) in colours of shape (n, 3), each over those before it."""
    picture = np.zeros((canvas * canvas, 4), np.uint8)
    triangle, row, left, count = _spans(triangles_px, canvas)
    run_start = row * canvas + left - (np.cumsum(count) - count)
    pixels = np.repeat(run_start, count) + np.arange(count.sum())
    opaque = np.column_stack([np.rint(colours), np.full(len(colours), 255.0)]).astype(np.uint8)
    painted = np.repeat(opaque[triangle], count, axis=0)
    across = (pixels // canvas + pixels % canvas) % (SUPERSAMPLING * _STRIPES_px)
    in_stripe = np.repeat(is_striped[triangle], count) & (across < SUPERSAMPLING * _STRIPE_px)
    painted[in_stripe, :3] = (_IN_STRIPES * painted[in_stripe, :3]).astype(np.uint8)
    picture[pixels] = painted
    return _shrink(picture.reshape(canvas, canvas, 4), size_px)


def _spans(
    triangles_px: Array, canvas: int
) -> tuple[NDArray[np.intp], NDArray[np.intp], NDArray[np.intp], NDArray[np.intp]]:
    """The runs of pixels whose middles lie in a triangle: its index, row, first column and length, shape (m,) each."""
    y = triangles_px[:, :, 1]
    first, last = _pixels_between(y.min(axis=1), y.max(axis=1), canvas)
    rows = np.maximum(last - first + 1, 0)
    triangle = np.repeat(np.arange(len(rows)), rows)
    row = np.repeat(first - (np.cumsum(rows) - rows), rows) + np.arange(rows.sum())
    left, right = _pixels_between(*_widths(triangles_px[triangle], row + 0.5), canvas)
    return triangle, row, left, np.maximum(right - left + 1, 0)


def _widths(triangles_px: Array, y: Array) -> tuple[Array, Array]:
    """Where each of triangles (m, 3, 2) begins and ends along a line of its own y, shape (m,)."""
    begin, end = triangles_px, np.roll(triangles_px, -1, axis=1)
    over, under = begin[:, :, 1] - y[:, None], end[:, :, 1] - y[:, None]
    crossed = (np.minimum(over, under) <= 0.0) & (np.maximum(over, under) >= 0.0) & (over != under)
    share = over / np.where(crossed, over - under, 1.0)
    x = begin[:, :, 0] + share * (end[:, :, 0] - begin[:, :, 0])
    return np.where(crossed, x, np.inf).min(axis=1), np.where(crossed, x, -np.inf).max(axis=1)


def _pixels_between(low: Array, high: Array, canvas: int) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """The first and the last pixel whose middle lies between two places."""
    first, last = np.ceil(low - 0.5), np.floor(high - 0.5)
    return np.clip(first, 0, canvas).astype(np.intp), np.clip(last, -1, canvas - 1).astype(np.intp)


def _shrink(picture: NDArray[np.uint8], size_px: int) -> NDArray[np.uint8]:
    """Average pixels with colours weighted by their cover, so that edges do not darken."""
    alpha = picture[..., 3:].astype(np.float32) / 255.0
    weighted = np.concatenate([picture[..., :3] * alpha, alpha], axis=2)
    small = weighted.reshape(size_px, SUPERSAMPLING, size_px, SUPERSAMPLING, 4).mean(axis=(1, 3))
    colours = small[..., :3] / np.maximum(small[..., 3:], 1e-6)
    return np.asarray(np.rint(np.concatenate([colours, small[..., 3:] * 255.0], axis=2)), dtype=np.uint8)


def png_data_uri(picture: NDArray[np.uint8]) -> str:
    """A picture of shape (height, width, 4), red green blue alpha, as a ``data:`` URL inside the page."""
    return "data:image/png;base64," + base64.b64encode(_png(picture)).decode("ascii")


def _png(picture: NDArray[np.uint8]) -> bytes:
    """Every line is written as what it adds to the one above, which packs well."""
    height, width, _ = picture.shape
    lines = np.diff(picture, axis=0, prepend=np.zeros_like(picture[:1])).reshape(height, -1)
    filtered = np.column_stack([np.full(height, _PNG_UP, np.uint8), lines])
    head = struct.pack(">IIBBBBB", width, height, 8, _PNG_RGBA, 0, 0, 0)
    chunks = ((b"IHDR", head), (b"IDAT", zlib.compress(filtered.tobytes(), 9)), (b"IEND", b""))
    return b"\x89PNG\r\n\x1a\n" + b"".join(map(_chunk, *zip(*chunks, strict=True)))


def _chunk(kind: bytes, data: bytes) -> bytes:
    return struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))


def _centre(vertices_m: Array) -> Array:
    return np.asarray((vertices_m.min(axis=0) + vertices_m.max(axis=0)) / 2)


def views(
    vertices_m: Array,
    faces: NDArray[np.int64],
    vertex_rgb: NDArray[np.uint8],
    vertex_is_guess: NDArray[np.bool_],
    size_px: int,
) -> Sequence[str]:
    """The pictures of all :data:`VIEWS` as ``data:`` URLs."""
    return [png_data_uri(render(vertices_m, faces, vertex_rgb, vertex_is_guess, view, size_px)) for view in VIEWS]
