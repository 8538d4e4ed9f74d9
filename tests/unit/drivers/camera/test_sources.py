"""Pictures from devices, folders and videos; a V4L2 camera is stood for by a driver with whims of its own."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest

from drivers.camera.source_settings import CameraSourceSettings, place_of
from drivers.camera.sources import FolderSource, OpenCvSource, open_source
from drivers.core.clock import NANOSECONDS, VirtualClock
from drivers.core.errors import ConfigurationError, DeviceError

PERIOD_ns = NANOSECONDS // 30


class Driver:
    """What ``cv2.VideoCapture`` is for a V4L2 camera."""

    def __init__(
        self, clock: VirtualClock, sizes: list[tuple[int, int]], gaps: list[int], stubborn: tuple[int, ...] = ()
    ):
        self.clock, self.sizes, self.gaps, self.stubborn = clock, list(sizes), list(gaps), stubborn
        self.properties: dict[int, float] = {}
        self.asked: tuple[Any, ...] = ()
        self.released = False

    def __call__(self, *asked: Any) -> Driver:
        self.asked = asked
        return self

    def isOpened(self) -> bool:
        return bool(self.sizes)

    def set(self, key: int, value: float) -> bool:
        if key in self.stubborn:
            return False
        self.properties[key] = value
        return True

    def get(self, key: int) -> float:
        return self.properties.get(key, -1.0)

    def grab(self) -> bool:
        if not self.gaps:
            return False
        self.clock.sleep_until_ns(self.clock.now_ns() + self.gaps.pop(0) * PERIOD_ns)
        return True

    def retrieve(self) -> tuple[bool, Any]:
        width, height = self.sizes.pop(0)
        return True, np.full((height, width, 3), 9, np.uint8)

    def release(self) -> None:
        self.released = True


def device(driver: Driver, **settings: Any) -> OpenCvSource:
    wanted = CameraSourceSettings(source="2", size_px=(64, 48), **settings)
    source = OpenCvSource(wanted, driver.clock, driver)
    source.open()
    return source


def test_a_device_is_opened_with_everything_held_fixed() -> None:
    driver = Driver(VirtualClock(), [(64, 48)], [1])
    source = device(driver, exposure_ms=4.0, focus=30.0, gain=2.0)
    assert driver.asked == (2, cv2.CAP_V4L2)
    assert driver.properties[cv2.CAP_PROP_AUTOFOCUS] == 0.0
    assert driver.properties[cv2.CAP_PROP_AUTO_EXPOSURE] == 1.0
    assert driver.properties[cv2.CAP_PROP_EXPOSURE] == 40.0
    assert driver.properties[cv2.CAP_PROP_FOCUS] == 30.0
    assert driver.properties[cv2.CAP_PROP_GAIN] == 2.0
    assert source.notes() == ()
    source.close()
    source.close()
    assert driver.released


def test_what_the_driver_does_not_take_is_told() -> None:
    driver = Driver(VirtualClock(), [(64, 48)], [1], stubborn=(cv2.CAP_PROP_EXPOSURE, cv2.CAP_PROP_AUTOFOCUS))
    notes = device(driver, exposure_ms=4.0).notes()
    assert any("automatic focus" in note for note in notes)
    assert any("does not accept exposure 40 (it stays -1)" in note for note in notes)


def test_frames_are_stamped_numbered_and_lost_ones_counted() -> None:
    driver = Driver(VirtualClock(), [(64, 48)] * 4, [1, 1, 3, 1])
    source = device(driver)
    pictures = [source.read() for _ in range(4)]
    assert [picture.stamp_ns // PERIOD_ns for picture in pictures if picture] == [1, 2, 5, 6]
    assert [picture.counter for picture in pictures if picture] == [1, 2, 5, 6]
    assert [picture.dropped for picture in pictures if picture] == [0, 0, 2, 2]
    assert pictures[0] is not None
    assert pictures[0].image.shape == (48, 64)


def test_a_camera_that_changes_its_resolution_is_an_error() -> None:
    source = device(Driver(VirtualClock(), [(64, 48), (32, 24)], [1, 1]))
    source.read()
    with pytest.raises(DeviceError, match=r"32 x 24 pixels instead of 64 x 48.*calibrate"):
        source.read()


def test_a_camera_that_never_takes_the_wanted_resolution_is_an_error() -> None:
    with pytest.raises(DeviceError, match="80 x 60 pixels instead of 64 x 48"):
        device(Driver(VirtualClock(), [(80, 60)], [1])).read()


def test_a_camera_that_falls_silent_is_an_error() -> None:
    with pytest.raises(DeviceError, match="delivers no more pictures"):
        device(Driver(VirtualClock(), [(64, 48)], [])).read()


def test_a_camera_that_can_not_be_opened_is_an_error() -> None:
    with pytest.raises(DeviceError, match=r"camera 2: cannot be opened.*permissions"):
        device(Driver(VirtualClock(), [], []))


def test_a_pipeline_without_gstreamer_is_an_error_that_says_so() -> None:
    if "GStreamer:                   YES" in cv2.getBuildInformation():
        pytest.skip("this OpenCV has GStreamer")
    with pytest.raises(DeviceError, match="built without GStreamer"):
        open_source(CameraSourceSettings(source="gstreamer:videotestsrc ! appsink"), VirtualClock())


def write_pictures(folder: Path, sizes: list[tuple[int, int]]) -> None:
    for number, (width, height) in enumerate(sizes):
        cv2.imwrite(str(folder / f"{number:03}.png"), np.full((height, width), number, np.uint8))


def test_a_folder_gives_its_pictures_in_the_order_of_their_names(tmp_path: Path) -> None:
    write_pictures(tmp_path, [(64, 48)] * 3)
    (tmp_path / "notes.txt").write_text("not a picture")
    source = open_source(CameraSourceSettings(source=str(tmp_path)), VirtualClock())
    assert isinstance(source, FolderSource)
    found = [source.read() for _ in range(4)]
    assert [None if picture is None else int(picture.image[0, 0]) for picture in found] == [0, 1, 2, None]
    source.close()
    assert source.notes() == ()
    assert [picture.name for picture in found if picture is not None] == ["000.png", "001.png", "002.png"]


def test_pictures_of_two_sizes_in_a_folder_are_an_error_that_names_the_file(tmp_path: Path) -> None:
    write_pictures(tmp_path, [(64, 48), (32, 24)])
    source = open_source(CameraSourceSettings(source=str(tmp_path)), VirtualClock())
    source.read()
    with pytest.raises(ConfigurationError, match=r"001\.png: has 32 x 24 pixels, but the previous pictures 64 x 48"):
        source.read()


def test_a_damaged_picture_in_a_folder_is_an_error_that_names_it(tmp_path: Path) -> None:
    (tmp_path / "a.png").write_bytes(b"no picture")
    with pytest.raises(ConfigurationError, match=r"a\.png: is not a readable picture"):
        open_source(CameraSourceSettings(source=str(tmp_path)), VirtualClock()).read()


def test_an_empty_folder_is_refused(tmp_path: Path) -> None:
    with pytest.raises(ConfigurationError, match="no picture in the folder"):
        open_source(CameraSourceSettings(source=str(tmp_path)), VirtualClock())


def test_a_video_gives_its_frames_and_ends(tmp_path: Path) -> None:
    file = tmp_path / "film.avi"
    writer = cv2.VideoWriter(str(file), cv2.VideoWriter.fourcc(*"MJPG"), 30.0, (64, 48))
    for number in range(4):
        writer.write(np.full((48, 64, 3), 40 * number, np.uint8))
    writer.release()
    source = open_source(CameraSourceSettings(source=str(file)), VirtualClock())
    levels = [None if (picture := source.read()) is None else round(float(picture.image.mean()) / 40) for _ in range(5)]
    source.close()
    assert levels == [0, 1, 2, 3, None]


def test_the_simulated_board_comes_in_many_places_and_ends() -> None:
    source = open_source(CameraSourceSettings(source="simulated:board", size_px=(320, 240)), VirtualClock())
    first, second = source.read(), source.read()
    assert first is not None
    assert second is not None
    assert first.image.shape == (240, 320)
    assert np.any(first.image != second.image)


def test_an_unknown_scene_is_refused() -> None:
    with pytest.raises(ConfigurationError, match="no scene called 'moon'"):
        open_source(CameraSourceSettings(source="simulated:moon"), VirtualClock())


@pytest.mark.parametrize(
    ("source", "kind"),
    [("0", "device"), ("/dev/video7", "device"), ("gstreamer:a ! appsink", "gstreamer"), ("simulated", "simulated")],
)
def test_a_word_says_where_pictures_come_from(source: str, kind: str) -> None:
    assert place_of(source).kind == kind


def test_a_source_that_is_not_there_is_refused() -> None:
    with pytest.raises(ConfigurationError, match=r"no-such-thing: no such camera.*Give a camera"):
        place_of("no-such-thing")
