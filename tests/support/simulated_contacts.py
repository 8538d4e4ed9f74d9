"""Simulated grasps for tests of the estimation: placed by their true poses, and compared with them."""

from __future__ import annotations

import numpy as np

from tactile_lab.evaluation.registration import registration_rms_mm
from tactile_lab.experiments.data import planar_data, spatial_data
from tactile_lab.experiments.data.sensing import SimulatedGrasps
from tactile_lab.slam.result import SlamResult
from tactile_lab.slam.shape.fields.settings import GpisSettings
from tactile_lab.slam.tracking.contacts.contact_map import ContactMap, PlacedGrasp
from tactile_lab.slam.tracking.contacts.contact_set import ContactSet
from tactile_lab.slam.tracking.contacts.motion import planar_motion


def true_map(
    shape: str, seed: int = 0, count: int = 12, *, dimension: int = 2, settings: GpisSettings | None = None
) -> ContactMap:
    """Grasps at their true poses, the object frame being the body's."""
    return placed_truly(
        (planar_data if dimension == 2 else spatial_data).simulate(shape, seed, count=count), dimension, settings
    )


def placed_truly(data: SimulatedGrasps, dimension: int, settings: GpisSettings | None = None) -> ContactMap:
    """Simulated grasps at their true poses."""
    placed = [
        PlacedGrasp(
            ContactSet.of_grasp(grasp, dimension, 0.0),
            planar_motion(pose),
            np.eye(3) * 1e-6,
            planar_motion(grasp.hand_motion_world),
        )
        for grasp, pose in zip(data.grasps, data.world_T_body, strict=True)
    ]
    return ContactMap(tuple(placed), settings or GpisSettings())


def registration_mm(data: SimulatedGrasps, result: SlamResult) -> float:
    """Registration error of a result; a result without poses fails the test."""
    points = [grasp.points_world_m for grasp in data.grasps]
    error = registration_rms_mm(points, result.world_T_object, data.world_T_body, result.dimension)
    assert error is not None
    return error
