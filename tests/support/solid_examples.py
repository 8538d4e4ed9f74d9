"""Contacts on known solids that stand on a table, where a hand can reach: not on the underside."""

from __future__ import annotations

import numpy as np
import trimesh

from drivers.core.contacts import Array
from tactile_lab.slam.shape.fields.gpis import Gpis
from tactile_lab.slam.shape.surfaces.sampling import sample_mesh_with_normals
from tests.support.shape_examples import NORMAL_SIGMA_rad, POINT_SIGMA_m, noisy


def box_mesh() -> trimesh.Trimesh:
    """120 x 60 x 60 mm, with its underside at height 0."""
    return _on_table(trimesh.creation.box((0.12, 0.06, 0.06)))


def l_block_mesh() -> trimesh.Trimesh:
    """Arms of 100 and 80 mm, 40 mm wide and 50 mm high."""
    outline = np.array([[0, 0], [100, 0], [100, 40], [40, 40], [40, 80], [0, 80]]) / 1000 - [0.04, 0.032]
    lid = np.array([[0, 1, 2], [0, 2, 3], [0, 3, 4], [0, 4, 5]])
    sides = [face for i in range(6) for face in _wall(i, (i + 1) % 6, 6)]
    vertices = np.vstack([np.column_stack([outline, np.full(6, height)]) for height in (0.0, 0.05)])
    return trimesh.Trimesh(vertices, np.vstack([lid[:, ::-1], lid + 6, sides]))


def ellipsoid_mesh() -> trimesh.Trimesh:
    mesh = trimesh.creation.icosphere(subdivisions=4)
    mesh.apply_scale([0.06, 0.04, 0.03])
    return _on_table(mesh)


def cylinder_mesh() -> trimesh.Trimesh:
    return _on_table(trimesh.creation.cylinder(radius=0.035, height=0.09, sections=96))


def cushion_mesh() -> trimesh.Trimesh:
    """A carton of 60 x 45 x 140 mm, standing, with round edges and sides that bulge by up to 4 mm."""
    angles = np.linspace(0.0, 2 * np.pi, 48, endpoint=False)
    reach = (np.abs(np.cos(angles)) ** 5 + np.abs(np.sin(angles)) ** 5) ** (-1 / 5)
    outline = reach[:, None] * np.column_stack([0.030 * np.cos(angles), 0.0225 * np.sin(angles)])
    heights = np.linspace(0.0, 0.14, 12)
    sizes = 1 - 0.15 * (heights / 0.07 - 1) ** 2
    corners = [
        np.column_stack([size * outline, np.full(48, height)]) for size, height in zip(sizes, heights, strict=True)
    ]
    hull: trimesh.Trimesh = trimesh.convex.convex_hull(np.vstack(corners))
    return _on_table(hull)


def contacts_on(mesh: trimesh.Trimesh, count: int, seed: int, *, noise: bool = True) -> tuple[Array, Array]:
    """Contacts spread by area over all but the underside."""
    points, normals = sample_mesh_with_normals(mesh, 4 * count, seed)
    order = np.random.default_rng(seed).permutation(4 * count)
    chosen = [k for k in order if normals[k, 2] > -0.9][:count]
    return noisy(points[chosen], normals[chosen], seed) if noise else (points[chosen], normals[chosen])


def field_on(mesh: trimesh.Trimesh, count: int, seed: int) -> Gpis:
    points, normals = contacts_on(mesh, count, seed)
    return Gpis.fit(points, normals, POINT_SIGMA_m, NORMAL_SIGMA_rad).optimise(max_iterations=10)


def _wall(here: int, following: int, count: int) -> list[list[int]]:
    return [[here, following, following + count], [here, following + count, here + count]]


def _on_table(mesh: trimesh.Trimesh) -> trimesh.Trimesh:
    mesh.apply_translation([0.0, 0.0, -mesh.bounds[0, 2]])
    return mesh
