"""Rotations of an object about its vertical axis that leave it unchanged, so that no contact can distinguish them.

A cylinder rotated by 20 degrees between two grasps feels the same, and so does a hexagonal prism after a sixth of a
turn. A method cannot follow such rotations, and is not evaluated by them: its poses are rotated towards the true
heading before contacts are compared. A sixth of a turn is three times the motion noise; a box, with its symmetry of
half a turn, must be followed. A ball has such rotations about every axis, and rolls when it is let go.
"""

from __future__ import annotations

import numpy as np
import trimesh
from gtsam import Pose3, Rot3

from drivers.core.contacts import Array
from drivers.core.poses import transform_points
from tactile_lab.evaluation.trajectory import Poses
from tactile_lab.slam.doubt.symmetry import ROUND, Symmetry, largest_order, symmetry_of
from tactile_lab.slam.shape.surfaces.sampling import MeshDistances, sample_mesh
from tactile_lab.slam.shape.surfaces.surface import Contour

ANY_TURN = ROUND
ORIGIN_m = np.zeros(2)

_FEWEST = 6
_SOME_TURNS_rad = np.deg2rad([7.0, 20.0, 45.0, 77.0, 131.0])
"""None of these rotations maps a prism of up to twelve sides to itself."""
_ALIKE_m = 0.001
"""Resolution of a fingertip: a dented can is round."""
_POINTS = 1000
_UPRIGHT = 1e-3


def symmetry_turns(mesh: trimesh.Trimesh) -> int | None:
    """Order of an object's rotational symmetry about its frame's z axis, to a millimetre RMS.

    Returns:
        :data:`ANY_TURN` for a round object, a number from 6 on, or None for an object whose rotations can be
        distinguished.
    """
    points, distances = sample_mesh(mesh, _POINTS), MeshDistances(mesh)

    def stays(turn_rad: float) -> bool:
        turned = transform_points(Pose3(Rot3.Rz(turn_rad), np.zeros(3)), points)
        return bool(np.mean(distances.of(turned) ** 2) < _ALIKE_m**2)

    if all(map(stays, _SOME_TURNS_rad)):
        return ANY_TURN
    return largest_order(stays, _FEWEST)


def ball_centre_m(mesh: trimesh.Trimesh) -> Array | None:
    """Centre of an object that every rotation leaves unchanged, to a millimetre RMS, shape (3,); None for others."""
    centre_m = np.asarray(mesh.bounds.mean(axis=0))
    radii_m = np.linalg.norm(sample_mesh(mesh, _POINTS) - centre_m, axis=1)
    return centre_m if radii_m.std() < _ALIKE_m else None


def outline_symmetry(outline_m: Array) -> Symmetry | None:
    """The same for an outline in the plane, shape (n, 2), with its axis; None if its rotations can be distinguished."""
    found = symmetry_of(Contour(outline_m, np.zeros(len(outline_m)), is_closed=True))
    return found if found is not None and found.interchangeable else None


def modulo_symmetry(
    estimate: Poses, world_T_object: Poses, turns: int | None, centre_m: Array = ORIGIN_m
) -> tuple[Pose3 | None, ...]:
    """Estimated poses, rotated about the object's axis towards the true heading.

    The axis in the estimated object frame is the true axis as placed by the estimates, averaged over all grasps. Poses
    of an object that does not always stand upright are unchanged.

    Args:
        estimate: estimated poses, None if unknown.
        world_T_object: true poses, None if unknown.
        turns: see :func:`symmetry_turns`; None leaves the poses unchanged.
        centre_m: where the axis is in the true object frame, shape (2,).
    """
    known = zip(estimate, world_T_object, strict=True)
    pairs = [(pose, truth) for pose, truth in known if pose is not None and truth is not None]
    if turns is None or not pairs or not all(stands(truth) for _, truth in pairs):
        return tuple(estimate)
    axis_m = np.mean([pose.transformTo(truth.transformFrom(np.append(centre_m, 0.0))) for pose, truth in pairs], axis=0)
    heading = pairs[0][1].rotation().inverse() * pairs[0][0].rotation()
    turned = []
    for pose, truth in zip(estimate, world_T_object, strict=True):
        if pose is not None and truth is not None:
            rotation = _nearest_turn(pose.rotation(), truth.rotation() * heading, turns)
            pose = Pose3(rotation, pose.transformFrom(axis_m) - rotation.rotate(axis_m))
        turned.append(pose)
    return tuple(turned)


def modulo_rotations(estimate: Poses, world_T_object: Poses, centre_m: Array) -> tuple[Pose3 | None, ...]:
    """Estimated poses of a ball, rotated about its centre as it is rotated in truth.

    Args:
        estimate: estimated poses, None if unknown.
        world_T_object: true poses, None if unknown.
        centre_m: of the ball, true object frame, shape (3,); by the estimates it is where it is in the mean.
    """
    pairs = list(zip(estimate, world_T_object, strict=True))
    places_m = [pose.transformTo(truth.transformFrom(centre_m)) for pose, truth in pairs if pose and truth]
    if not places_m:
        return tuple(estimate)
    middle_m = np.mean(places_m, axis=0)

    def rotated(pose: Pose3, truth: Pose3) -> Pose3:
        return Pose3(truth.rotation(), pose.transformFrom(middle_m) - truth.rotation().rotate(middle_m))

    return tuple(rotated(pose, truth) if pose and truth else pose for pose, truth in pairs)


def modulo_mesh_symmetry(
    estimate: Poses, world_T_object: Poses, mesh: trimesh.Trimesh, turns: int | None
) -> tuple[Pose3 | None, ...]:
    """Estimated poses of a mesh, turned by its symmetries towards the true heading; a ball's as it rolled.

    Args:
        estimate: estimated poses, None if unknown.
        world_T_object: true poses, None if unknown.
        mesh: of the object.
        turns: see :func:`symmetry_turns`.
    """
    if (ball_m := ball_centre_m(mesh)) is not None:
        return modulo_rotations(estimate, world_T_object, ball_m)
    return modulo_symmetry(estimate, world_T_object, turns)


def round_axis_m(symmetry: Symmetry | None, world_T_object: Poses) -> Array | None:
    """Where the axis of a round object is in its own frame, shape (2,); None if it is not round, or does not always
    stand upright.
    """
    known = [pose for pose in world_T_object if pose is not None]
    if symmetry is None or symmetry.order != ANY_TURN or not all(map(stands, known)):
        return None
    return symmetry.centre_m


def _nearest_turn(estimated: Rot3, true: Rot3, turns: int) -> Rot3:
    """The rotation equivalent to the estimated one that is nearest to the true one."""
    if turns == ANY_TURN:
        return true
    step_rad = 2 * np.pi / turns
    return estimated * Rot3.Rz(step_rad * round((estimated.inverse() * true).yaw() / step_rad))


def stands(world_T_object: Pose3) -> bool:
    """Whether an object's own axis is vertical."""
    return bool(abs(world_T_object.rotation().matrix()[2, 2] - 1.0) < _UPRIGHT)
