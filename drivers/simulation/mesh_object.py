"""Meshes as objects of the simulated rig: put on the table, and split into convex pieces for the physics."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
import trimesh
from scipy.spatial.transform import Rotation

from drivers.core.contacts import Array
from drivers.core.errors import ConfigurationError
from drivers.core.installed.extras import require_package
from drivers.simulation.mesh_file import read_mesh
from drivers.simulation.object_names import LYING, STANDING, posed_path

_NEARLY_CONVEX = 0.96  # a mesh that fills this share of its convex hull is represented by the hull
_MOST_PIECES = 16
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


def convex_pieces(mesh: trimesh.Trimesh) -> tuple[Array, ...]:
    """Corner points of convex pieces, each of shape (n, 3), whose union approximates the mesh.

    A nearly convex mesh is one piece, its hull. Others are decomposed by CoACD with a fixed seed, so that one file
    gives the same physics every time; that takes seconds.
    """
    if mesh.volume >= _NEARLY_CONVEX * mesh.convex_hull.volume:
        return (np.asarray(mesh.convex_hull.vertices, float),)
    return _decompose(mesh.vertices.tobytes(), mesh.faces.astype(np.int32).tobytes())


@lru_cache(maxsize=8)
def _decompose(vertices: bytes, faces: bytes) -> tuple[Array, ...]:
    require_package("coacd")
    import coacd

    coacd.set_log_level("error")
    surface = coacd.Mesh(np.frombuffer(vertices).reshape(-1, 3), np.frombuffer(faces, np.int32).reshape(-1, 3))
    pieces = coacd.run_coacd(
        surface,
        threshold=0.05,
        max_convex_hull=_MOST_PIECES,
        preprocess_mode="off",
        resolution=1000,
        mcts_nodes=10,
        mcts_iterations=20,
        mcts_max_depth=2,
        seed=1,
    )
    return tuple(np.asarray(corners, float) for corners, _ in pieces)


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
