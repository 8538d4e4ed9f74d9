"""Grasps of a box on the table with known truth: five contacts each, and the hand's motion with noise."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from typing import Literal

import numpy as np
from gtsam import Pose2, Pose3

from drivers.core.contacts import FINGERS, Contact, Grasp
from drivers.core.poses import rotate, spatial, transform_points
from tactile_lab.slam.result import SlamResult
from tactile_lab.slam.slam_settings import SlamSettings
from tactile_lab.slam.tactile_slam import TactileSlam
from tactile_lab.slam.tracking.joint.settings import JointSettings

GRASPS = 5
SIZE_m = (0.10, 0.06, 0.04)
PERIOD_ns = 20_000_000_000


@dataclass(frozen=True)
class Recorded:
    """Grasps and the object's true pose (frame at the box's centre) in each."""

    grasps: tuple[Grasp, ...]
    truth: tuple[Pose3, ...]


def box_grasps() -> Recorded:
    """A session of :data:`GRASPS` grasps whose hand motion is known to 1 mm and 2 degrees."""
    rng = np.random.default_rng(1)
    truth, grasps, pose = [], [], Pose2(0.40, 0.05, 0.3)
    for index in range(GRASPS):
        motion = Pose2(*(rng.normal(size=3) * [0.03, 0.03, 0.4])) if index else Pose2()
        previous, pose = pose, Pose2(pose.x() + motion.x(), pose.y() + motion.y(), pose.theta() + motion.theta())
        slip = Pose2(*(rng.normal(size=3) * [0.001, 0.001, 0.035])) if index else Pose2()
        hand_motion = pose.compose(slip).compose(previous.inverse())
        truth.append(spatial(pose, SIZE_m[2] / 2))
        grasps.append(_grasp(index, truth[-1], spatial(hand_motion), rng))
    return Recorded(tuple(grasps), tuple(truth))


@cache
def result_of(dimension: Literal[2, 3]) -> SlamResult:
    """The default method's result for :func:`box_grasps`, computed once for all tests."""
    joint = JointSettings(without={"faces"} if dimension == 3 else ())  # for speed
    slam = TactileSlam(SlamSettings(dimension=dimension, mesh_resolution_m=0.006, joint=joint), seed=3)
    for grasp in box_grasps().grasps:
        slam.add_grasp(grasp)
    return slam.finish()


def _grasp(index: int, world_T_object: Pose3, hand_motion: Pose3, rng: np.random.Generator) -> Grasp:
    points, normals = _contacts_on_box(index, rng)
    points = transform_points(world_T_object, points + 0.0005 * rng.normal(size=points.shape))
    normals = rotate(world_T_object, normals)
    contacts = tuple(
        Contact(finger, point, normal, 1e-6 * np.eye(3), 0.0873, float(rng.uniform(0.3, 1.4)))
        for finger, point, normal in zip(FINGERS, points, normals, strict=True)
    )
    return Grasp(index, PERIOD_ns * (index + 1), contacts, world_T_object, hand_motion if index else Pose3())


def _contacts_on_box(index: int, rng: np.random.Generator) -> tuple[np.ndarray, np.ndarray]:
    """Four fingers on one long and one short side, the thumb opposite."""
    half = np.array(SIZE_m) / 2
    flip = 1 if index % 2 else -1
    sides = [(0, flip), (1, 1), (1, 1), (1, flip), (1, -1)]
    points = rng.uniform(-0.85, 0.85, (5, 3)) * half
    normals = np.zeros((5, 3))
    for row, (axis, sign) in enumerate(sides):
        points[row, axis], normals[row, axis] = sign * half[axis], sign
    points[:, 2] = rng.uniform(-0.006, 0.006, 5)
    return points, normals
