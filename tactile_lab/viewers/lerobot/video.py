"""The camera's pictures as a video of constant rate."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from drivers.camera.opencv import cv2
from drivers.core.errors import SessionError
from tactile_lab.viewers.lerobot.statistics import PictureStatistics, Statistics, levels_of

CODEC = "vp9"
"""Which OpenCV's own packages can write, and browsers can show."""
_FOUR_LETTERS = "vp09"
_STATISTICS_STEP = 4
"""Statistics see every fourth pixel of every fourth line."""

Picture = NDArray[np.uint8]


class VideoFile:
    """A video that gets one frame a moment: the newest picture, black before the first. No file without a picture.

    Args:
        path: of the MP4 file.
        rate_Hz: frames a second.
    """

    def __init__(self, path: Path, rate_Hz: int) -> None:
        self._path, self._rate_Hz = path, rate_Hz
        self._writer: cv2.VideoWriter | None = None
        self._statistics = PictureStatistics()
        self._encoded: bytes | None = None
        self._frame: Picture = np.zeros((0, 0, 3), np.uint8)
        self._levels = np.zeros((3, 256), dtype=np.int64)
        self._waiting = 0
        """Frames before the first picture."""

    @property
    def exists(self) -> bool:
        """Whether there was a picture."""
        return self._writer is not None

    def add(self, encoded: bytes | None) -> None:
        """One more frame. A picture that cannot be decoded leaves the one before. Raises SessionError."""
        if encoded is not None and encoded is not self._encoded:
            self._encoded = encoded
            picture = cv2.imdecode(np.frombuffer(encoded, np.uint8), cv2.IMREAD_COLOR)
            if picture is not None:
                self._show(np.asarray(picture, dtype=np.uint8))
        if self._writer is None:
            self._waiting += 1
        else:
            self._writer.write(self._frame)
            self._statistics.add(self._levels)

    def close(self) -> None:
        """Complete the file."""
        if self._writer is not None:
            self._writer.release()

    def description(self) -> dict[str, Any]:
        """The entry of ``meta/info.json``."""
        height, width = self._frame.shape[:2]
        info = {
            "video.height": height,
            "video.width": width,
            "video.codec": CODEC,
            "video.pix_fmt": "yuv420p",
            "video.is_depth_map": False,
            "video.fps": self._rate_Hz,
            "video.channels": 3,
            "has_audio": False,
        }
        return {"dtype": "video", "shape": [height, width, 3], "names": ["height", "width", "channels"], "info": info}

    def statistics(self) -> Statistics:
        """Of all frames; see :meth:`PictureStatistics.result`."""
        return self._statistics.result()

    def _show(self, picture: Picture) -> None:
        """The next frames show this picture, in the size of the first."""
        if self._writer is None:
            self._open(picture)
        height, width = self._frame.shape[:2]
        if picture.shape != self._frame.shape:
            picture = np.asarray(cv2.resize(picture, (width, height)), dtype=np.uint8)
        self._frame = picture
        self._levels = _levels(picture)

    def _open(self, picture: Picture) -> None:
        self._path.parent.mkdir(parents=True, exist_ok=True)
        height, width = picture.shape[:2]
        code = cv2.VideoWriter.fourcc(*_FOUR_LETTERS)
        self._writer = cv2.VideoWriter(str(self._path), cv2.CAP_FFMPEG, code, self._rate_Hz, (width, height))
        if not self._writer.isOpened():
            hint = "Use the OpenCV that the program's requirements name, which has FFmpeg with VP9"
            raise SessionError("a video cannot be written", where=str(self._path), hint=hint)
        self._frame = np.zeros_like(picture)
        for _ in range(self._waiting):
            self._writer.write(self._frame)
        self._statistics.add(_levels(self._frame), self._waiting)


def _levels(picture: Picture) -> NDArray[np.int64]:
    """Of red, green and blue."""
    return levels_of(picture[::_STATISTICS_STEP, ::_STATISTICS_STEP, ::-1])
