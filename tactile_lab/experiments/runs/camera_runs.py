"""The marker camera under ten conditions: error of the pose, and flipped poses that are accepted as valid."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from gtsam import Pose3, Rot3

from drivers.camera.aruco import ObjectTracker
from drivers.camera.calibration import CameraCalibration
from drivers.camera.frames import Frame
from drivers.camera.markers import MarkerSettings
from drivers.camera.rendering.board_camera import simulated_lens
from drivers.camera.rendering.settings import CameraSettings
from drivers.camera.rendering.table_camera import PrintedMarker, TableCamera
from drivers.core.fingertip import RigidTransform
from drivers.core.poses import rotation_angle_rad
from tactile_lab.experiments.cells import Cell

FRAMES = 5
FLIP_rad = np.radians(10.0)
_POSE = RigidTransform(translation_m=(-0.005, -0.04, -0.58), rpy_rad=(-0.07, 0.05, 0.0))
_TILTED = RigidTransform(translation_m=(0.02, -0.2, -0.55), rpy_rad=(-0.33, 0.05, 0.1))
_FAR = RigidTransform(translation_m=(-0.005, -0.04, -0.85), rpy_rad=(-0.05, 0.03, 0.0))

CONDITIONS: Mapping[str, Mapping[str, Any]] = {
    "sharp": {},
    "slightly blurred": {"blur_px": 1.2},
    "blurred": {"blur_px": 1.7},
    "very blurred": {"blur_px": 2.6},
    "noisy": {"noise_levels": 9.0},
    "small marker": {"side_m": 0.020},
    "small and blurred": {"side_m": 0.020, "blur_px": 1.4},
    "oblique": {"world_T_camera": _TILTED},
    "far": {"world_T_camera": _FAR},
    "glass forgotten": {"assumed_glass_m": 0.0},
}
"""Differences from the rig's usual camera, at 640 x 480 pixels."""


def see_object(cell: Cell) -> Mapping[str, Any]:
    """Evaluate a few frames of an object at rest: errors of the pose on the table, and of unconstrained poses."""
    rng = np.random.default_rng(cell.seed)
    condition = dict(CONDITIONS[str(cell["condition"])])
    side_m, assumed_m = condition.pop("side_m", 0.035), condition.pop("assumed_glass_m", 0.008)
    camera = CameraSettings().model_copy(update={"world_T_camera": _POSE, **condition})
    lens = simulated_lens((640, 480))
    markers = MarkerSettings(
        object_side_m=side_m,
        glass_thickness_m=assumed_m,
        world_T_worldmarker=RigidTransform(translation_m=(0.16, 0.0, 0.0), rpy_rad=(np.pi, 0.0, 0.1)),
    )
    truth = Pose3(Rot3.Yaw(rng.uniform(-np.pi, np.pi)), np.array([*rng.uniform(-0.05, 0.05, 2), 0.0]))
    frames = _frames(lens, camera, markers, truth, rng)
    return {**_on_table(lens, markers, frames, truth), **_free(lens, markers, frames, truth)}


def _frames(
    lens: CameraCalibration, camera: CameraSettings, markers: MarkerSettings, truth: Pose3, rng: np.random.Generator
) -> list[Frame]:
    view = TableCamera(lens, camera, rng)
    world = PrintedMarker(markers.dictionary, markers.world_id, markers.world_side_m)
    target = PrintedMarker(markers.dictionary, markers.object_id, markers.object_side_m)
    placed = (
        (world, markers.world_T_worldmarker.pose()),
        (target, truth * markers.object_T_objectmarker.pose()),
    )
    foot = 0.03 * np.array([[-1.0, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0]])
    corners = foot @ truth.rotation().matrix().T + truth.translation()
    return [Frame(number, view.render(placed, corners), number) for number in range(FRAMES)]


def _on_table(lens: CameraCalibration, markers: MarkerSettings, frames: list[Frame], truth: Pose3) -> dict[str, Any]:
    tracker = ObjectTracker(lens, markers)
    seen = [tracker.observe(frame) for frame in frames]
    known = [each.sighting for each in seen if each.sighting is not None]
    changes = [truth.between(sighting.world_T_object) for sighting in known]
    return {
        "position_mm": [1e3 * float(np.linalg.norm(change.translation())) for change in changes],
        "angle_deg": [float(np.degrees(rotation_angle_rad(change))) for change in changes],
        "worst_mm": max((1e3 * float(np.linalg.norm(change.translation())) for change in changes), default=None),
        "frames": len(frames),
        "refused": len(frames) - len(known),
        "flips": sum(bool(rotation_angle_rad(change) > FLIP_rad) for change in changes),
    }


def _free(lens: CameraCalibration, markers: MarkerSettings, frames: list[Frame], truth: Pose3) -> dict[str, Any]:
    """The same without the table constraint: valid poses, ambiguous ones, and flips among the valid ones."""
    tracker = ObjectTracker(lens, markers.model_copy(update={"freedom": "spatial"}))
    valid = [seen for frame in frames if (seen := tracker.observe(frame).sighting) is not None]
    flips = [bool(rotation_angle_rad(truth.between(seen.world_T_object)) > FLIP_rad) for seen in valid]
    return {"free_valid": len(valid), "free_flips": sum(flips)}
