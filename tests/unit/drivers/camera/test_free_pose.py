"""Objects held up and tilted before the rendered camera: clear poses are told, and never the wrong one."""

from __future__ import annotations

import numpy as np
import pytest
from gtsam import Pose3, Rot3

from drivers.camera.aruco import ObjectTracker
from drivers.camera.frames import Frame
from drivers.camera.markers import MarkerSettings
from drivers.camera.rendering.board_camera import simulated_lens
from drivers.camera.rendering.settings import CameraSettings
from drivers.camera.rendering.table_camera import PrintedMarker, TableCamera
from drivers.core.fingertip import RigidTransform
from drivers.core.poses import rotation_angle_rad
from tactile_lab.experiments.cells import Cell
from tactile_lab.experiments.runs.camera_runs import see_object

MARKERS = MarkerSettings(
    freedom="spatial",
    glass_thickness_m=0.008,
    world_T_worldmarker=RigidTransform(translation_m=(0.16, 0.0, 0.0), rpy_rad=(np.pi, 0.0, 0.1)),
)


def told(tilt_deg: float, count: int) -> list[float]:
    """Angles, degrees, between the true poses and those that were told, of objects tilted any way."""
    lens, rng = simulated_lens((640, 480)), np.random.default_rng(901)
    view, found = TableCamera(lens, CameraSettings(), rng), []
    world = PrintedMarker(MARKERS.dictionary, MARKERS.world_id, MARKERS.world_side_m)
    target = PrintedMarker(MARKERS.dictionary, MARKERS.object_id, MARKERS.object_side_m)
    for number in range(count):
        about, turn = rng.uniform(-np.pi, np.pi, 2)
        tilt = Rot3.Expmap(np.radians(tilt_deg) * np.array([np.cos(about), np.sin(about), 0.0]))
        truth = Pose3(tilt * Rot3.Yaw(turn), np.array([*rng.uniform(-0.05, 0.05, 2), 0.03]))
        placed = ((world, MARKERS.world_T_worldmarker.pose()), (target, truth * MARKERS.object_T_objectmarker.pose()))
        seen = ObjectTracker(lens, MARKERS).observe(Frame(number, view.render(placed, np.zeros((3, 3)))))
        if seen.sighting is None:
            assert seen.problem.startswith("ambiguous")
        else:
            found.append(float(np.degrees(rotation_angle_rad(truth.between(seen.sighting.world_T_object)))))
    return found


@pytest.mark.parametrize("tilt_deg", [40.0, 55.0])
def test_oblique_sharp_views_are_told_and_right(tilt_deg: float) -> None:
    found = told(tilt_deg, 5)
    assert len(found) == 5
    assert max(found) < 3.0


def test_frontal_views_are_ambiguous() -> None:
    assert told(0.0, 5) == []


@pytest.mark.parametrize("condition", ["sharp", "very blurred", "small marker", "oblique"])
def test_the_truth_on_the_table_is_right_or_refused(condition: str) -> None:
    seen = see_object(Cell((("condition", condition),), 902))
    assert seen["flips"] == seen["free_flips"] == 0
    if condition == "very blurred":
        assert seen["refused"] == seen["frames"]
    else:
        assert np.median(seen["position_mm"]) < 1.5
        assert np.median(seen["angle_deg"]) < 1.5
