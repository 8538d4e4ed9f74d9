"""The camera in a process of its own, seen from the session: a link like any other.

The process finds the markers of every frame as it comes, 30 a second, whatever the session is busy with; their corners
come as packets (see :mod:`drivers.camera.packet`), stamped where they arrived. A trigger asks for one picture beside.
"""

from __future__ import annotations

import json
import os
import select
import subprocess
import sys
from typing import Any

from drivers.camera.camera import TRIGGER
from drivers.camera.source_settings import CameraSourceSettings
from drivers.links import Datagram
from drivers.shadow.hand_records import Record, RecordKind, RecordReader
from tactile_lab.clock import NANOSECONDS, Clock, MonotonicClock
from tactile_lab.errors import CodecError, DeviceError

_START_s, _REPORT_s, _END_s = 60.0, 10.0, 5.0
_READ_BYTES, _LONGEST = 1_048_576, 40_000_000


class CameraProcess:
    """A link to a camera that another process watches.

    Args:
        name: the link's name, in the rig and in recordings.
        settings: which camera, and what to look for.
        clock: for waiting on the process; stamps are of the monotonic clock.
    """

    def __init__(self, name: str, settings: CameraSourceSettings, clock: Clock | None = None) -> None:
        self.name, self._settings, self._clock = name, settings, clock or MonotonicClock()
        self._process: subprocess.Popen[bytes] | None = None
        self._reader, self._kept = RecordReader(_LONGEST, "camera process"), list[Record]()
        self._notes: tuple[str, ...] = ()

    def open(self) -> None:
        """Start the process and wait until it has the camera; all or nothing, repeatable.

        Raises:
            DeviceError: the camera can not be opened, in its driver's own words.
        """
        if self._process is not None:
            return
        self._settings.place()
        command = [sys.executable, "-m", "drivers.camera.camera_worker"]
        self._process = subprocess.Popen(
            command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, process_group=0
        )  # Ctrl+C is for the session
        self._reader, self._kept = RecordReader(_LONGEST, "camera process"), []
        try:
            self._order(self._settings.model_dump(mode="json"))
            ready = json.loads(self._wait_for(RecordKind.READY, _START_s).payload)
            self._notes = tuple(ready["notes"])
        except BaseException:
            self.close()
            raise

    def close(self) -> None:
        """End the process; idempotent."""
        if self._process is None:
            return
        process, self._process = self._process, None
        try:
            process.communicate(timeout=_END_s)
        except subprocess.TimeoutExpired:
            process.kill()
            process.communicate()

    def send(self, payload: bytes) -> None:
        """Ask for a picture. Raises CodecError for another message, DeviceError when the process is gone."""
        if payload != TRIGGER:
            raise CodecError(f"{len(payload)} bytes that are no trigger", where=self.name)
        self._order({"pictures": 1})

    def receive(self) -> list[Datagram]:
        """Packets since the last call, oldest first. Raises DeviceError for what stopped the camera."""
        records, self._kept = self._kept, []
        while (more := self._read(0.0)) is not None:
            records += more
        arrived = [record for record in records if record.kind is RecordKind.RECEIVED]
        for record in records:
            if record.kind is RecordKind.ERROR:
                raise DeviceError(record.payload.decode(), where=self.name)
        return [Datagram(record.payload, record.stamp_ns) for record in arrived]

    def report(self) -> dict[str, Any]:
        """Frames and markers seen so far, blocks the pipe did not take, and what is wrong in words.

        Raises:
            DeviceError: the process is gone or does not answer.
        """
        self._order({"report": True})
        answer: dict[str, Any] = json.loads(self._wait_for(RecordKind.REPORT, _REPORT_s).payload)
        return answer

    def health(self) -> tuple[str, ...]:
        """What the camera's driver did not do as asked, in words."""
        return self._notes

    def _order(self, order: dict[str, Any]) -> None:
        process = self._running()
        assert process.stdin is not None
        try:
            process.stdin.write(json.dumps(order).encode() + b"\n")
            process.stdin.flush()
        except BrokenPipeError:
            raise self._gone() from None

    def _wait_for(self, kind: RecordKind, patience_s: float) -> Record:
        """The next record of a kind; the others are kept for :meth:`receive`. An error while waiting is raised."""
        until_ns = self._clock.now_ns() + round(patience_s * NANOSECONDS)
        found: Record | None = None
        while found is None and (left_ns := until_ns - self._clock.now_ns()) > 0:
            for record in self._read(left_ns / NANOSECONDS) or []:
                if record.kind is RecordKind.ERROR:
                    raise DeviceError(record.payload.decode(), where=self.name)
                if record.kind is kind and found is None:
                    found = record
                else:
                    self._kept.append(record)
        if found is None:
            raise DeviceError("its process does not answer", where=self.name, hint="Connect again")
        return found

    def _read(self, patience_s: float) -> list[Record] | None:
        """Records that arrive in this time; None when nothing does."""
        process = self._running()
        assert process.stdout is not None
        if not select.select([process.stdout], [], [], max(patience_s, 0.0))[0]:
            return None
        if not (data := os.read(process.stdout.fileno(), _READ_BYTES)):
            raise self._gone()
        return self._reader.feed(data)

    def _running(self) -> subprocess.Popen[bytes]:
        if self._process is None:
            raise DeviceError("not connected", where=self.name, hint="Connect the camera first")
        return self._process

    def _gone(self) -> DeviceError:
        return DeviceError("its process has ended", where=self.name, hint="See its last error, and connect again")
