"""Solids for the experiments: those of the simulated rig's catalogue, additional ones, and scanned objects.

All meshes are watertight, in metres, in the object's own frame: z up as it stands, origin as its builder states.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Mapping
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np
import trimesh

from drivers.core.contacts import Array
from drivers.core.errors import ConfigurationError
from drivers.simulation.mesh_object import load_truth_mesh
from drivers.simulation.objects import CATALOGUE, object_model
from tactile_lab.experiments.data.household import HOUSEHOLD, blend, capped_cylinder, surface_of, turned
from tactile_lab.experiments.data.ray_casting import first_hits
from tactile_lab.slam.shape.surfaces.sampling import nearest_on_mesh

DATA_VARIABLE = "TACTILE_LAB_DATA"
"""Environment variable: the folder with recorded data, among them ``ycb_meshes``."""

YCB_PREFIX = "ycb:"
YCB_NAMES = ("cracker_box", "mug", "mustard_bottle", "tomato_soup_can")
MORE_YCB_NAMES = ("foam_brick", "potted_meat_can", "sugar_box")
"""Scans that are used only in the experiments on everyday things."""


class Solid:
    """A watertight mesh with ray casting.

    Attributes:
        name: name of the object.
        mesh: its surface in its own frame.
    """

    def __init__(self, name: str, mesh: trimesh.Trimesh) -> None:
        self.name, self.mesh = name, mesh
        self._corners = np.ascontiguousarray(mesh.triangles, dtype=float)
        self._normals = np.asarray(mesh.face_normals, dtype=float)

    @property
    def foot_m(self) -> float:
        """Height of the lowest point in the object's frame, usually negative."""
        return float(self.mesh.bounds[0, 2])

    @property
    def height_m(self) -> float:
        """From the lowest to the highest point."""
        return float(self.mesh.bounds[1, 2] - self.mesh.bounds[0, 2])

    def touch(self, starts_m: Array, ways: Array, longest_m: float) -> list[tuple[Array, Array] | None]:
        """For each ray (start points and unit directions, shape (n, 3)) the first intersection and the outward normal
        there.
        """
        distances_m, faces = first_hits(self._corners, starts_m, ways, longest_m)
        return [
            None if face < 0 else (start + distance * way, self._normals[face])
            for start, way, distance, face in zip(starts_m, ways, distances_m, faces, strict=True)
        ]

    def nearest(self, points_m: Array) -> tuple[Array, Array]:
        """For points of shape (n, 3): the distance to the surface, shape (n,), and the nearest point on it."""
        return nearest_on_mesh(points_m, self.mesh)


@lru_cache(maxsize=32)
def solid(name: str) -> Solid:
    """The solid named ``name``: one of :data:`SOLIDS`, of the rig's catalogue, or ``ycb:<name>``.

    Raises:
        ConfigurationError: there is no such solid, or the scanned meshes are not on this machine.
        ShapeError: the mesh file cannot be used.
    """
    if name.startswith(YCB_PREFIX):
        return Solid(name, load_truth_mesh(str(ycb_path(name.removeprefix(YCB_PREFIX)))))
    if name in SOLIDS:
        return Solid(name, SOLIDS[name]())
    if name in CATALOGUE:
        return Solid(name, object_model(name).mesh)
    known = ", ".join([*SOLIDS, *CATALOGUE, *(YCB_PREFIX + ycb for ycb in (*YCB_NAMES, *MORE_YCB_NAMES))])
    raise ConfigurationError(f"there is no solid {name!r}", where="shape", hint=f"Available solids: {known}")


def ycb_path(name: str) -> Path:
    """The file of a scanned object.

    Raises:
        ConfigurationError: the folder is not set, or does not contain the file.
    """
    folder = os.environ.get(DATA_VARIABLE)
    if not folder:
        hint = f"Set {DATA_VARIABLE} to the folder that contains ycb_meshes"
        raise ConfigurationError(f"the mesh of {YCB_PREFIX}{name} is missing", where=DATA_VARIABLE, hint=hint)
    path = Path(folder) / "ycb_meshes" / f"ycb_{name}.ply"
    if not path.is_file():
        raise ConfigurationError(
            f"no mesh {path.name}", where=str(path.parent), hint="Copy the scans of the YCB set there"
        )
    return path


def _ellipsoid() -> trimesh.Trimesh:
    """Semi-axes 60, 40 and 30 mm, lying."""
    mesh: trimesh.Trimesh = trimesh.creation.icosphere(subdivisions=5)
    mesh.apply_scale([0.060, 0.040, 0.030])  # type: ignore[no-untyped-call]
    return mesh


def _mug() -> trimesh.Trimesh:
    """A filled mug: a cylinder of 76 mm diameter and 96 mm height, and a ring 16 mm thick as a handle towards +x."""

    def distance(x: Any, y: Any, z: Any) -> Any:
        body = capped_cylinder(np.hypot(x, y), z, radius_m=0.038, half_length_m=0.048)
        handle = np.hypot(np.hypot(x - 0.044, z) - 0.028, y) - 0.008
        return blend(body, handle, 0.006)

    return surface_of(distance, (-0.042, -0.042, -0.052), (0.086, 0.043, 0.053))


def _ring() -> trimesh.Trimesh:
    """Lying: 100 mm wide outside and 60 mm inside, 30 mm high, its edges rounded by 5 mm."""

    def distance(x: Any, y: Any, z: Any) -> Any:
        across = capped_cylinder(np.abs(np.hypot(x, y) - 0.040), z - 0.015, radius_m=0.005, half_length_m=0.010)
        return across - 0.005

    return surface_of(distance, (-0.053, -0.053, -0.003), (0.054, 0.054, 0.034))


def _half_cylinder() -> trimesh.Trimesh:
    """Lying on its flat face: radius 40 mm, length 100 mm along y."""
    angles = np.linspace(0.0, np.pi, 49)
    section = 0.040 * np.column_stack([np.cos(angles), np.sin(angles)])
    corners = [(x, y, z) for y in (-0.050, 0.050) for x, z in section]
    mesh: trimesh.Trimesh = trimesh.convex.convex_hull(np.array(corners))
    return mesh


def _can() -> trimesh.Trimesh:
    """Standing: 66 mm wide and 115 mm high, narrower at the foot and at the lid, which is set in by 4 mm."""
    radii = [0, 22, 25, 33, 33, 27, 27, 25, 25, 0]
    return turned(radii, [4, 4, 0, 8, 105, 114, 115, 115, 111, 111])


FURTHER_SHAPES = ("ring", "half-cylinder", "can")
"""Own solids only for the experiment on the choice of a shape, and no part of its development."""

SOLIDS: Mapping[str, Callable[[], trimesh.Trimesh]] = {
    "ellipsoid": _ellipsoid,
    "mug": _mug,
    "ring": _ring,
    "half-cylinder": _half_cylinder,
    "can": _can,
    **HOUSEHOLD,
}
"""Solids that are not in the rig's catalogue."""
