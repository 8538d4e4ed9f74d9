"""Rendered pictures of the markers, judged by the program's own marker detection."""

from __future__ import annotations

from functools import lru_cache

import cv2
import numpy as np
import pytest
from gtsam import Pose3, Rot3

from drivers.camera.aruco import FACE_DOWN, ObjectTracker
from drivers.camera.camera import Camera
from drivers.camera.detection import detect
from drivers.camera.frames import Frame, decode_image
from drivers.camera.markers import marker_corners
from drivers.camera.rendering.settings import CameraSettings
from drivers.camera.rendering.table_camera import PrintedMarker, TableCamera
from drivers.core.errors import ConfigurationError
from drivers.core.poses import transform_points
from drivers.simulation.calibration import SimulatedCalibration
from drivers.simulation.objects import CATALOGUE
from drivers.simulation.settings import ObjectStart, SimulationSettings
from drivers.simulation.world import SimulatedWorld

NOWHERE = np.array([[0.5, 0.5, 0.0], [0.51, 0.5, 0.0], [0.5, 0.51, 0.0]])
MARKER = PrintedMarker("DICT_4X4_50", 7, 0.05)
CALIBRATION = SimulatedCalibration.from_package()
PLACES = (
    (0.0, 0.0, 0.0),
    (-0.14, -0.14, 1.0),
    (-0.14, 0.14, -2.0),
    (0.1, -0.14, 3.0),
    (0.1, 0.14, -0.7),
    (-0.06, 0.04, 2.2),
)
MARKER_PLACES = tuple((0.85 * x, 0.85 * y, yaw) for x, y, yaw in PLACES)  # the larger marker needs more room


@lru_cache
def camera(**changes: float) -> TableCamera:
    settings = CameraSettings().model_copy(update=changes)
    return TableCamera(CALIBRATION.camera, settings, np.random.default_rng(0))


def on_table(x_m: float, y_m: float, yaw_rad: float, height_m: float = 0.0) -> Pose3:
    return Pose3(Rot3.Yaw(yaw_rad), np.array([x_m, y_m, height_m])) * FACE_DOWN


def seen(pose: Pose3, **changes: float) -> np.ndarray | None:
    image = camera(**changes).render(((MARKER, pose),), NOWHERE)
    return detect(image, MARKER.dictionary).get(MARKER.number)


@pytest.mark.parametrize("place", MARKER_PLACES)
def test_marker_is_seen_where_the_optics_put_it(place: tuple[float, float, float]) -> None:
    pose = on_table(*place)
    corners = seen(pose)
    assert corners is not None
    expected = camera().project(transform_points(pose, marker_corners(MARKER.side_m)))
    np.testing.assert_allclose(corners.mean(axis=0), expected.mean(axis=0), atol=0.12)
    np.testing.assert_allclose(
        corners, expected, atol=0.3
    )  # three rays a pixel: edges along the rows have steps of a third


def test_lifted_marker_looks_smaller() -> None:
    low, high = seen(on_table(0, 0, 0)), seen(on_table(0, 0, 0, height_m=0.1))
    assert low is not None
    assert high is not None
    ratio = np.ptp(high[:, 0]) / np.ptp(low[:, 0])
    assert ratio == pytest.approx(0.58 / 0.68, rel=0.02)


def test_tilted_marker_is_foreshortened() -> None:
    tilted = seen(Pose3(Rot3.Pitch(0.8), np.array([0.0, 0.0, 0.03])) * FACE_DOWN)
    assert tilted is not None
    assert np.ptp(tilted[:, 0]) / np.ptp(tilted[:, 1]) == pytest.approx(np.cos(0.8), abs=0.06)


def test_marker_that_faces_up_is_not_seen() -> None:
    image = camera(noise_levels=0.0).render(((MARKER, on_table(0, 0, 0) * FACE_DOWN),), NOWHERE)
    np.testing.assert_array_equal(image, camera(noise_levels=0.0).render((), NOWHERE))


def test_marker_outside_the_picture_is_not_seen() -> None:
    image = camera(noise_levels=0.0).render(((MARKER, on_table(2.0, 0, 0)),), NOWHERE)
    np.testing.assert_array_equal(image, camera(noise_levels=0.0).render((), NOWHERE))


