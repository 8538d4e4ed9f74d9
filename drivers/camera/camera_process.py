"""The session's side of a camera in a separate process: a transport like any other.

The process detects the markers in every frame, 30 per second, however busy the session is. It sends their corners as
packets (see :mod:`drivers.camera.packet`), with the stamp of the frame's arrival in the process. A trigger requests one
picture in addition.
"""

from __future__ import annotations

from typing import Any

from drivers.camera.camera import TRIGGER
from drivers.camera.source_settings import CameraSourceSettings
from drivers.core.errors import CodecError, DeviceError
from drivers.core.record_process import RecordProcess
from drivers.core.records import Record, RecordKind
from drivers.core.transports import Datagram

_START_s, _REPORT_s, _END_s = 60.0, 10.0, 5.0
_LONGEST = 40_000_000


class CameraProcess:
    """A transport to a camera that another process reads.

    Args:
        name: the transport's name, in the rig and in recordings.
        settings: which camera, and which markers to look for.
    """

    def __init__(self, name: str, settings: CameraSourceSettings) -> None:
        self.name, self._settings = name, settings
        self._child = RecordProcess("drivers.camera.camera_worker", name, _LONGEST)
        self._kept: list[Record] = []
        self._notes: tuple[str, ...] = ()

    def open(self) -> None:
        """Start the process and wait until it has opened the camera. Repeatable; after a failure nothing is left
        running.

        Raises:
            DeviceError: the camera cannot be opened; the message is its driver's.
        """
        if self._child.started:
            return
        self._settings.place()
        self._kept = []
        self._child.start(self._settings.model_dump(mode="json"))
        try:
            self._notes = tuple(self._await(RecordKind.READY, _START_s)["notes"])
        except BaseException:
            self.close()
            raise

    def close(self) -> None:
        """End the process; idempotent."""
        self._child.close(_END_s)

    def send(self, payload: bytes) -> None:
        """Request a picture. Raises CodecError for any other message, DeviceError if the process has ended."""
        if payload != TRIGGER:
            raise CodecError(f"{len(payload)} bytes that are not a trigger", where=self.name)
        self._child.give({"pictures": 1})

    def receive(self) -> list[Datagram]:
        """Packets since the last call, oldest first. Raises DeviceError if the camera has stopped."""
        kept, self._kept = self._kept, []
        return self._child.datagrams(self._raise_error, kept)

    def report(self) -> dict[str, Any]:
        """Frames and markers seen so far, writes that the pipe did not accept, and problems in plain English.

        Raises:
            DeviceError: the process has ended or does not answer.
        """
        self._child.give({"report": True})
        return self._await(RecordKind.REPORT, _REPORT_s)

    def health(self) -> tuple[str, ...]:
        """Settings that the camera's driver did not accept, in plain English."""
        return self._notes

    def _await(self, kind: RecordKind, patience_s: float) -> dict[str, Any]:
        """Wait for the next record of a kind; packets are kept for :meth:`receive`. Raises DeviceError."""
        return self._child.await_record(kind, patience_s, self._keep)

    def _keep(self, record: Record) -> None:
        self._raise_error(record)
        self._kept.append(record)

    def _raise_error(self, record: Record) -> None:
        if record.kind is RecordKind.ERROR:
            raise DeviceError(record.payload.decode(), where=self.name)
