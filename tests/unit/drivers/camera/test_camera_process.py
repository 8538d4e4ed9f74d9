"""The camera in a process of its own, with the simulated camera in it."""

from __future__ import annotations

import os
import signal
from collections.abc import Iterator
from pathlib import Path

import cv2
import numpy as np
import pytest

from drivers.camera.camera import Camera, CameraDeviceSettings
from drivers.camera.camera_process import CameraProcess
from drivers.camera.source_settings import CameraSourceSettings
from drivers.core.clock import MonotonicClock
from drivers.core.errors import CodecError, ConfigurationError, DeviceError

PATIENT = CameraDeviceSettings(timeout_ms=20_000.0)


@pytest.fixture
def transport() -> Iterator[CameraProcess]:
    process = CameraProcess("camera", CameraSourceSettings(source="simulated", size_px=(320, 240)))
    process.open()
    yield process
    process.close()
    process.close()


def test_every_frame_sends_its_corners_a_trigger_brings_a_picture_and_all_are_counted(transport: CameraProcess) -> None:
    camera = Camera(transport, MonotonicClock(), PATIENT)
    camera.connect()
    frames = [camera.capture() for _ in range(2)]
    assert all(frame.image is not None and frame.image.shape == (240, 320) for frame in frames)
    assert frames[1].counter > frames[0].counter
    assert frames[1].stamp_ns > frames[0].stamp_ns
    assert frames[0].detection is not None
    assert sorted(frames[0].detection.markers) == [0, 7]
    assert camera.health() == ()
    packets = []
    while len(packets) < 3:
        packets += transport.receive()
    unasked = [camera.receive(packet) for packet in packets]
    assert all(frame.image is None and frame.detection is not None for frame in unasked)
    assert all(len(packet.payload) < 200 for packet in packets)
    camera.poll()
    report = transport.report()
    assert report["frames"] > 0
    assert report["markers"] == 2 * report["frames"]
    assert report["dropped_blocks"] == 0


def test_only_triggers_are_taken() -> None:
    transport = CameraProcess("camera", CameraSourceSettings(source="simulated"))
    with pytest.raises(CodecError, match="not a trigger"):
        transport.send(b"SMILE")


def test_the_end_of_the_pictures_is_told_in_words(tmp_path: Path) -> None:
    cv2.imwrite(str(tmp_path / "one.png"), np.zeros((48, 64), np.uint8))
    transport = CameraProcess("camera", CameraSourceSettings(source=str(tmp_path)))
    with pytest.raises(DeviceError, match="has ended"):
        _until_it_ends(transport)
    transport.close()


def _until_it_ends(transport: CameraProcess) -> None:
    transport.open()
    while True:
        transport.receive()


def test_a_process_that_stands_still_or_is_killed_is_told(transport: CameraProcess) -> None:
    camera = Camera(transport, MonotonicClock())
    camera.connect()
    for way, words in ((signal.SIGSTOP, "no picture within 1000 ms"), (signal.SIGKILL, "its process has ended")):
        os.kill(transport._child.process_id, way)
        with pytest.raises(DeviceError, match=f"camera: {words}"):
            camera.capture()
    camera.close()


def test_a_camera_that_can_not_be_opened_says_so_before_anything_runs(tmp_path: Path) -> None:
    transport = CameraProcess("camera", CameraSourceSettings(source="/dev/video99"))
    with pytest.raises(DeviceError, match="cannot be opened"):
        transport.open()
    with pytest.raises(DeviceError, match="not connected"):
        transport.receive()
    with pytest.raises(ConfigurationError, match="no such camera"):
        CameraProcess("camera", CameraSourceSettings(source=str(tmp_path / "nothing"))).open()
