"""The packets that a camera sends: the markers of every frame, and pictures on request (protocols: Camera packets).

::

    "TLCP"  version u8  dictionary u8  width u16  height u16  markers u16  counter u32  dropped u32  picture bytes u32
    for each marker: number u16, blur f32, corners 8 x f32
    optionally the picture, as JPEG or PNG

All numbers are little-endian; the dictionary is given by its index in OpenCV's list. A bare JPEG or PNG is also a
packet, in which markers have not been searched for. The bytes are recorded unchanged, so that the ground truth can be
recomputed from the corners with another lens calibration, and from the pictures with another detector.
"""

from __future__ import annotations

import struct

import numpy as np

from drivers.camera.frames import LARGEST_PIXELS, Detection, Frame, SeenMarker, picture_size
from drivers.camera.markers import DICTIONARIES
from drivers.core.errors import CodecError
from drivers.core.transports import Datagram

MAGIC, VERSION = b"TLCP", 1
_HEAD = struct.Struct("<4sBBHHHIII")
_FARTHEST_px = 1e6
_COUNTER = 5  # index among the numbers of the header
_MARKER = np.dtype([("number", "<u2"), ("blur_px", "<f4"), ("corners_px", "<f4", (4, 2))])


def encode_packet(frame: Frame, picture: bytes = b"") -> bytes:
    """Encode the detection of a frame, and its encoded picture if one was requested."""
    found = frame.detection
    if found is None:
        raise ValueError("a packet holds what was detected")
    rows = [(number, marker.blur_px, marker.corners_px) for number, marker in sorted(found.markers.items())]
    head = _HEAD.pack(
        MAGIC,
        VERSION,
        DICTIONARIES.index(found.dictionary),
        *found.size_px,
        len(rows),
        frame.counter,
        frame.dropped,
        len(picture),
    )
    return head + np.array(rows, _MARKER).tobytes() + picture


def decode_packet(datagram: Datagram, *, largest_pixels: int = LARGEST_PIXELS) -> Frame:
    """Decode a frame from what a camera sent. Its picture stays encoded until somebody looks at it.

    Raises:
        CodecError: the bytes are neither a packet nor a picture, are damaged, or hold a picture of more than
            ``largest_pixels``.
    """
    payload = datagram.payload
    if not payload.startswith(MAGIC):
        picture_size(payload, largest_pixels=largest_pixels)
        return Frame(datagram.stamp_ns, payload)
    version, dictionary, width, height, markers, counter, dropped, picture = _head(payload)
    if version != VERSION or dictionary >= len(DICTIONARIES):
        raise _error(f"a packet of version {version}, dictionary {dictionary}")
    rows_end = _HEAD.size + markers * _MARKER.itemsize
    if len(payload) != rows_end + picture:
        raise _error(f"{len(payload)} bytes instead of {rows_end + picture}")
    rows = np.frombuffer(payload, _MARKER, markers, _HEAD.size)
    if not ((np.abs(rows["corners_px"]) < _FARTHEST_px).all() and (rows["blur_px"] >= 0.0).all()):
        raise _error("corners that are no places in a picture")
    found = Detection(DICTIONARIES[dictionary], (width, height), {int(row["number"]): _marker(row) for row in rows})
    if not picture:
        return Frame(datagram.stamp_ns, None, counter, dropped, found)
    encoded = payload[rows_end:]
    across, down = picture_size(encoded, largest_pixels=largest_pixels)
    if (across, down) != (width, height):
        raise _error(f"a picture of {across} x {down} pixels instead of {width} x {height}")
    return Frame(datagram.stamp_ns, encoded, counter, dropped, found)


def picture_of(payload: bytes) -> bytes:
    """The encoded picture in what a camera sent; empty if there is none."""
    if not payload.startswith(MAGIC):
        return payload
    return payload[len(payload) - _head(payload)[-1] :] if len(payload) >= _HEAD.size else b""


def counter_of(payload: bytes) -> int | None:
    """The camera's own number of the frame; None for a bare picture or other bytes. Never raises."""
    return _head(payload)[_COUNTER] if payload.startswith(MAGIC) and len(payload) >= _HEAD.size else None


def _head(payload: bytes) -> tuple[int, ...]:
    if len(payload) < _HEAD.size:
        raise _error(f"a packet of {len(payload)} bytes")
    return tuple(_HEAD.unpack_from(payload)[1:])


def _marker(row: np.void) -> SeenMarker:
    return SeenMarker(np.asarray(row["corners_px"], float), float(row["blur_px"]))


def _error(what: str) -> CodecError:
    return CodecError(what, where="camera", hint="Check the camera's connection and its version")
