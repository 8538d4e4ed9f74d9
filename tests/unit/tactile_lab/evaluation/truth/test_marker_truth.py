"""Truth recomputed from recorded corners, with another lens, and what is refused by name."""

from __future__ import annotations

import cv2
import numpy as np
import pytest
from gtsam import Pose3, Rot3

from drivers.camera.calibration import CameraCalibration
from drivers.camera.frames import Detection, Frame, SeenMarker
from drivers.camera.markers import MarkerSettings
from drivers.camera.packet import decode_packet, encode_packet
from drivers.core.contacts import Array
from drivers.core.poses import transform_points
from drivers.core.transports import Datagram
from tactile_lab.evaluation.truth.marker_truth import Basis, MarkerTruth, report_json

LENS = CameraCalibration(focal_px=(686.0, 687.0), centre_px=(322.8, 237.4), size_px=(640, 480))
WRONG = LENS.model_copy(update={"distortion": (-0.3, 0.1, 0.0, 0.0)})
WORLD_T_CAMERA = Pose3(Rot3.RzRyRx(0.07, -0.05, 0.02), np.array([0.05, 0.02, -0.45]))
MARKERS = MarkerSettings()


def frame(number: int, pose: Pose3 | None, *, bump_px: float = 0.0, blur_px: float = 0.8) -> Datagram:
    """Corners of the world marker and of the object's, with a fixed bit of noise."""
    rng = np.random.default_rng(number)
    found = {0: _seen(MARKERS.world_T_worldmarker.pose(), MARKERS.world_corners_m, rng, bump_px, blur_px)}
    if pose is not None:
        marker = pose * MARKERS.object_T_objectmarker.pose()
        found[7] = _seen(marker, MARKERS.object_corners_m, rng, 0.0, blur_px)
    packet = encode_packet(Frame(0, None, number, detection=Detection("DICT_4X4_50", (640, 480), found)))
    return Datagram(packet, 1_000_000 * number)


def _seen(world_T_marker: Pose3, corners: Array, rng: np.random.Generator, bump: float, blur: float) -> SeenMarker:
    pixels = LENS.project(transform_points(WORLD_T_CAMERA.inverse() * world_T_marker, corners))
    return SeenMarker(pixels + bump + 0.05 * rng.standard_normal((4, 2)), blur)


def poses(count: int) -> list[Pose3]:
    return [Pose3(Rot3.Yaw(0.2 * n), np.array([0.10 - 0.004 * n, 0.05, 0.0])) for n in range(count)]


def test_every_grasp_gets_its_pose_with_the_world_marker_averaged_over_all_frames() -> None:
    recorded = [frame(number, pose) for number, pose in enumerate(poses(12), start=1)]
    truth = MarkerTruth(LENS, MARKERS, recorded)
    for datagram, pose in zip(recorded, poses(12), strict=True):
        found = truth(datagram)
        assert found is not None
        assert np.linalg.norm(found.translation() - pose.translation()) < 5e-4
    report = report_json(truth.report)
    assert (report["frames"], report["world_frames"], report["refused"]) == (12, 12, {})
    assert report["world_reprojection_px"] < 0.1
    assert 0.2 < report["position_sigma_mm"] < 1.0


def test_another_lens_gives_another_truth_from_the_same_corners() -> None:
    recorded = [frame(number, pose) for number, pose in enumerate(poses(4), start=1)]
    right, wrong = (MarkerTruth(lens, MARKERS, recorded)(recorded[0]) for lens in (LENS, WRONG))
    assert right is not None
    assert wrong is not None
    assert np.linalg.norm(right.translation() - wrong.translation()) > 1e-4


def test_frames_after_a_bump_are_refused_and_those_before_it_kept() -> None:
    recorded = [frame(n, pose, bump_px=6.0 if n > 6 else 0.0) for n, pose in enumerate(poses(12), start=1)]
    truth = MarkerTruth(LENS, MARKERS, recorded)
    known = [truth(datagram) is not None for datagram in recorded]
    assert known == [True] * 6 + [False] * 6
    assert truth.report.world_frames == 6
    assert any("moved" in reason for reason in truth.report.refused)
    assert sum(truth.report.refused.values()) == 6


def test_blurred_frames_frames_without_the_object_and_damaged_ones_are_told_apart() -> None:
    pose = poses(1)[0]
    recorded = [frame(1, pose), frame(2, None), frame(3, pose, blur_px=5.0)]
    damaged = Datagram(recorded[0].payload[:-3], 4_000_000)
    truth = MarkerTruth(LENS, MARKERS, [*recorded, damaged])
    assert [truth(datagram) is not None for datagram in [*recorded, damaged]] == [True, False, False, False]
    reasons = " | ".join(truth.report.refused)
    assert "marker 7 is not visible" in reasons
    assert "blurred" in reasons
    assert "cannot be read" in reasons


@pytest.mark.parametrize("changes", [{"dictionary": "DICT_5X5_50"}, {"object_id": 3}])
def test_markers_that_are_not_those_recorded_give_no_truth_and_say_why(changes: dict[str, object]) -> None:
    recorded = [frame(1, poses(1)[0])]
    truth = MarkerTruth(LENS, MARKERS.model_copy(update=changes), recorded)
    assert truth(recorded[0]) is None
    assert list(truth.report.refused.values()) == [1]


def test_pictures_are_looked_at_again_where_that_is_asked_for() -> None:
    """The picture shows nothing of what its recorded corners say."""
    corners = frame(1, poses(1)[0])
    black = cv2.imencode(".png", np.zeros((480, 640), np.uint8))[1].tobytes()
    pictured = Datagram(encode_packet(decode_packet(corners), black), 2_000_000)
    bases: tuple[Basis, ...] = ("corners", "pictures")
    seen = {basis: MarkerTruth(LENS, MARKERS, [corners, pictured], basis)(pictured) for basis in bases}
    assert seen["corners"] is not None
    assert seen["pictures"] is None
