"""What the true shape tells about an estimate: which rotations cannot be felt."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import trimesh
from gtsam import Pose3, Rot3

from tactile_lab.evaluation.estimate_with_truth import EstimateWithTruth, Truth
from tactile_lab.evaluation.files.results import Results
from tactile_lab.evaluation.files.trajectory_file import Trajectory

TIN, CARTON = trimesh.creation.cylinder(0.03, 0.1), trimesh.creation.box((0.12, 0.06, 0.06))
STILL = (Pose3(), Pose3())


def turned_against(mesh: trimesh.Trimesh, turn_rad: float) -> EstimateWithTruth:
    """An estimate of two grasps, the second turned about the axis of an object that did not move."""
    poses = (Pose3(), Pose3(Rot3.Rz(turn_rad), np.zeros(3)))
    return EstimateWithTruth(
        Path(), Results(Trajectory((0.0, 1.0), poses), (), {"dimension": 3}, ()), Truth(STILL, mesh)
    )


def test_a_turn_of_a_tin_about_its_axis_is_no_error() -> None:
    _, second = turned_against(TIN, 0.8).poses_modulo_symmetry
    assert second is not None
    assert second.equals(Pose3(), 1e-9)


def test_a_turn_of_a_carton_is_one() -> None:
    judged = turned_against(CARTON, 0.8)
    assert judged.symmetry_turns is None
    assert judged.poses_modulo_symmetry == judged.poses
