"""A rectangle of 10 x 6 cm with contacts all over or on a part of it, and candidates around it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from gtsam import Pose2

from drivers.core.contacts import Array
from tactile_lab.experiments.coverage_criteria import ExploredMap
from tactile_lab.experiments.data.outlines import OUTLINES_m, edge_normals
from tactile_lab.experiments.data.planar_hand import planned_rays
from tactile_lab.slam.exploration.candidates import Candidate, ModelledObject
from tactile_lab.slam.exploration.policy import Belief
from tactile_lab.slam.exploration.ten_candidates import TEN_PALMS, candidates_at
from tactile_lab.slam.shape.surfaces.sampling import sample_polygon

OUTLINE_m = OUTLINES_m["rectangle"]


def contacts_every(step_m: float) -> tuple[Array, Array]:
    """Points and normals all along the outline, without the corners."""
    points = sample_polygon(OUTLINE_m, step_m)
    points = points[np.linalg.norm(points[:, None] - OUTLINE_m, axis=-1).min(axis=1) > 0.004]
    middles = (OUTLINE_m + np.roll(OUTLINE_m, -1, axis=0)) / 2
    normals = edge_normals(OUTLINE_m)
    sides = np.array([np.argmin(np.abs(np.sum((point - middles) * normals, axis=1))) for point in points])
    return points, normals[sides]


def belief_of_right_end_unknown(world_T_object: Pose2 | None = None, step_m: float = 0.008) -> Belief:
    """Contacts on all sides but the right end (x > 20 mm), where there is only one contact far out."""
    points, normals = contacts_every(step_m)
    known = (points[:, 0] < 0.02) | ((points[:, 0] > 0.049) & (np.abs(points[:, 1]) < 0.005))
    return belief_of(points[known], normals[known], world_T_object)


def belief_of(points: Array, normals: Array, world_T_object: Pose2 | None = None) -> Belief:
    """A belief with contacts in the object frame; the leftmost ones belong to the latest grasp."""
    known = ExploredMap.of(points, normals)
    indices = (points[:, 0] < -0.045).astype(np.int64)
    return Belief(known.field, known.surface, points, normals, indices, world_T_object or Pose2())


def uncertain(belief: Belief, sigmas: Array, count: int = 400) -> Belief:
    """The same belief with particles spread about the pose."""
    rng = np.random.default_rng(3)
    pose = belief.world_T_object
    rows = np.array([pose.x(), pose.y(), pose.theta()]) + rng.normal(size=(count, 3)) * sigmas
    return replace(belief, pose_covariance=np.diag(sigmas**2), particles=rows, weights=np.full(count, 1.0 / count))


def ten(world_T_object: Pose2 | None = None) -> tuple[Candidate, ...]:
    """The ten candidates around the object."""
    return candidates_at(TEN_PALMS, world_T_object or Pose2(), planned_rays())


def modelled(belief: Belief) -> ModelledObject:
    """The model of a belief's object, on which a candidate's contacts are predicted."""
    return ModelledObject(belief.field, belief.dimension, belief.world_T_object, belief.origin_height_m)
