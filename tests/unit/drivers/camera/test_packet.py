"""Packets of a camera: markers of every frame, pictures on demand."""

from __future__ import annotations

from dataclasses import replace

import cv2
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from drivers.camera.frames import Detection, Frame, SeenMarker
from drivers.camera.packet import decode_packet, encode_packet, picture_of
from drivers.core.errors import CodecError
from drivers.core.transports import Datagram
from sessions.recording.device_stamps import camera_stamp
from sessions.recording.traffic.raw_frames import UNSTAMPED, DeviceStamp
from sessions.recording.traffic.stream_counts import StreamCounts

PICTURE = cv2.imencode(".png", np.arange(48 * 64, dtype=np.int64).reshape(48, 64).astype(np.uint8))[1].tobytes()
MARKERS = {number: SeenMarker(np.arange(8.0).reshape(4, 2) + number / 4, 0.75) for number in (0, 7, 49)}
NARROW = Frame(0, None, detection=Detection("DICT_4X4_50", (63, 48), {}))
FRAME = Frame(5, None, 12, 3, Detection("DICT_4X4_50", (64, 48), MARKERS))


@pytest.mark.parametrize("picture", [b"", PICTURE])
def test_a_packet_comes_back_as_it_was(picture: bytes) -> None:
    payload = encode_packet(FRAME, picture)
    found = decode_packet(Datagram(payload, 77))
    assert (found.stamp_ns, found.counter, found.dropped) == (77, 12, 3)
    assert found.detection is not None
    assert (found.detection.dictionary, found.detection.size_px) == ("DICT_4X4_50", (64, 48))
    assert sorted(found.detection.markers) == [0, 7, 49]
    for number, marker in found.detection.markers.items():
        np.testing.assert_allclose(marker.corners_px, MARKERS[number].corners_px, atol=1e-5)
        assert marker.blur_px == 0.75
    assert (found.image is None) == (not picture)
    assert picture_of(payload) == picture


def test_corners_keep_a_thousandth_of_a_pixel() -> None:
    corners = np.array([[1919.123, 1079.456]] * 4)
    frame = Frame(0, None, detection=Detection("DICT_4X4_50", (1920, 1080), {1: SeenMarker(corners, 1.0)}))
    found = decode_packet(Datagram(encode_packet(frame), 0))
    assert found.detection is not None
    np.testing.assert_allclose(found.detection.markers[1].corners_px, corners, atol=1e-3)


def test_a_bare_picture_is_a_packet_nobody_has_looked_at() -> None:
    found = decode_packet(Datagram(PICTURE, 3))
    assert found.detection is None
    assert found.image is not None
    assert picture_of(PICTURE) == PICTURE


def told(width: int, height: int) -> bytes:
    """A packet whose head tells another size than the picture's 64 x 48 pixels."""
    return encode_packet(Frame(0, None, detection=Detection("DICT_4X4_50", (width, height), {})), PICTURE)


@pytest.mark.parametrize(
    ("payload", "complaint"),
    [
        (encode_packet(FRAME)[:20], "a packet of 20 bytes"),
        (encode_packet(FRAME)[:-1], "bytes instead of"),
        (encode_packet(FRAME) + b"x", "bytes instead of"),
        (encode_packet(FRAME)[:4] + b"\x02" + encode_packet(FRAME)[5:], "version 2"),
        (encode_packet(FRAME)[:5] + b"\xff" + encode_packet(FRAME)[6:], "dictionary 255"),
        (encode_packet(FRAME, PICTURE[:-9]), "PNG truncated"),
        (told(65, 48), "instead of 65 x 48"),
        (told(63, 48), "a picture of 64 x 48 pixels"),
        (encode_packet(FRAME)[:-4] + b"\x00\x00\xc0\x7f", "no places in a picture"),
    ],
)
def test_a_damaged_packet_is_a_codec_error(payload: bytes, complaint: str) -> None:
    with pytest.raises(CodecError, match=complaint):
        decode_packet(Datagram(payload, 0))


@settings(max_examples=40, derandomize=True, deadline=None)
@given(st.integers(0, 200), st.binary(min_size=1, max_size=8))
def test_bytes_overwritten_anywhere_decode_or_raise_a_codec_error(at: int, damage: bytes) -> None:
    whole = encode_packet(FRAME, PICTURE)
    payload = whole[:at] + damage + whole[at + len(damage) :]
    picture_of(payload)
    try:
        decode_packet(Datagram(payload, 0), largest_pixels=100_000)
    except CodecError:
        return


def test_a_frame_nobody_has_looked_at_makes_no_packet() -> None:
    with pytest.raises(ValueError, match="what was detected"):
        encode_packet(Frame(0, None))


def test_the_number_of_a_frame_is_read_without_decoding_the_rest() -> None:
    frame = Frame(0, None, 41, 3, Detection("DICT_4X4_50", (64, 48), {}))
    packet = encode_packet(frame)
    assert camera_stamp(packet) == DeviceStamp(41)
    assert camera_stamp(packet[:10]) == camera_stamp(b"\xff\xd8\xff") == camera_stamp(b"") == UNSTAMPED
    counts = StreamCounts()
    for counter in (41, 42, 45):
        counts.take("/link/camera/rx", 0, camera_stamp(encode_packet(replace(frame, counter=counter))))
    assert counts.gaps["/link/camera/rx"] == 2
