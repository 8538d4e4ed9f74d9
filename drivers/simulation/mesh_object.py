"""Mesh files as objects of the simulated rig: checks them, and splits them into convex pieces for the physics."""

from __future__ import annotations

from functools import lru_cache
from pathlib import Path

import numpy as np
import trimesh
from scipy.spatial.transform import Rotation

from drivers.core.contacts import Array
from drivers.core.errors import ConfigurationError
from drivers.core.installed.extras import require_package
from drivers.core.reading.bounded_files import LARGEST_MESH_bytes, check_size, refuse_unreachable
from drivers.simulation.object_names import LYING, STANDING, posed_path

LARGEST_m, SMALLEST_m = 0.25, 0.01
MOST_TRIANGLES = 100_000
"""Finding how a finer mesh rests on the table takes minutes, and no fingertip feels the difference."""

_NEARLY_CONVEX = 0.96  # a mesh that fills this share of its convex hull is represented by the hull
_MOST_PIECES = 16
_LEANING_rad = np.radians(15.0)  # a scan that leans by less than this is meant to stand
_LYING_rad = np.radians(45.0)  # an object turned by more than this from standing is lying
_SAME_POSE_rad = np.radians(5.0)  # the facets of a curved side count as one pose


def load_truth_mesh(name: str) -> trimesh.Trimesh:
    """The mesh named ``mesh:<path>`` or ``mesh:<path>@<pose>``, metres, at rest, with its origin at the centre of
    volume.

    Without a pose it stands as in the file, rotated by a few degrees if it needs that to stand firmly. If it cannot
    stand this way, it is laid down in its most probable resting pose. Small holes are closed and faces turned outward.

    Raises:
        ConfigurationError: the file cannot be read, has no closed surface, is not of graspable size, or has no such
            pose.
    """
    path, pose = posed_path(name)
    mesh = _read(path)
    _check(mesh, str(path))
    mesh.apply_translation(-mesh.center_mass)
    mesh.apply_transform(_resting(mesh, pose, str(path)))
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
    poses, chances = trimesh.poses.compute_stable_poses(mesh, sigma=0.0, n_samples=1, threshold=0.0)
    down = -poses[np.argsort(-chances, kind="stable"), 2, :3]  # in the file's axes, most probable first
    upright = -down[:, 2]
    stands = down[upright.argmax() if upright.max() > np.cos(_LEANING_rad) else 0]
    chosen = stands if pose == STANDING else _laid(down, stands, pose, where)
    rotation, _ = Rotation.align_vectors([[0.0, 0.0, -1.0]], [chosen])
    matrix = np.eye(4)
    matrix[:3, :3] = rotation.as_matrix()
    return matrix


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


def _read(path: Path) -> trimesh.Trimesh:
    refuse_unreachable(path)
    if not path.is_file():
        raise ConfigurationError("file not found", where=str(path), hint="Check the path of the mesh")
    check_size(path, LARGEST_MESH_bytes)
    try:
        mesh = trimesh.load(path, force="mesh")
    except Exception as error:  # the readers of a dozen formats raise all kinds of exceptions
        raise ConfigurationError(
            f"cannot be read as a mesh ({error})", where=str(path), hint="Give a PLY, STL, OBJ or GLB file"
        ) from error
    if not isinstance(mesh, trimesh.Trimesh) or not len(mesh.faces):
        raise ConfigurationError("contains no triangles", where=str(path), hint="Export the object as a triangle mesh")
    if len(mesh.faces) > MOST_TRIANGLES:
        what = f"has {len(mesh.faces):,} triangles, and at most {MOST_TRIANGLES:,} are used"
        raise ConfigurationError(what, where=str(path), hint="Simplify it in a mesh editor")
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
    _repair(mesh)
    if not mesh.is_watertight or mesh.volume <= 0:
        _, uses = np.unique(mesh.edges_sorted, axis=0, return_counts=True)
        open_edges = int(np.count_nonzero(uses == 1))
        what = f"is not a closed surface: {open_edges} edges are open, and filling small holes did not close it"
        raise ConfigurationError(what, where=where, hint="Repair it in a mesh editor")


def _repair(mesh: trimesh.Trimesh) -> None:
    """Close small holes and turn faces outward, in place, where the mesh needs it."""
    if mesh.is_watertight and mesh.volume > 0:
        return
    mesh.merge_vertices(merge_tex=True, merge_norm=True)
    mesh.update_faces(mesh.nondegenerate_faces() & mesh.unique_faces())
    trimesh.repair.fill_holes(mesh)
    mesh.fix_normals()
