"""The source of pictures, named by one word, and how pictures should be taken."""

from __future__ import annotations

from pathlib import Path
from typing import Literal, NamedTuple

from pydantic import Field, field_validator

from drivers.camera.markers import known_dictionary
from drivers.core.configuration import StrictModel
from drivers.core.errors import ConfigurationError
from drivers.core.reading.bounded_files import refuse_unreachable

Kind = Literal["device", "gstreamer", "folder", "video", "simulated"]
PICTURES = (".png", ".jpg", ".jpeg", ".bmp", ".tif", ".tiff")


class Place(NamedTuple):
    """What kind of source, and which one."""

    kind: Kind
    name: str


class CameraSourceSettings(StrictModel):
    """A camera, or a substitute for one.

    Attributes:
        source: number or device file of a V4L2 camera (``0``, ``/dev/video2``), ``gstreamer:`` and a pipeline that
            ends in ``appsink``, a folder of pictures, a video file, or ``simulated`` (``simulated:board``).
        dictionary: markers to look for in every frame.
        size_px: width and height of the pictures.
        rate_hz: frames per second.
        exposure_ms, gain, focus: fixed if the driver allows it; None leaves them to the camera. The automatic focus is
            switched off in any case, because refocusing changes the lens parameters.
        pixel_format: a four-letter code that the camera knows; MJPG for most USB cameras above 640 x 480.
        jpeg_quality: of the pictures that are sent.
        repeat: in a session, restart a folder or video at its end instead of ending the session.
    """

    source: str = "0"
    dictionary: str = "DICT_4X4_50"
    size_px: tuple[int, int] = (1280, 720)
    rate_hz: float = Field(default=30.0, gt=0.0, le=1000.0)
    exposure_ms: float | None = Field(default=None, gt=0.0)
    gain: float | None = None
    focus: float | None = None
    pixel_format: str = Field(default="MJPG", min_length=4, max_length=4)
    jpeg_quality: int = Field(default=90, ge=1, le=100)
    repeat: bool = False

    @field_validator("dictionary")
    @classmethod
    def _known(cls, value: str) -> str:
        return known_dictionary(value)

    def place(self) -> Place:
        """The meaning of ``source``. Raises ConfigurationError if no such source exists."""
        return place_of(self.source)


def source_beside(source: str, folder: Path) -> str:
    """A source as written in a file in ``folder``: relative paths of pictures start there."""
    if source.isdigit() or source.partition(":")[0] in ("gstreamer", "simulated"):
        return source
    return str((folder / source).resolve())


def place_of(source: str) -> Place:
    """The meaning of a source's word. Raises ConfigurationError if no such source exists."""
    head, _, rest = source.partition(":")
    if head in ("gstreamer", "simulated"):
        return Place("gstreamer" if head == "gstreamer" else "simulated", rest)
    if source.isdigit() or source.startswith("/dev/"):
        return Place("device", source)
    path = Path(source)
    refuse_unreachable(path)
    if path.is_dir():
        return Place("folder", source)
    if path.is_file():
        return Place("video", source)
    hint = "Give a camera (0, /dev/video0), a folder of pictures, a video, gstreamer:PIPELINE or simulated"
    raise ConfigurationError("no such camera, folder or file", where=source, hint=hint)
