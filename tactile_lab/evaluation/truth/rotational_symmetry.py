"""Turns of an object about its own vertical axis that leave it as it is: no contact can tell them.

A cylinder that was turned by 20 degrees between two grasps feels as before, and so does a hexagonal prism after a sixth
of a turn. A method cannot follow such turns, and is not judged by them: its poses are turned towards the true heading
before contacts are compared. A sixth of a turn is three slips of full motion noise; a box, which a half turn leaves as
it is, has to be followed.
"""

from __future__ import annotations

import numpy as np
import trimesh
from gtsam import Pose3, Rot3

from drivers.core.poses import transform_points
from tactile_lab.evaluation.trajectory import Poses
from tactile_lab.slam.shape.surfaces.sampling import distances_to_mesh, sample_mesh

ANY_TURN = 0

_FEWEST = 6
_MOST = 12
_SOME_TURNS_rad = np.deg2rad([7.0, 20.0, 45.0, 77.0, 131.0])
"""None of them takes a prism of up to twelve sides to itself."""
_ALIKE_m = 0.001
"""As far as a fingertip can tell places apart: a dented can is round."""
_POINTS = 1000
_UPRIGHT = 1e-3


def symmetry_turns(mesh: trimesh.Trimesh) -> int | None:
    """How many turns of a full one about its frame's z axis leave an object as it is, to a millimetre RMS.

    Returns:
        :data:`ANY_TURN` for a round object, a number from 6 on, or None for an object whose turns can be told.
    """
    points = sample_mesh(mesh, _POINTS)

    def stays(turn_rad: float) -> bool:
        turned = transform_points(Pose3(Rot3.Rz(turn_rad), np.zeros(3)), points)
        return bool(np.mean(distances_to_mesh(turned, mesh) ** 2) < _ALIKE_m**2)

    if all(map(stays, _SOME_TURNS_rad)):
        return ANY_TURN
    return next((number for number in range(_MOST, _FEWEST - 1, -1) if stays(2 * np.pi / number)), None)


def modulo_symmetry(estimate: Poses, world_T_object: Poses, turns: int | None) -> tuple[Pose3 | None, ...]:
    """Estimated poses, turned about the object's axis towards the heading it truly has.

    The axis in the estimated object frame is where the estimates place the true axis, in the mean over all grasps. An
    object that does not always stand upright is left alone.

    Args:
        estimate: estimated poses, None where there is none.
        world_T_object: true poses, None where unknown.
        turns: see :func:`symmetry_turns`; None leaves the poses as they are.
    """
    known = zip(estimate, world_T_object, strict=True)
    pairs = [(pose, truth) for pose, truth in known if pose is not None and truth is not None]
    if turns is None or not pairs or not all(stands(truth) for _, truth in pairs):
        return tuple(estimate)
    axis_m = np.mean([pose.transformTo(truth.translation()) for pose, truth in pairs], axis=0)
    heading = pairs[0][1].rotation().inverse() * pairs[0][0].rotation()
    turned = []
    for pose, truth in zip(estimate, world_T_object, strict=True):
        if pose is not None and truth is not None:
            rotation = _nearest_turn(pose.rotation(), truth.rotation() * heading, turns)
            pose = Pose3(rotation, pose.transformFrom(axis_m) - rotation.rotate(axis_m))
        turned.append(pose)
    return tuple(turned)


def _nearest_turn(estimated: Rot3, true: Rot3, turns: int) -> Rot3:
    """The rotation that looks like the estimated one and is nearest to the true one."""
    if turns == ANY_TURN:
        return true
    step_rad = 2 * np.pi / turns
    return estimated * Rot3.Rz(step_rad * round((estimated.inverse() * true).yaw() / step_rad))


def stands(world_T_object: Pose3) -> bool:
    """Whether an object's own axis is vertical."""
    return bool(abs(world_T_object.rotation().matrix()[2, 2] - 1.0) < _UPRIGHT)
