"""Meshes as objects of the simulated rig: put on the table."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import trimesh
from scipy.spatial.transform import Rotation

from drivers.core.contacts import Array
from drivers.core.errors import ConfigurationError
from drivers.simulation.mesh_file import read_mesh
from drivers.simulation.object_names import LYING, STANDING, posed_path

_LEANING_rad = np.radians(15.0)  # a scan that leans by less than this is meant to stand
_LYING_rad = np.radians(45.0)  # an object turned by more than this from standing is lying
_TOLD_rad, _TOLD_m = np.radians(5.0), 0.001
_MOST_CORNERS = 3000  # of a hull: each facet of a ball is a pose of its own, and thousands take minutes
_DIRECTIONS = 500
_SAME_POSE_rad = np.radians(5.0)  # the facets of a curved side count as one pose


@dataclass(frozen=True)
class RestingMesh:
    """A mesh on the table, metres, z up, with its origin at the centre of volume.

    Attributes:
        mesh: closed, faces turned outward.
        changes: what was done to the mesh of the file, as sentences.
    """

    mesh: trimesh.Trimesh
    changes: tuple[str, ...]


def load_truth_mesh(name: str) -> trimesh.Trimesh:
    """The mesh of :func:`load_resting_mesh` alone."""
    return load_resting_mesh(name).mesh


def load_resting_mesh(name: str) -> RestingMesh:
    """The mesh named ``mesh:<path>`` or ``mesh:<path>@<pose>``, at rest.

    Without a pose it stands as in the file, rotated by a few degrees if it needs that to stand firmly. If it cannot
    stand this way, it is laid down in its most probable resting pose. It may float or be sunk in its file: the table is
    where it rests.

    Raises:
        ConfigurationError: the file cannot be read, has no closed surface of one body, is not of graspable size, or has
            no such pose.
    """
    path, pose = posed_path(name)
    file = read_mesh(path)
    mesh = file.mesh
    lowest_m = float(mesh.bounds[0, 2])
    mesh.apply_translation(-mesh.center_mass)
    mesh.apply_transform(turn := _resting(mesh, pose, str(path)))
    return RestingMesh(mesh, (*file.changes, *_placed(lowest_m, float(np.arccos(np.clip(turn[2, 2], -1.0, 1.0))))))


def _placed(lowest_m: float, turned_rad: float) -> tuple[str, ...]:
    """What was done to set a mesh on the table; nothing about what a scan is off."""
    if turned_rad > _TOLD_rad:
        return (f"it was turned by {np.degrees(turned_rad):.0f} degrees, to rest on the table",)
    if abs(lowest_m) < _TOLD_m:
        return ()
    way = "raised" if lowest_m < 0 else "lowered"
    return (f"it was {way} by {1e3 * abs(lowest_m):.0f} mm, to stand on the table",)


def _resting(mesh: trimesh.Trimesh, pose: str, where: str) -> Array:
    """The rotation about the origin, shape (4, 4), that puts the mesh into a stable pose, without yaw."""
    hull = _coarse_hull(mesh)
    poses, chances = trimesh.poses.compute_stable_poses(hull, mesh.center_mass, sigma=0.0, n_samples=1, threshold=0.0)
    down = -poses[np.argsort(-chances, kind="stable"), 2, :3]  # in the file's axes, most probable first
    upright = -down[:, 2]
    stands = down[upright.argmax() if upright.max() > np.cos(_LEANING_rad) else 0]
    chosen = stands if pose == STANDING else _laid(down, stands, pose, where)
    rotation, _ = Rotation.align_vectors([[0.0, 0.0, -1.0]], [chosen])
    matrix = np.eye(4)
    matrix[:3, :3] = rotation.as_matrix()
    return matrix


def _coarse_hull(mesh: trimesh.Trimesh) -> trimesh.Trimesh:
    """The convex hull; of a finely curved one only as many corners as lie farthest in evenly spread directions."""
    hull: trimesh.Trimesh = mesh.convex_hull
    if len(hull.vertices) <= _MOST_CORNERS:
        return hull
    number = np.arange(_DIRECTIONS) + 0.5
    z, turn = 1 - 2 * number / _DIRECTIONS, np.pi * (1 + np.sqrt(5)) * number
    ways = np.column_stack([np.sqrt(1 - z**2) * np.cos(turn), np.sqrt(1 - z**2) * np.sin(turn), z])
    coarse: trimesh.Trimesh = trimesh.Trimesh(
        hull.vertices[np.unique(np.argmax(ways @ hull.vertices.T, 1))]
    ).convex_hull
    return coarse


def _laid(down: Array, stands: Array, pose: str, where: str) -> Array:
    """The direction to the table, shape (3,), in a pose other than the standing one."""
    distinct: list[Array] = []
    for direction in down:
        if all(direction @ other < np.cos(_SAME_POSE_rad) for other in distinct):
            distinct.append(direction)
    lying = [direction for direction in distinct if direction @ stands < np.cos(_LYING_rad)]
    found = lying if pose == LYING else distinct[int(pose) - 1 :] if int(pose) > 0 else []
    if not found:
        raise ConfigurationError(
            f"has no pose {pose}: it rests in {len(distinct)} poses", where=where, hint="Give another --pose"
        )
    return found[0]
