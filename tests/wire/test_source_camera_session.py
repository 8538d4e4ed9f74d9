"""A whole session whose camera is one of this computer: here a video of an object at rest."""

from __future__ import annotations

import shutil
from pathlib import Path

import cv2
import numpy as np
import pytest
import yaml
from gtsam import Pose3, Rot3

from drivers.camera.calibration import load_camera
from drivers.camera.markers import MarkerSettings
from drivers.camera.rendering.settings import CameraSettings
from drivers.camera.rendering.table_camera import PrintedMarker, TableCamera
from drivers.core.configuration import load_model
from drivers.core.errors import DeviceError
from drivers.simulation.objects import object_model
from drivers.simulation.world import marker_settings
from sessions.conductor.progress import NullProgress
from sessions.recording.session import Session
from tactile_lab.evaluation.files.trajectory_file import read_trajectory
from tactile_lab.evaluation.truth.session_truth import TRUTH_TRAJECTORY
from tactile_lab.rigs.description import Rig, load_rig
from tactile_lab.workflow import running
from tactile_lab.workflow.comparing import compare_sessions
from tactile_lab.workflow.finishing import TruthChoice
from tests.support.wire_rig import wire_rig

pytestmark = pytest.mark.usefixtures("real_time_alone")

OBJECT, RATE_Hz = "box-10x6x4", 5
TRUTH = Pose3(Rot3.Yaw(0.4), np.array([0.02, -0.015, 0.02]))  # the box stands on the table


def with_video(folder: Path) -> Rig:
    """A rig on emulated wires, with a video for its camera."""
    path = wire_rig(folder)
    rig = load_rig(str(path))
    markers = marker_settings(object_model(OBJECT), load_model(rig.files["markers"], MarkerSettings))
    lens = load_camera(rig.files["camera"])
    assert lens.size_px is not None
    video = cv2.VideoWriter(str(folder / "table.avi"), cv2.VideoWriter.fourcc(*"MJPG"), RATE_Hz, lens.size_px, False)
    view = TableCamera(lens, CameraSettings(), np.random.default_rng(4))
    for _ in range(5):
        video.write(view.render(placed(markers), np.zeros((3, 3))))
    video.release()
    content = yaml.safe_load(path.read_text())
    source = {"source": "table.avi", "rate_hz": RATE_Hz, "repeat": True}
    content["wires"]["camera"] = {"wire": "source", "settings": source}
    path.write_text(yaml.safe_dump(content))
    return load_rig(str(path))


def placed(markers: MarkerSettings) -> tuple[tuple[PrintedMarker, Pose3], tuple[PrintedMarker, Pose3]]:
    """Both markers where they are in the world."""
    world = PrintedMarker(markers.dictionary, markers.world_id, markers.world_side_m)
    target = PrintedMarker(markers.dictionary, markers.object_id, markers.object_side_m)
    on_object = markers.object_T_objectmarker.pose()
    return (world, markers.world_T_worldmarker.pose()), (target, TRUTH * on_object)


@pytest.mark.long
def test_a_session_with_a_video_for_its_camera_is_judged_by_what_it_shows(tmp_path: Path) -> None:
    if shutil.which("ip") is None:
        pytest.skip("no ip command to make virtual interfaces with")
    rig = with_video(tmp_path).source
    request = running.SessionRequest(rig, OBJECT, tmp_path / "runs", method="odometry", grasps=1)
    try:
        finished = running.run_session(request, NullProgress())
    except DeviceError as error:
        if "no right" in str(error) or "no permission" in str(error):
            pytest.skip(str(error))
        raise
    assert finished.evaluation is not None, finished.problem
    assert finished.evaluation.truth.seen == 1
    session = Session.open(finished.folder)
    (seen,) = read_trajectory(session.results / TRUTH_TRAJECTORY).world_T_object
    assert seen is not None
    off = TRUTH.between(seen)
    assert np.linalg.norm(off.translation()) < 1e-3
    assert abs(off.rotation().yaw()) < np.radians(0.5)
    again = compare_sessions([session], ["results"], TruthChoice(basis="pictures"))
    report = again.truths[session.manifest.name]
    assert report is not None
    assert report.world_frames >= 1
    assert not report.refused
