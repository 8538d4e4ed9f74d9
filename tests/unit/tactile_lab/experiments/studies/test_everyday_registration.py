"""The registration of sessions on everyday objects is that of every session's evaluation."""

from __future__ import annotations

import numpy as np
import pytest
import trimesh
from gtsam import Pose2, Pose3

from drivers.core.contacts import Contact, Grasp
from drivers.core.poses import spatial
from tactile_lab.experiments.studies.everyday_sessions import SeenObject, registered_mm


def _seen(mesh: trimesh.Trimesh, estimate: list[Pose2]) -> SeenObject:
    """An object that stands still, touched three times all around."""
    angles = np.arange(5) * 2 * np.pi / 5
    ways = np.column_stack([np.cos(angles), np.sin(angles), 0.0 * angles])
    contacts = tuple(Contact(f"finger {n}", 0.03 * way, way) for n, way in enumerate(ways))
    grasps = [Grasp(index, index, contacts) for index in range(3)]
    return SeenObject(mesh, [Pose3()] * 3, grasps, [spatial(pose) for pose in estimate])


def test_turns_of_a_tin_about_its_axis_do_not_count_and_its_moves_do() -> None:
    tin = trimesh.creation.cylinder(0.03, 0.1)
    assert registered_mm(_seen(tin, [Pose2(), Pose2(0.0, 0.0, 0.2), Pose2(0.0, 0.0, 0.4)]), 3) == pytest.approx(
        0.0, abs=0.01
    )
    moved_mm = registered_mm(_seen(tin, [Pose2(), Pose2(), Pose2(0.006, 0.0, 0.0)]), 3)
    assert moved_mm == pytest.approx(6.0 * np.sqrt(2) / 3, abs=0.01)


def test_turns_of_a_box_count() -> None:
    box = trimesh.creation.box((0.06, 0.04, 0.1))
    turned_mm = registered_mm(_seen(box, [Pose2(), Pose2(0.0, 0.0, 0.2), Pose2(0.0, 0.0, 0.4)]), 3)
    assert turned_mm is not None
    assert turned_mm > 3.0
