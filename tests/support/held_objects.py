"""Contacts of a hand that carries an object, made from the object's and the palm's motion."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from gtsam import Pose2

from drivers.core.contacts import FINGERS
from sessions.perception.carrying.tip_steps import TipSteps

STEP_s = 0.02
_STEPS = 100

BOX = {
    "FF": ((0.03, 0.03), (0.0, 1.0)),
    "MF": ((0.01, 0.03), (0.0, 1.0)),
    "RF": ((-0.01, 0.03), (0.0, 1.0)),
    "LF": ((-0.03, 0.03), (0.0, 1.0)),
    "TH": ((0.0, -0.03), (0.0, -1.0)),
}
"""Point and outward normal of each finger's contact on a box, object frame."""

_ANGLES = dict(zip(FINGERS, np.radians([60, 80, 100, 120, 270]), strict=True))
DISC = {f: ((0.03 * np.cos(a), 0.03 * np.sin(a)), (np.cos(a), np.sin(a))) for f, a in _ANGLES.items()}


def steps_of(contacts, count):
    """Steps of an object at the world's origin that does not move, each finger pressing with 1 N."""
    shape = (count, len(FINGERS))
    points, normals = np.zeros((*shape, 3)), np.zeros((*shape, 3))
    for at, finger in enumerate(FINGERS):
        points[:, at, :2], normals[:, at, :2] = contacts[finger]
        points[:, at, 2] = 0.02
    frames = np.tile(np.eye(4), (count + 1, 1, 1))
    void = np.zeros(shape, dtype=bool)
    times = np.full(count, STEP_s)
    still, forces, sinking = np.zeros((*shape, 3)), np.ones(shape), np.zeros(shape)
    net, moments, levers = np.zeros((count, 3)), np.zeros(count), np.zeros(count)
    return TipSteps(points, normals, still, forces, sinking, np.zeros(shape), net, moments, levers, void, frames, times)


def carried(contacts, *, object_motion, palm_motion, felt=FINGERS, extra_moves=None, count=_STEPS):
    """The steps of a carry whose fingertips stick to the object, but for extra moves of some."""
    still = steps_of(contacts, count)
    poses = [_share(object_motion, k / count) for k in range(count + 1)]
    points, moves, normals = np.zeros_like(still.points_m), np.zeros_like(still.moves_m), np.zeros_like(still.normals)
    for step in range(count):
        before, after = (_matrix(pose) for pose in poses[step : step + 2])
        starts, ends = (still.points_m[0] @ each[:3, :3].T + each[:3, 3] for each in (before, after))
        points[step], moves[step] = (starts + ends) / 2, ends - starts
        middle = _matrix(_share(object_motion, (step + 0.5) / count))
        normals[step] = still.normals[0] @ middle[:3, :3].T
    for finger, extra in (extra_moves or {}).items():
        moves[:, FINGERS.index(finger)] += extra / count
    forces = still.forces_N * [finger in felt for finger in FINGERS]
    frames = np.array([_matrix(_share(palm_motion, k / count)) for k in range(count + 1)])
    return replace(still, points_m=points, normals=normals, moves_m=moves, forces_N=forces, world_T_palm=frames)


def _share(motion, share):
    """A part of a motion, at constant speed."""
    return Pose2.Expmap(share * Pose2.Logmap(motion))


def _matrix(pose):
    matrix = np.eye(4)
    planar = pose.matrix()
    matrix[:2, :2], matrix[:2, 3] = planar[:2, :2], planar[:2, 2]
    return matrix
