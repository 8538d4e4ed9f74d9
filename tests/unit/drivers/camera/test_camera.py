"""The triggered camera, its pictures and its lens."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from drivers.camera.calibration import CameraCalibration, load_camera
from drivers.camera.camera import TRIGGER, Camera, CameraDeviceSettings
from drivers.camera.frames import decode_image
from drivers.core.clock import VirtualClock
from drivers.core.errors import CodecError, ConfigurationError, DeviceError
from drivers.core.transports import Datagram, ReplayTransport

PICTURE = np.arange(48 * 64, dtype=np.int64).reshape(48, 64).astype(np.uint8)


def encoded(kind: str) -> bytes:
    return bytes(cv2.imencode(kind, PICTURE)[1].tobytes())


@pytest.mark.parametrize("kind", [".png", ".jpg"])
def test_a_trigger_brings_a_picture(kind: str) -> None:
    transport = ReplayTransport("camera", [[], [], [Datagram(encoded(kind), 77)]])
    camera = Camera(transport, VirtualClock())
    camera.connect()
    camera.connect()
    frame = camera.capture()
    camera.close()
    camera.close()
    assert transport.sent == [TRIGGER]
    assert (frame.stamp_ns, frame.image.shape, frame.image.dtype) == (77, (48, 64), np.uint8)
    if kind == ".png":
        np.testing.assert_array_equal(frame.image, PICTURE)


def test_a_picture_is_waited_for_from_look_to_look_and_polling_does_not_lose_it() -> None:
    transport = ReplayTransport("camera", [[], [], [], [Datagram(encoded(".png"), 5)], [], []])
    camera = Camera(transport, VirtualClock())
    with pytest.raises(DeviceError, match="no picture was requested"):
        camera.take_picture()
    camera.ask()
    assert camera.take_picture() is None
    camera.poll()
    camera.poll()
    frame = camera.take_picture()
    assert frame is not None
    assert frame.stamp_ns == 5
    camera.poll()
    with pytest.raises(DeviceError, match="no picture was requested"):
        camera.take_picture()


def test_a_late_picture_of_an_earlier_trigger_is_left_out() -> None:
    transport = ReplayTransport("camera", [[Datagram(encoded(".jpg"), 1)], [Datagram(encoded(".png"), 2)]])
    assert Camera(transport, VirtualClock()).capture().stamp_ns == 2


def test_a_silent_camera_is_an_error_after_the_time_out() -> None:
    clock = VirtualClock()
    camera = Camera(ReplayTransport("camera", [[] for _ in range(100)]), clock, CameraDeviceSettings(timeout_ms=50))
    with pytest.raises(DeviceError, match="no picture within 50 ms"):
        camera.capture()
    assert 50e6 <= clock.now_ns() < 60e6


@pytest.mark.parametrize(
    ("payload", "complaint"),
    [
        (b"", "neither JPEG nor PNG"),
        (b"GIF89a", "neither"),
        (encoded(".jpg")[:-200], "JPEG truncated"),
        (encoded(".png")[:-5], "PNG truncated"),
        (b"\xff\xd8\xff\xd9", "without a size"),
        (encoded(".png")[:16] + b"\x7f\xff\xff\xff" * 2 + encoded(".png")[24:], "2147483647 x 2147483647"),
        (encoded(".png")[:16] + b"\x00" * 8 + encoded(".png")[24:], "0 x 0"),
        (encoded(".png")[:33] + b"\x40\x00\x00\x00" + encoded(".png")[37:], "parts are longer than it is"),
    ],
)
def test_a_damaged_picture_is_a_codec_error(payload: bytes, complaint: str) -> None:
    with pytest.raises(CodecError, match=complaint):
        decode_image(payload)


@settings(max_examples=60, derandomize=True, deadline=None)
@given(st.sampled_from([encoded(".png"), encoded(".jpg")]), st.integers(0, 400), st.binary(min_size=1, max_size=8))
def test_bytes_overwritten_anywhere_decode_or_raise_a_codec_error(whole: bytes, at: int, damage: bytes) -> None:
    try:
        image = decode_image(whole[:at] + damage + whole[at + len(damage) :], largest_pixels=100_000)
    except CodecError:
        return
    assert image.ndim == 2


def test_opencv_calibrations_load(lab_data: Path) -> None:
    folder = lab_data / "aruco_photos"
    plain, sized = (load_camera(folder / f"tutorial_camera_{name}.yml") for name in ("params", "charuco"))
    assert plain.focal_px == (628.158, 628.156)
    assert plain.centre_px == (324.099, 260.908)
    assert plain.distortion == (0.0995485, -0.206384, 0.00754589, 0.00336531, 0.0)
    assert plain.size_px is None
    assert sized.size_px == (640, 480)


def test_our_own_calibration_loads_and_pixels_and_rays_are_inverse(tmp_path: Path) -> None:
    (tmp_path / "camera.yaml").write_text(
        "focal_px: [686.0, 687.0]\ncentre_px: [322.8, 237.4]\ndistortion: [-0.12, 0.06, 8e-4, -6e-4, 0]\n"
        "size_px: [640, 480]\n"
    )
    camera = load_camera(tmp_path / "camera.yaml")
    pixels = np.array([[10.0, 20.0], [322.8, 237.4], [600.0, 400.0]])
    np.testing.assert_allclose(camera.project(0.45 * camera.rays(pixels)), pixels, atol=0.01)
    np.testing.assert_allclose(camera.rays(pixels[1:2]), [[0, 0, 1]], atol=1e-9)


def test_without_distortion_a_ray_is_a_pinhole_ray() -> None:
    camera = CameraCalibration(focal_px=(500, 400), centre_px=(320, 240))
    np.testing.assert_allclose(camera.rays(np.array([[420.0, 200.0]])), [[0.2, -0.1, 1.0]])


@pytest.mark.parametrize(
    ("text", "complaint"),
    [
        ("focal_px: [0, 1]\ncentre_px: [1, 1]\n", "focal"),
        ("focal_px: [1, 1]\ncentre_px: [1, 1]\ndistortion: [1]\n", "distortion"),
        ("focal_px: [1, .nan]\ncentre_px: [1, 1]\n", "focal"),
        ("%YAML:1.0\n---\nimage_width: 4\n", "camera_matrix"),
        ("%YAML:1.0\n---\ncamera_matrix: [\n", "not valid YAML"),
    ],
)
def test_a_damaged_calibration_is_refused(tmp_path: Path, text: str, complaint: str) -> None:
    (tmp_path / "camera.yaml").write_text(text)
    with pytest.raises(ConfigurationError, match=complaint):
        load_camera(tmp_path / "camera.yaml")


def test_a_missing_calibration_is_refused(tmp_path: Path) -> None:
    with pytest.raises(ConfigurationError, match="cannot be read"):
        load_camera(tmp_path / "none.yaml")
