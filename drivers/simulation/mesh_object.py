"""A mesh file as an object of the simulated rig: checks, and convex pieces for the physics."""

from __future__ import annotations

from functools import lru_cache
from pathlib import Path

import coacd
import numpy as np
import trimesh
from scipy.spatial.transform import Rotation

from drivers.core.contacts import Array
from drivers.core.errors import ConfigurationError
from drivers.core.reading.bounded_files import LARGEST_MESH_bytes, check_size

MESH_PREFIX = "mesh:"
LARGEST_m, SMALLEST_m = 0.25, 0.01
_NEARLY_CONVEX = 0.96  # share of its hull a mesh fills when the hull alone stands for it
_MOST_PIECES = 16
_LEANING_rad = np.radians(15.0)  # a scan that leans by less was meant to stand


def load_truth_mesh(name: str) -> trimesh.Trimesh:
    """The mesh called ``mesh:<path>``, metres, standing, its origin at the centre of volume.

    It stands as in the file, turned by the few degrees that make it stand firmly; one that cannot stand so is laid
    down in its most probable resting pose.

    Raises:
        ConfigurationError: the file cannot be read, holds no closed surface, or its size is not that of a graspable
            object.
    """
    path = Path(name.removeprefix(MESH_PREFIX))
    mesh = _read(path)
    _check(mesh, str(path))
    mesh.apply_translation(-mesh.center_mass)
    mesh.apply_transform(_standing(mesh))
    return mesh


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


def _standing(mesh: trimesh.Trimesh) -> Array:
    """The rotation about the origin that puts the mesh on a stable foot, shape (4, 4), without a turn about z."""
    poses, chances = trimesh.poses.compute_stable_poses(mesh, sigma=0.0, n_samples=1, threshold=0.0)
    down = -poses[:, 2, :3]  # the direction of the table in the file's axes
    upright = -down[:, 2]
    firm = upright.argmax() if upright.max() > np.cos(_LEANING_rad) else np.argmax(chances)
    rotation, _ = Rotation.align_vectors([[0.0, 0.0, -1.0]], [down[firm]])
    matrix = np.eye(4)
    matrix[:3, :3] = rotation.as_matrix()
    return matrix


def _read(path: Path) -> trimesh.Trimesh:
    if not path.is_file():
        raise ConfigurationError("file not found", where=str(path), hint="Check the path of the mesh")
    check_size(path, LARGEST_MESH_bytes)
    try:
        mesh = trimesh.load(path, force="mesh")
    except Exception as error:  # the readers of a dozen formats raise whatever they like
        raise ConfigurationError(
            f"cannot be read as a mesh ({error})", where=str(path), hint="Give a PLY, STL, OBJ or GLB file"
        ) from error
    if not isinstance(mesh, trimesh.Trimesh) or not len(mesh.faces):
        raise ConfigurationError("contains no triangles", where=str(path), hint="Export the object as a triangle mesh")
    return mesh


def _check(mesh: trimesh.Trimesh, where: str) -> None:
    if not np.all(np.isfinite(mesh.vertices)):
        raise ConfigurationError("has vertices that are not numbers", where=where, hint="Export the mesh again")
    largest = float(mesh.extents.max())
    if largest > LARGEST_m:
        raise ConfigurationError(
            f"is {largest:.3g} m long, but at most {LARGEST_m} m fit the hand's workspace",
            where=where,
            hint="The unit must be the metre: is the mesh in millimetres?",
        )
    if largest < SMALLEST_m:
        raise ConfigurationError(
            f"is only {largest * 1e3:.3g} mm long, but the fingertips need {SMALLEST_m * 1e3:.0f} mm to hold it",
            where=where,
            hint="The unit must be the metre: was the mesh scaled from millimetres twice?",
        )
    if not mesh.is_watertight or mesh.volume <= 0:
        raise ConfigurationError(
            "is not a closed surface with its faces turned outward", where=where, hint="Repair it in a mesh editor"
        )
