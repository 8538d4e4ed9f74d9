"""Shaded pictures of a coloured mesh, for paper and for pages without scripts."""

from __future__ import annotations

import base64
from collections.abc import Sequence
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from drivers.core.contacts import Array

SUPERSAMPLING = 2
_LIGHT = np.array([-0.35, 0.55, 0.76])
_AMBIENT = 0.45


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
    vertices_m: Array, faces: NDArray[np.int64], vertex_rgb: NDArray[np.uint8], view: View, size_px: int
) -> NDArray[np.uint8]:
    """A picture of shape (size, size, 4), blue green red alpha, transparent outside the mesh.

    Faces are painted from the far to the near ones (orthographic view), each with its mean colour under one
    soft light; the picture is drawn larger and averaged down.
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
    colours = vertex_rgb[faces[order]].astype(float).mean(axis=1)[:, ::-1] * shade[:, None]
    return _paint(pixels[faces[order]], colours, canvas, size_px)


def _paint(triangles_px: Array, colours_bgr: Array, canvas: int, size_px: int) -> NDArray[np.uint8]:
    picture = np.zeros((canvas, canvas, 4), np.uint8)
    fractional_bits = 4
    corners = np.rint(triangles_px * 2**fractional_bits).astype(np.int32)
    for triangle, colour in zip(corners, colours_bgr, strict=True):
        cv2.fillConvexPoly(picture, triangle, (*colour.tolist(), 255.0), cv2.LINE_8, fractional_bits)
    return _shrink(picture, size_px)


def _shrink(picture: NDArray[np.uint8], size_px: int) -> NDArray[np.uint8]:
    """Average pixels with colours weighted by their cover, so that edges do not darken."""
    alpha = picture[..., 3:].astype(np.float32) / 255.0
    weighted = np.concatenate([picture[..., :3] * alpha, alpha], axis=2)
    small = cv2.resize(weighted, (size_px, size_px), interpolation=cv2.INTER_AREA)
    colours = small[..., :3] / np.maximum(small[..., 3:], 1e-6)
    return np.asarray(np.rint(np.concatenate([colours, small[..., 3:] * 255.0], axis=2)), dtype=np.uint8)


def png_data_uri(picture: NDArray[np.uint8]) -> str:
    """A picture as a ``data:`` URL inside the page."""
    _, encoded = cv2.imencode(".png", picture)
    return "data:image/png;base64," + base64.b64encode(encoded.tobytes()).decode("ascii")


def _centre(vertices_m: Array) -> Array:
    return np.asarray((vertices_m.min(axis=0) + vertices_m.max(axis=0)) / 2)


def views(vertices_m: Array, faces: NDArray[np.int64], vertex_rgb: NDArray[np.uint8], size_px: int) -> Sequence[str]:
    """The pictures of all :data:`VIEWS` as ``data:`` URLs."""
    return [png_data_uri(render(vertices_m, faces, vertex_rgb, view, size_px)) for view in VIEWS]
