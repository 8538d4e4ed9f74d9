"""The data of the interactive surface view (``viewer.js``): arrays as base64 inside the page."""

from __future__ import annotations

import base64
import json

import numpy as np
import trimesh
from numpy.typing import NDArray

from drivers.core.contacts import Array
from tactile_lab.colours import viridis
from tactile_lab.report.content import Faces, ReportContent, Surface

NORMAL_LENGTH_m = 0.008
SHARP_EDGE_rad = np.radians(20.0)
TRUTH_SECTIONS = 5
"""Number of horizontal sections of the true mesh, so that round objects are visible too."""


def viewer_data(content: ReportContent, surface: Surface, sigma_high_mm: float) -> str:
    """The view's data as one JSON text that is safe inside a script element."""
    contacts = content.placed_contacts()
    points = np.concatenate([np.zeros((0, 3)), *(grasp.points_m for grasp in contacts)])
    normals = np.concatenate([np.zeros((0, 3)), *(grasp.normals for grasp in contacts)])
    per_grasp = np.zeros(len(content.results.contacts), dtype=int)
    for grasp in contacts:
        per_grasp[grasp.grasp] = len(grasp.points_m)
    everything = np.concatenate([surface.vertices_m, points])
    centre = (everything.min(axis=0) + everything.max(axis=0)) / 2
    smooth = surface.normals if surface.normals is not None else np.zeros((0, 3))
    data = {
        "vertices": _floats(surface.vertices_m),
        "normals": _floats(smooth),
        "colours": _base64(viridis(surface.sigma_m * 1e3 / sigma_high_mm).tobytes()),
        "faces": _base64(np.ascontiguousarray(surface.faces, dtype="<u4").tobytes()),
        "contacts": _floats(points),
        "contact_normals": _floats(np.stack([points, points + NORMAL_LENGTH_m * normals], axis=1).reshape(-1, 3)),
        "contact_counts": np.cumsum(per_grasp).tolist(),
        "truth": _floats(truth_lines(*mesh) if (mesh := content.truth_mesh()) else np.zeros((0, 3))),
        "centre": [round(float(value), 6) for value in centre],
        "radius_m": round(float(np.linalg.norm(everything - centre, axis=1).max()), 6),
    }
    return json.dumps(data, separators=(",", ":"))


def truth_lines(vertices_m: Array, faces: Faces) -> Array:
    """The true mesh as line segments, end points in pairs, shape (2n, 3): sharp edges and horizontal sections."""
    mesh = trimesh.Trimesh(vertices_m, faces, process=False)
    sharp = mesh.face_adjacency_edges[mesh.face_adjacency_angles > SHARP_EDGE_rad]
    low, high = mesh.bounds[:, 2]
    heights = np.linspace(low, high, TRUTH_SECTIONS + 2)[1:-1]
    sections = [_section(mesh, float(height)) for height in heights]
    return np.concatenate([mesh.vertices[sharp].reshape(-1, 3), *sections])


def _section(mesh: trimesh.Trimesh, height_m: float) -> Array:
    plane = {"plane_normal": [0.0, 0.0, 1.0], "plane_origin": [0.0, 0.0, height_m]}
    lines = trimesh.intersections.mesh_plane(mesh, **plane)  # type: ignore[no-untyped-call]
    return np.asarray(lines, dtype=float).reshape(-1, 3)


def _floats(values: Array) -> str:
    return _base64(np.ascontiguousarray(values, dtype="<f4").tobytes())


def _base64(data: bytes) -> str:
    return base64.b64encode(data).decode("ascii")


def surface_colours(surface: Surface, sigma_high_mm: float) -> NDArray[np.uint8]:
    """The colour of every vertex, shape (n, 3), 0 to 255."""
    return viridis(surface.sigma_m * 1e3 / sigma_high_mm)
