"""The camera's own process: ``python -m drivers.camera.camera_worker``, started by ``CameraProcess``.

It reads lines of JSON on standard input: first what to open, then commands. It detects markers in every frame and
writes a packet for each to standard output, including the picture if one was requested; it never waits for the reader.
When standard input ends, the program that started it is gone, and the process ends too.
"""

from __future__ import annotations

import json
import select
import sys
from typing import Any

from drivers.camera.detection import detection
from drivers.camera.frames import Frame
from drivers.camera.opencv import cv2
from drivers.camera.packet import encode_packet
from drivers.camera.pictures import Picture, Source
from drivers.camera.source_settings import CameraSourceSettings
from drivers.camera.sources import open_source
from drivers.core.clock import NANOSECONDS, MonotonicClock
from drivers.core.configuration import validate
from drivers.core.errors import DeviceError
from drivers.core.records import RecordKind, RecordPipe, report_failure

_FILES = ("folder", "video")


class CameraWorker:
    """Detects markers frame by frame, and obeys commands.

    Args:
        source: the camera, already open.
        settings: which markers to look for.
        pipe: receives the packets.
    """

    def __init__(self, source: Source, settings: CameraSourceSettings, pipe: RecordPipe) -> None:
        self._source, self._settings, self._pipe = source, settings, pipe
        self._clock = MonotonicClock()
        self._wanted = self._frames = self._markers = self._frames_before = 0
        self._began_ns = self._clock.now_ns()
        self._ended = False

    def run(self) -> None:
        """Read frames until the commands end. Raises DeviceError, also when the source has ended."""
        while not self._ended:
            self._wait_for_its_time()
            picture = self._source.read()
            if picture is None:
                self._begin_again()
                continue
            self._hand_on(picture)
            while not self._ended and select.select([sys.stdin], [], [], 0)[0]:
                self._obey(sys.stdin.readline())

    def _wait_for_its_time(self) -> None:
        """Wait so that frames from files arrive no faster than a camera would send them."""
        if self._settings.place().kind in _FILES:
            due_ns = self._began_ns + round(self._frames * NANOSECONDS / self._settings.rate_hz)
            self._clock.sleep_until_ns(due_ns)

    def _begin_again(self) -> None:
        if not self._settings.repeat or self._frames == self._frames_before:
            raise DeviceError("the video or folder has ended", where="camera", hint="Set repeat: true to play it again")
        self._frames_before = self._frames
        self._source.close()
        self._source.open()

    def _hand_on(self, picture: Picture) -> None:
        found = detection(picture.image, self._settings.dictionary)
        self._frames += 1
        self._markers += len(found.markers)
        encoded = b""
        if self._wanted:
            self._wanted -= 1
            quality = [cv2.IMWRITE_JPEG_QUALITY, self._settings.jpeg_quality]
            encoded = cv2.imencode(".jpg", picture.image, quality)[1].tobytes()
        frame = Frame(picture.stamp_ns, None, picture.counter, picture.dropped, found)
        self._pipe.put(RecordKind.RECEIVED, picture.stamp_ns, encode_packet(frame, encoded))
        self._pipe.flush()

    def _obey(self, line: str) -> None:
        order: dict[str, Any] = json.loads(line) if line else {"end": True}
        self._wanted += int(order.get("pictures", 0))
        if order.get("report"):
            self._report()
        self._ended = bool(order.get("end"))

    def _report(self) -> None:
        report = {
            "frames": self._frames,
            "markers": self._markers,
            "dropped_blocks": self._pipe.dropped_blocks,
            "notes": self._source.notes(),
        }
        self._pipe.put(RecordKind.REPORT, self._clock.now_ns(), json.dumps(report).encode())
        self._pipe.flush()


def main() -> None:
    """Open the source that the first line names, process its frames, and close it."""
    cv2.setNumThreads(1)
    clock, pipe = MonotonicClock(), RecordPipe(sys.stdout.fileno())
    with report_failure(pipe, clock):
        settings = validate(json.loads(sys.stdin.readline()), CameraSourceSettings, where="camera")
        source = open_source(settings, clock)
        try:
            pipe.put(RecordKind.READY, clock.now_ns(), json.dumps({"notes": source.notes()}).encode())
            pipe.flush()
            CameraWorker(source, settings, pipe).run()
        finally:
            source.close()


if __name__ == "__main__":
    main()
