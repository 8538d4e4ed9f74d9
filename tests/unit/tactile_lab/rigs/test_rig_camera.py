"""The camera that a rig file names: from the words in the file to frames in the session's recording."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest
import yaml

from drivers.camera.camera import Camera
from drivers.camera.packet import decode_packet
from drivers.camera.rendering.board_camera import table_pictures
from drivers.camera.source_settings import CameraSourceSettings
from drivers.core.clock import NANOSECONDS, MonotonicClock
from drivers.core.errors import ConfigurationError, DeviceError
from drivers.core.transports import Datagram
from drivers.emulators.laboratory.emulated_laboratory import SERIAL
from sessions.recording.recorder import Recorder
from sessions.recording.traffic import schemas
from tactile_lab.rigs.build import check_calibration
from tactile_lab.rigs.description import Rig, load_rig
from tactile_lab.rigs.wired import camera_source, emulation_plan, wires_of
from tactile_lab.rigs.wired_runtime import build_wired_runtime
from tactile_lab.rigs.wires import LocalCamera
from tests.support.wire_rig import wire_rig

PATIENCE_ns = 60 * NANOSECONDS


class Kept:
    """Keeps what the camera sent, as it goes into the recording."""

    def __init__(self) -> None:
        self.packets: list[bytes] = []
        self.pictures = 0

    def write(self, topic: str, data: bytes, stamp_ns: int) -> None:
        if topic == schemas.received_topic("camera"):
            self.packets.append(data)
        self.pictures += topic == schemas.IMAGE_TOPIC


def rig_with(folder: Path, **settings: Any) -> Rig:
    path = wire_rig(folder)
    content = yaml.safe_load(path.read_text())
    content["wires"]["camera"] = {"wire": "source", "settings": settings}
    path.write_text(yaml.safe_dump(content))
    return load_rig(str(path))


def source_of(rig: Rig) -> CameraSourceSettings:
    wiring = wires_of(rig).camera
    assert isinstance(wiring, LocalCamera)
    return camera_source(rig, wiring)


@pytest.fixture
def pictures(tmp_path: Path) -> Path:
    folder = tmp_path / "pictures"
    folder.mkdir()
    drawn = table_pictures(CameraSourceSettings(size_px=(320, 240)), 3, np.random.default_rng(0))
    for number, image in enumerate(drawn):
        cv2.imwrite(str(folder / f"{number}.png"), image)
    return folder


def test_pictures_beside_the_rig_file_reach_the_recording(tmp_path: Path, pictures: Path) -> None:
    rig = rig_with(tmp_path, source="pictures", rate_hz=20, repeat=True)
    check_calibration(rig)
    assert source_of(rig).source == str(pictures)
    clock, kept = MonotonicClock(), Kept()
    camera = build_wired_runtime(rig, Recorder(kept), clock).camera
    assert isinstance(camera, Camera)
    camera.connect()
    try:
        camera.ask()
        until_ns, picture = clock.now_ns() + PATIENCE_ns, None
        while (len(kept.packets) < 5 or picture is None) and clock.now_ns() < until_ns:
            if picture is None:
                picture = camera.take_picture()
            camera.poll()
            clock.sleep_until_ns(clock.now_ns() + 10_000_000)
    finally:
        camera.close()
    frames = [decode_packet(Datagram(packet, 0)) for packet in kept.packets]
    assert len(frames) >= 5  # the folder holds three: it was begun again
    assert all(frame.detection is not None and set(frame.detection.markers) == {0, 7} for frame in frames)
    assert [frame.counter for frame in frames] == list(range(1, len(frames) + 1))
    assert (picture is not None, kept.pictures) == (True, 1)


def test_the_end_of_the_pictures_ends_the_session_in_words(tmp_path: Path, pictures: Path) -> None:
    camera = build_wired_runtime(rig_with(tmp_path, source="pictures"), Recorder(Kept()), MonotonicClock()).camera
    assert isinstance(camera, Camera)
    camera.connect()
    with pytest.raises(DeviceError, match="has ended"):
        _poll_until_it_ends(camera)
    camera.close()


def _poll_until_it_ends(camera: Camera) -> None:
    while True:
        camera.poll()


@pytest.mark.parametrize("source", ["simulated:table", "0", "/dev/video2", "gstreamer:videotestsrc ! appsink"])
def test_what_the_lens_and_the_markers_say_need_not_be_said_again(tmp_path: Path, source: str) -> None:
    known = source_of(rig_with(tmp_path, source=source))
    assert (known.source, known.size_px, known.dictionary) == (source, (640, 480), "DICT_4X4_50")


@pytest.mark.parametrize(
    ("settings", "words"),
    [
        (
            {"source": "simulated", "size_px": [320, 240]},
            "takes pictures of 320 x 240 pixels, but the lens was calibrated",
        ),
        (
            {"source": "simulated", "dictionary": "DICT_5X5_50"},
            "detects DICT_5X5_50, but the markers are from DICT_4X4_50",
        ),
        ({"source": "nowhere"}, "no such camera, folder or file"),
    ],
)
def test_a_camera_that_can_not_be_right_is_refused_before_anything_moves(
    tmp_path: Path, settings: dict[str, Any], words: str
) -> None:
    with pytest.raises(ConfigurationError, match=words):
        check_calibration(rig_with(tmp_path, **settings))


def test_a_camera_without_a_lens_is_refused(tmp_path: Path) -> None:
    path = wire_rig(tmp_path)
    content = yaml.safe_load(path.read_text())
    del content["calibration"]["camera"], content["calibration"]["markers"]
    path.write_text(yaml.safe_dump(content))
    with pytest.raises(ConfigurationError, match=r"wires\.camera needs calibration\.camera"):
        load_rig(str(path))


def test_stand_ins_leave_a_camera_of_this_computer_alone(tmp_path: Path) -> None:
    plan = emulation_plan(rig_with(tmp_path, source="simulated:table"), 0, "cube-6")
    assert plan.camera is None
    assert plan.hand.serial == SERIAL
