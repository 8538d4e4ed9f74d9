"""Pictures from V4L2 and GStreamer cameras, videos and folders, one after the other, through OpenCV.

Every picture is stamped on arrival and numbered. Lost frames are detected by the gap in time, and counted. It is an
error if a camera changes the size of its pictures, because no lens calibration would fit.
"""

from __future__ import annotations

from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from typing import Any

import numpy as np

from drivers.camera.frames import Image
from drivers.camera.opencv import cv2
from drivers.camera.pictures import Picture, Source
from drivers.camera.source_settings import PICTURES, CameraSourceSettings
from drivers.core.clock import NANOSECONDS, Clock
from drivers.core.errors import ConfigurationError, DeviceError
from drivers.core.reading.bounded_files import LARGEST_PICTURE_bytes, check_size

_MANUAL_EXPOSURE_V4L2 = 1.0
_EXPOSURE_UNITS_PER_ms = 10.0  # V4L2 counts in 100 microseconds


class OpenCvSource:
    """A camera or video behind OpenCV.

    Args:
        settings: which source, and how to read it.
        clock: for the stamps.
        capture: creates OpenCV's capture object from a name and a back end; None for its own.
    """

    def __init__(self, settings: CameraSourceSettings, clock: Clock, capture: Callable[..., Any] | None = None) -> None:
        self._settings, self._clock, self._make = settings, clock, capture or cv2.VideoCapture
        self._capture: Any = None
        self._notes: list[str] = []
        self._size: tuple[int, ...] | None = None
        self._counter = self._dropped = 0
        self._last_ns: int | None = None

    def open(self) -> None:
        """Open the device and set exposure, gain and focus where possible.

        Raises:
            ConfigurationError: a file that is no film.
            DeviceError: the device or pipeline cannot be opened.
        """
        kind, name = self._settings.place()
        if kind == "gstreamer" and "GStreamer:                   YES" not in cv2.getBuildInformation():
            hint = "Install an OpenCV with GStreamer, or use the camera's device file"
            raise DeviceError("this OpenCV was built without GStreamer", where="camera", hint=hint)
        number: int | str = int(name) if name.isdigit() else name
        back_end = {"device": cv2.CAP_V4L2, "gstreamer": cv2.CAP_GSTREAMER}.get(kind, cv2.CAP_ANY)
        capture = self._make(number, back_end)
        if not capture.isOpened():
            if Path(name).is_file():
                raise ConfigurationError("cannot be opened as a film", where=name, hint="Check the file")
            hint = "Check its cable and permissions" if kind == "device" else "Check the pipeline"
            raise DeviceError("cannot be opened", where=f"camera {name}", hint=hint)
        self._capture = capture
        if kind == "device":
            self._configure()

    def read(self) -> Picture | None:
        """The next picture, stamped as soon as the driver delivers it."""
        grabbed = self._capture.grab()
        stamp_ns = self._clock.now_ns()
        good, image = self._capture.retrieve() if grabbed else (False, None)
        if not good:
            self._check_end()
            return None
        self._check_size(image)
        self._count(stamp_ns)
        return Picture(stamp_ns, self._counter, self._dropped, grey(image))

    def close(self) -> None:
        """Release the device; idempotent."""
        capture, self._capture = self._capture, None
        if capture is not None:
            capture.release()

    def notes(self) -> tuple[str, ...]:
        """Settings that the driver did not accept."""
        return tuple(self._notes)

    def _configure(self) -> None:
        wanted, (width, height) = self._settings, self._settings.size_px
        self._capture.set(cv2.CAP_PROP_FOURCC, cv2.VideoWriter.fourcc(*wanted.pixel_format))
        self._fix("width", cv2.CAP_PROP_FRAME_WIDTH, width)
        self._fix("height", cv2.CAP_PROP_FRAME_HEIGHT, height)
        self._fix("frames per second", cv2.CAP_PROP_FPS, wanted.rate_hz)
        self._fix("automatic focus", cv2.CAP_PROP_AUTOFOCUS, 0.0)
        if wanted.focus is not None:
            self._fix("focus", cv2.CAP_PROP_FOCUS, wanted.focus)
        if wanted.exposure_ms is not None:
            self._fix("automatic exposure", cv2.CAP_PROP_AUTO_EXPOSURE, _MANUAL_EXPOSURE_V4L2)
            self._fix("exposure", cv2.CAP_PROP_EXPOSURE, round(_EXPOSURE_UNITS_PER_ms * wanted.exposure_ms))
        if wanted.gain is not None:
            self._fix("gain", cv2.CAP_PROP_GAIN, wanted.gain)

    def _fix(self, what: str, key: int, value: float) -> None:
        taken = self._capture.set(key, value)
        now = self._capture.get(key)
        if not taken or abs(now - value) > 0.01 * max(abs(value), 1.0):
            self._notes.append(f"the driver does not accept {what} {value:g} (it stays {now:g})")

    def _check_size(self, image: Any) -> None:
        size = image.shape[:2]
        expected = self._size or (self._settings.size_px[::-1] if self._settings.place().kind == "device" else size)
        if size != expected:
            shown = [f"{width} x {height}" for height, width in (expected, size)]
            what = f"delivers pictures of {shown[1]} pixels instead of {shown[0]}"
            raise DeviceError(
                what, where="camera", hint="Set the size for which it was calibrated, or calibrate it for this size"
            )
        self._size = size

    def _count(self, stamp_ns: int) -> None:
        """Count one more frame; a gap of several periods before it shows how many were lost."""
        self._counter += 1
        if self._settings.place().kind in ("device", "gstreamer") and self._last_ns is not None:
            periods = (stamp_ns - self._last_ns) * self._settings.rate_hz / NANOSECONDS
            lost = max(round(periods) - 1, 0)
            self._counter += lost
            self._dropped += lost
        self._last_ns = stamp_ns

    def _check_end(self) -> None:
        """Raises DeviceError if a camera delivers nothing more; only a video may end."""
        if self._settings.place().kind != "video":
            raise DeviceError("delivers no more pictures", where="camera", hint="Check its cable and power")


