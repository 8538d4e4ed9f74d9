"""Pictures and what is read from them, in numbers: drawn boards, edges, markers, poses, prints, and packets."""

from __future__ import annotations

from typing import Any

import cv2
import numpy as np
import pytest
from gtsam import Pose3, Rot3

from drivers.camera.aruco import ObjectTracker
from drivers.camera.boards import AnyBoard, CharucoBoard, GridBoard, SingleMarker
from drivers.camera.calibration import CameraCalibration
from drivers.camera.detection import detection
from drivers.camera.edges import refine_square
from drivers.camera.frames import Detection, Frame, Image, SeenMarker
from drivers.camera.glass import Glass
from drivers.camera.markers import MarkerSettings
from drivers.camera.packet import encode_packet
from drivers.camera.pose.board_pose import board_pose, pose_covariance
from drivers.camera.pose.square_pose import marker_poses
from drivers.camera.printing.print_files import svg_text
from drivers.camera.printing.print_layout import sheet_of
from drivers.camera.rendering.board_camera import board_poses, draw_board, simulated_lens
from drivers.camera.rendering.settings import CameraSettings
from drivers.camera.rendering.table_camera import PrintedMarker, TableCamera
from drivers.camera.targets.april_grid import AprilGrid
from drivers.camera.targets.chessboard import Chessboard
from drivers.camera.world_marker import WorldMarker
from drivers.core.fingertip import RigidTransform
from drivers.core.poses import transform_points
from tests.support.baseline import assert_baseline
from tests.support.digest import digest
from tests.support.plain_values import plain

LENS, SMALL = simulated_lens((640, 480)), simulated_lens((320, 240))
BOARDS: dict[str, AnyBoard] = {
    "single": SingleMarker(number=3, measured_bar_mm=100.4),
    "grid": GridBoard(columns=3, rows=4, first_number=2),
    "charuco": CharucoBoard(),
    "chessboard": Chessboard(columns=8, rows=6),
    "april": AprilGrid(columns=4, rows=3, measured_bar_mm=99.7),
    "april-narrow": AprilGrid(columns=3, rows=4, border=1, first_number=5),
}
MARKERS = MarkerSettings(
    world_T_worldmarker=RigidTransform(translation_m=(0.12, 0.02, 0.0), rpy_rad=(float(np.pi), 0.0, 0.3)),
    object_T_objectmarker=RigidTransform(translation_m=(0.01, -0.005, -0.02), rpy_rad=(float(np.pi), 0.0, 0.5)),
    glass_thickness_m=0.006,
    print_scale=1.002,
)


def grey(image: Image) -> list[float]:
    """A picture as the mean and spread of its grey levels, and the levels along two lines."""
    return [float(image.mean()), float(image.std()), *image[::60, ::80].ravel().astype(float)]


@pytest.mark.parametrize("name", BOARDS)
def test_boards_drawn_read_and_printed(name: str) -> None:
    board, rng = BOARDS[name], np.random.default_rng(7)
    pose = board_poses(board, SMALL, 2, rng)[-1]
    image = draw_board(board, pose, SMALL, rng)
    points, pixels = board.match_corners(image)
    sheet = sheet_of([board], "A3", ["on the table"])
    told: dict[str, Any] = {
        "pose": plain(pose),
        "size": [board.size_m, board.point_count, board.pattern, board.scale],
        "corners": [len(points), digest(points)],
        "sheet": [sheet.size_mm, [digest(np.vstack(area.outlines)) for area in sheet.areas]],
        "words": plain([sheet.lines, sheet.words]),
        "svg": digest(list(svg_text(sheet).encode())),
    }
    assert_baseline(f"camera/board_{name}", told)
    seen = {"grey": grey(image), "pixels": pixels[::5], "blurs": board.blurs_px(image)[:4]}
    assert_baseline(f"camera/board_{name}_seen", seen, atol=1.1)
    corners = np.array([[x, y, 0.0] for x in (-0.1, 0.0, 0.12) for y in (-0.08, 0.09)])
    exact = board_pose(corners, SMALL.project(transform_points(pose, corners)), SMALL, corner_sigma_px=0.2)
    assert_baseline(f"camera/board_{name}_pose", {"exact": plain(exact)}, rtol=1e-3, atol=1e-9)


def test_sheets_of_several_prints() -> None:
    sheet = sheet_of([SingleMarker(number=0), SingleMarker(number=7, side_m=0.04), GridBoard(columns=2, rows=2)], "A4")
    told = plain([sheet.size_mm, sheet.lines, sheet.words])
    areas = [[digest(outline) for outline in area.outlines] for area in sheet.areas]
    assert_baseline(
        "camera/sheet", {"sheet": told, "areas": areas, "rectangles": [line.area_mm for line in sheet.lines]}
    )


def square(blur_px: float, turn_rad: float, beyond: int) -> tuple[Image, np.ndarray]:
    """Marker 7 with half a module of white in a small picture, and its corners."""
    bits = cv2.aruco.generateImageMarker(cv2.aruco.getPredefinedDictionary(cv2.aruco.DICT_4X4_50), 7, 120)
    tile = np.where(np.pad(bits, 10, constant_values=255) > 127, 235, 20).astype(np.float32)
    half = 24.0 * np.array([[-0.9, -1], [0.9, -1], [1, 1], [-1, 1]])
    cosine, sine = np.cos(turn_rad), np.sin(turn_rad)
    corners = half @ np.array([[cosine, sine], [-sine, cosine]]) + [64.3, 63.8]
    inner = np.array([[10, 10], [130, 10], [130, 130], [10, 130]], np.float32) - 0.5
    warp = cv2.getPerspectiveTransform(inner, ((corners + 0.5) * 4 - 0.5).astype(np.float32))
    fine = cv2.warpPerspective(tile, warp, (512, 512), borderValue=float(beyond))
    coarse = cv2.resize(cv2.GaussianBlur(fine, (0, 0), 4 * blur_px), (128, 128), interpolation=cv2.INTER_AREA)
    noisy = coarse + 2.0 * np.random.default_rng(1).standard_normal(coarse.shape)
    return np.clip(noisy, 0, 255).astype(np.uint8), corners


