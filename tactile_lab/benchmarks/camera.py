"""Speed of the marker camera: the time for one frame on one core, and the frame rate that its own process sustains."""

from __future__ import annotations

import numpy as np

from drivers.camera.camera_process import CameraProcess
from drivers.camera.detection import detection
from drivers.camera.frames import Frame
from drivers.camera.opencv import cv2
from drivers.camera.packet import encode_packet
from drivers.camera.rendering.board_camera import table_pictures
from drivers.camera.source_settings import CameraSourceSettings
from drivers.core.clock import NANOSECONDS, Clock, MonotonicClock
from tactile_lab.benchmarks.components import Timing, TimingTable

SIZES = ((640, 480), (1280, 720))
RATE_hz = 30.0


def camera_table(clock: Clock | None = None, *, seconds: float = 10.0, repeats: int = 30) -> TimingTable:
    """Times of detecting and encoding a frame, and the rate that the process sustains at 1280 x 720.

    Raises:
        DeviceError: the process does not answer.
    """
    clock = clock or MonotonicClock()
    lines = [line for size in SIZES for line in _frame_timings(clock, size, repeats)]
    return TimingTable("Marker camera (one core)", (*lines, _kept_rate(clock, seconds)))


def _frame_timings(clock: Clock, size: tuple[int, int], repeats: int) -> list[Timing]:
    cv2.setNumThreads(1)
    settings = CameraSourceSettings(source="simulated", size_px=size)
    (image,) = table_pictures(settings, 1, np.random.default_rng(0))
    found, encoded = [], []
    for number in range(repeats):
        begin_ns = clock.now_ns()
        frame = Frame(begin_ns, None, number, detection=detection(image, settings.dictionary))
        middle_ns = clock.now_ns()
        encode_packet(frame, cv2.imencode(".jpg", image, [cv2.IMWRITE_JPEG_QUALITY, 90])[1].tobytes())
        found.append(middle_ns - begin_ns)
        encoded.append(clock.now_ns() - middle_ns)
    words = f"{size[0]} x {size[1]}"
    return [
        Timing(f"markers, {words}", 1e-6 * float(np.median(found)), repeats, None, "two markers, corners refined"),
        Timing(
            f"picture, {words}", 1e-6 * float(np.median(encoded)), repeats, None, "JPEG and packet, where asked for"
        ),
    ]


def _kept_rate(clock: Clock, seconds: float) -> Timing:
    """Mean time between the packets of a 30 Hz camera in its process; 33.3 ms if it keeps up."""
    transport = CameraProcess("camera", CameraSourceSettings(source="simulated", size_px=SIZES[-1], rate_hz=RATE_hz))
    transport.open()
    try:
        transport.receive()
        stamps = []
        end_ns = clock.now_ns() + round(seconds * NANOSECONDS)
        while clock.now_ns() < end_ns:
            stamps += [packet.stamp_ns for packet in transport.receive()]
            clock.sleep_until_ns(clock.now_ns() + 5_000_000)
        report = transport.report()
    finally:
        transport.close()
    period_ms = 1e-6 * float(np.mean(np.diff(stamps)))
    note = f"{len(stamps)} frames in {seconds:g} s: {1e3 / period_ms:.1f} a second of {RATE_hz:g}"
    dropped = f", {report['dropped_blocks']} packets dropped"
    return Timing("a frame in its process, 1280 x 720", period_ms, len(stamps), None, note + dropped)