class FolderSource:
    """The pictures in a folder, ordered by name, as fast as they can be read."""

    def __init__(self, settings: CameraSourceSettings, clock: Clock) -> None:
        self._settings, self._clock = settings, clock
        self._files: list[Path] = []
        self._next = self._counter = 0
        self._size: tuple[int, ...] | None = None

    def open(self) -> None:
        """Find the pictures. Raises ConfigurationError if there are none."""
        folder = Path(self._settings.place().name)
        self._files = sorted(file for file in folder.iterdir() if file.suffix.lower() in PICTURES)
        if not self._files:
            hint = f"Supported suffixes are {', '.join(PICTURES)}"
            raise ConfigurationError("no picture in the folder", where=str(folder), hint=hint)
        self._next = 0

    def read(self) -> Picture | None:
        """The next picture. Raises ConfigurationError if it cannot be read or has another size."""
        if self._next == len(self._files):
            return None
        file = self._files[self._next]
        self._next += 1
        self._counter += 1
        image = None
        with suppress(cv2.error, OSError):  # more pixels than the library is allowed to make
            check_size(file, LARGEST_PICTURE_bytes)
            image = cv2.imread(str(file), cv2.IMREAD_GRAYSCALE)
        if image is None:
            raise ConfigurationError("is not a readable picture", where=str(file), hint="Remove it from the folder")
        self._size = self._size or image.shape
        if image.shape != self._size:
            shown = [f"{width} x {height}" for height, width in (image.shape, self._size)]
            what = f"has {shown[0]} pixels, but the previous pictures {shown[1]}"
            raise ConfigurationError(what, where=str(file), hint="Use pictures of one camera at one resolution")
        return Picture(self._clock.now_ns(), self._counter, 0, np.asarray(image, np.uint8), file.name)

    def close(self) -> None:
        """Do nothing: no device is open."""

    def notes(self) -> tuple[str, ...]:
        """Nothing to report: a folder has no such settings."""
        return ()


def open_source(settings: CameraSourceSettings, clock: Clock) -> Source:
    """The source that the settings name, opened.

    Raises:
        ConfigurationError: there is no source of that name.
        DeviceError: the source cannot be opened.
    """
    source = _source(settings, clock)
    source.open()
    return source


def _source(settings: CameraSourceSettings, clock: Clock) -> Source:
    kind = settings.place().kind
    if kind == "folder":
        return FolderSource(settings, clock)
    if kind == "simulated":
        from drivers.camera.rendering.board_camera import SimulatedSource

        return SimulatedSource(settings, clock)
    return OpenCvSource(settings, clock)


def grey(image: Any) -> Image:
    """Grey levels of a colour or grey picture, shape (height, width)."""
    return np.asarray(image if image.ndim == 2 else cv2.cvtColor(image, cv2.COLOR_BGR2GRAY), np.uint8)