def test_edges_of_squares() -> None:
    cases = [(0.5, 0.2, 150), (1.0, -0.7, 40), (1.6, 1.4, 200), (2.4, 0.05, 120)]
    found = {}
    for case in cases:
        image, corners = square(*case)
        for off in (0.0, 0.8):
            seen = refine_square(image, corners.mean(axis=0) + (1 - off / 30) * (corners - corners.mean(axis=0)), 6)
            found[f"{case} {off}"] = [seen.corners_px, seen.blur_px]
    assert_baseline("camera/edges", found, rtol=0.0, atol=5e-3)


def test_objects_under_the_markers_of_pictures() -> None:
    view = TableCamera(LENS, CameraSettings(glass_thickness_m=0.006), np.random.default_rng(3))
    world = PrintedMarker(MARKERS.dictionary, MARKERS.world_id, MARKERS.world_side_m)
    target = PrintedMarker(MARKERS.dictionary, MARKERS.object_id, MARKERS.object_side_m)
    poses = {
        "flat": Pose3(Rot3.Yaw(0.4), np.array([-0.02, 0.01, 0.02])),
        "lifted": Pose3(Rot3.Yaw(2.0), np.array([0.01, 0.03, 0.05])),
        "tilted": Pose3(Rot3.Ypr(1.0, 0.3, 0.1), np.array([-0.03, -0.02, 0.03])),
        "aside": Pose3(Rot3(), np.array([0.9, 0.0, 0.02])),
    }
    found: dict[str, Any] = {}
    pictures: dict[str, Any] = {}
    free = MARKERS.model_copy(update={"freedom": "spatial"})
    trackers = {"planar": ObjectTracker(LENS, MARKERS), "spatial": ObjectTracker(LENS, free)}
    foot = np.array([[-0.04, -0.03, -0.02], [0.04, -0.03, -0.02], [0, 0.04, -0.02]])
    for number, (name, pose) in enumerate(poses.items()):
        under = pose * MARKERS.object_T_objectmarker.pose()
        placed = ((world, MARKERS.world_T_worldmarker.pose()), (target, under))
        image = view.render(placed, transform_points(pose, foot))
        pictures[name] = grey(image)
        for freedom, tracker in trackers.items():
            found[f"{name} {freedom}"] = plain(tracker.observe(Frame(number, image)))
    assert_baseline("camera/table_pictures", pictures, atol=1.1)
    assert_baseline("camera/sightings", found, rtol=2e-2, atol=1e-8)


def test_poses_from_exact_corners() -> None:
    pose = Pose3(Rot3.Ypr(0.2, -0.4, 2.9), np.array([0.02, -0.03, 0.4]))
    points = MARKERS.object_corners_m
    pixels = LENS.project(transform_points(pose, points))
    tracker = ObjectTracker(LENS, MARKERS)
    corners = np.array([[300.0, 200], [380, 200], [380, 280], [300, 280]])
    marker = WorldMarker(LENS, MARKERS)
    words = [marker.add(corners + shift) for shift in (0.0, 0.2, -0.1, 3.0, 0.1, 5.0, 5.1, 5.0, 5.05, 0.0)]
    free = ObjectTracker(LENS, MARKERS.model_copy(update={"freedom": "spatial"}))
    sightings = []
    for each in (tracker, free):
        each.world.add(corners)
        sightings.append(plain(each.sighting(7, corners * 0.5 + [100.0, 150.0])))
    camera = np.array([[0.1, -0.05, 0.5], [-0.2, 0.1, 0.9], [0.0, 0.0, 0.3]])
    glass = Glass(0.01, 1.52)
    found = {
        "markers": plain(marker_poses(pixels, MARKERS.object_side_m * MARKERS.print_scale, LENS)),
        "covariance": 1e6 * pose_covariance(pose, points, LENS, 0.1),
        "words": words,
        "world": [marker.frames, marker.corners_px, plain(marker.camera_T_world()), marker.reprojection_px()],
        "apparent": plain(marker.apparent_corners_m(pose)),
        "sightings": sightings,
        "lens": [LENS.rays(pixels), LENS.project(camera), *LENS.projection(camera), LENS.matrix],
        "glass": [glass.shift(camera[:, :2] / 0.4), glass.apparent(camera, np.array([0.0, 0.1, -0.5]))],
    }
    assert_baseline("camera/poses", found, rtol=1e-4, atol=4e-7)


def test_the_bytes_of_a_packet() -> None:
    marker = SeenMarker(np.arange(8.0).reshape(4, 2) + 0.25, 0.8)
    frame = Frame(5, None, 17, 3, Detection("DICT_5X5_100", (640, 480), {9: marker, 2: marker}))
    empty = detection(np.full((90, 120), 180, np.uint8), "DICT_4X4_50")
    lens = CameraCalibration(focal_px=(5.0, 6.0), centre_px=(1.0, 2.0))
    found = {"packet": encode_packet(frame, b"picture").hex(), "empty": plain(empty), "lens": plain(lens)}
    assert_baseline("camera/packet", found)