def test_glass_shifts_what_is_seen_at_an_angle() -> None:
    point = np.array([[0.2, 0.0, 0.0]])
    bare, thick = camera(glass_thickness_m=0.0), camera(glass_thickness_m=0.01)
    straight, bent = bare.project(point)[0], thick.project(point)[0]
    tangent = 0.2 / 0.58
    sine = np.sin(np.arctan(tangent)) / 1.5
    shift_m = 0.01 * (tangent - np.tan(np.arcsin(sine)))
    assert (bent - straight)[0] == pytest.approx(shift_m * 773 / 0.58, rel=0.2)
    np.testing.assert_allclose(
        thick.project(np.array([[-0.005, -0.04, 0.0]])), bare.project(np.array([[-0.005, -0.04, 0.0]]))
    )


def test_foot_is_dark_and_lies_under_the_marker() -> None:
    foot = np.array([[-0.05, -0.03, 0], [0.05, -0.03, 0], [0.05, 0.03, 0], [-0.05, 0.03, 0]])
    view = camera(noise_levels=0.0)
    image = view.render(((PrintedMarker("DICT_4X4_50", 7, 0.035), on_table(0, 0, 0)),), foot)
    side, border, table = np.rint(view.project(np.array([[0.04, 0, 0], [0.0, 0.019, 0], [0.1, 0, 0]]))).astype(int)
    assert image[side[1], side[0]] == pytest.approx(70, abs=8)
    assert image[border[1], border[0]] > 180
    assert image[table[1], table[0]] == pytest.approx(148, abs=10)
    assert set(detect(image, "DICT_4X4_50")) == {7}


def test_noise_differs_from_picture_to_picture() -> None:
    view = camera(noise_levels=5.0)
    assert np.any(view.render((), NOWHERE) != view.render((), NOWHERE))


def test_lens_without_a_picture_size_is_refused() -> None:
    lens = CALIBRATION.camera.model_copy(update={"size_px": None})
    with pytest.raises(ConfigurationError, match="picture size is missing"):
        TableCamera(lens, CameraSettings(), np.random.default_rng(0))


def sightings(name: str, place: tuple[float, float, float], count: int = 2) -> tuple[np.ndarray, float]:
    """Error in the plane (m) and of the turn (rad) of the program's sighting of an object at rest."""
    x, y, yaw = place
    world = SimulatedWorld(SimulationSettings(object=name, start=ObjectStart(x_m=x, y_m=y, yaw_rad=yaw)), 1)
    device = Camera(world.transports()["camera"], world.clock)
    device.connect()
    tracker = ObjectTracker(world.calibration.camera, world.marker_settings)
    frames = [device.capture() for _ in range(count)]
    device.close()
    found = [tracker.observe(Frame(frame.stamp_ns, frame.image)).sighting for frame in frames][-1]
    assert found is not None
    error = world.truth().world_T_object.inverse() * found.world_T_object
    return np.array(error.translation()), float(Rot3.Logmap(error.rotation())[2])


@pytest.mark.parametrize("name", CATALOGUE)
def test_every_object_is_found_by_its_marker(name: str) -> None:
    shift_m, turn_rad = sightings(name, (0.02, -0.03, 0.4))
    limit_deg = 0.6 if name == "sphere" else 0.3
    assert np.hypot(*shift_m[:2]) < 0.001
    assert abs(shift_m[2]) < 1e-6
    assert abs(np.degrees(turn_rad)) < limit_deg


@pytest.mark.parametrize("place", PLACES)
def test_object_is_found_all_over_the_workspace(place: tuple[float, float, float]) -> None:
    shift_m, turn_rad = sightings("box-10x6x4", place)
    assert np.hypot(*shift_m[:2]) < 0.001
    assert abs(np.degrees(turn_rad)) < 0.3


def test_pictures_survive_the_encoding() -> None:
    image = camera().render(((MARKER, on_table(0, 0, 0.3)),), NOWHERE)
    decoded = decode_image(cv2.imencode(".jpg", image, [cv2.IMWRITE_JPEG_QUALITY, 90])[1].tobytes())
    assert np.mean(np.abs(decoded.astype(int) - image)) < 3.0
