"""Frames of a camera; encoded pictures (JPEG, PNG), checked as they arrive and decoded where somebody looks at them."""

from __future__ import annotations

import struct
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from drivers.camera.opencv import cv2
from drivers.core.contacts import Array
from drivers.core.errors import CodecError

Image = NDArray[np.uint8]
LARGEST_PIXELS = 40_000_000
"""A header that states more is damaged or malicious."""

PNG_HEAD, _PNG_TAIL = b"\x89PNG\r\n\x1a\n", b"IEND\xaeB\x60\x82"
_CHUNK_FRAME = 12  # bytes of a PNG chunk in addition to its data: length, type, checksum
_JPEG_HEAD, _JPEG_TAIL = b"\xff\xd8", b"\xff\xd9"
_JPEG_SIZES = frozenset(range(0xC0, 0xD0)) - {0xC4, 0xC8, 0xCC}


@dataclass(frozen=True, eq=False)
class SeenMarker:
    """A marker in a picture.

    Attributes:
        corners_px: shape (4, 2), pixels, clockwise from the print's top left.
        blur_px: width of its widest edge, one standard deviation.
    """

    corners_px: Array
    blur_px: float


@dataclass(frozen=True, eq=False)
class Detection:
    """The markers that were found in the process that took the picture.

    Attributes:
        dictionary: OpenCV's name of the dictionary that was searched for.
        size_px: width and height of the picture.
        markers: by number.
    """

    dictionary: str
    size_px: tuple[int, int]
    markers: Mapping[int, SeenMarker]


@dataclass(frozen=True, eq=False)
class Frame:
    """One picture, what was found in it, or both.

    Attributes:
        stamp_ns: arrival at the host.
        picture: grey levels, shape (height, width), uint8, or as the camera encoded them; None if only the corners were
            kept.
        counter: number of the frame since the camera was opened.
        dropped: frames since it was opened that the camera took but the program did not receive.
        detection: the markers found when the frame arrived; None if they were not searched for.
    """

    stamp_ns: int
    picture: Image | bytes | None
    counter: int = 0
    dropped: int = 0
    detection: Detection | None = None

    @cached_property
    def image(self) -> Image | None:
        """Grey levels, shape (height, width), uint8; None if only the corners were kept.

        Raises:
            CodecError: the encoded picture is damaged.
            ConfigurationError: it is encoded, and what decodes it is not installed.
        """
        return decode_image(self.picture) if isinstance(self.picture, bytes) else self.picture


def decode_image(payload: bytes, *, largest_pixels: int = LARGEST_PIXELS) -> Image:
    """Grey image of a JPEG or PNG, shape (height, width).

    Raises:
        CodecError: neither format, truncated, damaged, or with more pixels than ``largest_pixels``.
    """
    picture_size(payload, largest_pixels=largest_pixels)
    try:
        image = cv2.imdecode(np.frombuffer(payload, np.uint8), cv2.IMREAD_GRAYSCALE)
    except cv2.error as error:
        raise _error("picture damaged") from error
    if image is None:
        raise _error("picture damaged")
    return np.asarray(image, np.uint8)


def picture_size(payload: bytes, *, largest_pixels: int = LARGEST_PIXELS) -> tuple[int, int]:
    """Width and height of a JPEG or PNG by its header; nothing is decoded.

    Raises:
        CodecError: neither format, truncated, or with more pixels than ``largest_pixels``.
    """
    width, height = _stated_size(payload)
    if not 0 < width * height <= largest_pixels:
        raise _error(f"a picture of {width} x {height} pixels")
    return width, height


def _stated_size(payload: bytes) -> tuple[int, int]:
    if payload.startswith(PNG_HEAD):
        if not payload.endswith(_PNG_TAIL) or len(payload) < 33:
            raise _error("PNG truncated")
        _check_chunks(payload)
        width, height = struct.unpack(">II", payload[16:24])
        return width, height
    if payload.startswith(_JPEG_HEAD):
        if not payload.rstrip(b"\0").endswith(_JPEG_TAIL):
            raise _error("JPEG truncated")
        return _jpeg_size(payload)
    raise _error(f"{len(payload)} bytes that are neither JPEG nor PNG")


def _check_chunks(payload: bytes) -> None:
    """Refuse a PNG whose chunks do not end where its data end: OpenCV allocates whatever length they state."""
    at = len(PNG_HEAD)
    while at + _CHUNK_FRAME <= len(payload):
        (length,) = struct.unpack_from(">I", payload, at)
        at += _CHUNK_FRAME + length
    if at != len(payload):
        raise _error("PNG whose parts are longer than it is")


def _jpeg_size(payload: bytes) -> tuple[int, int]:
    position = 2
    while position + 9 <= len(payload) and payload[position] == 0xFF:
        marker, length = payload[position + 1], int.from_bytes(payload[position + 2 : position + 4], "big")
        if marker in _JPEG_SIZES:
            height, width = struct.unpack(">HH", payload[position + 5 : position + 9])
            return width, height
        position += 2 + length
    raise _error("JPEG without a size")


def _error(what: str) -> CodecError:
    return CodecError(what, where="camera frame", hint="Check the camera's connection and its picture format")
