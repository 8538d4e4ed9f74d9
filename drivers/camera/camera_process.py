"""The camera in a process of its own, seen from the session: a transport like any other.

The process finds the markers of every frame as it comes, 30 a second, whatever the session is busy with; their corners
come as packets (see :mod:`drivers.camera.packet`), stamped where they arrived. A trigger asks for one picture beside.
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
    """A transport to a camera that another process watches.

    Args:
        name: the transport's name, in the rig and in recordings.
        settings: which camera, and what to look for.
    """

    def __init__(self, name: str, settings: CameraSourceSettings) -> None:
        self.name, self._settings = name, settings
        self._child = RecordProcess("drivers.camera.camera_worker", name, _LONGEST)
        self._kept: list[Record] = []
        self._notes: tuple[str, ...] = ()

    def open(self) -> None:
        """Start the process and wait until it has the camera; all or nothing, repeatable.

        Raises:
            DeviceError: the camera cannot be opened, in its driver's own words.
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
        """Ask for a picture. Raises CodecError for another message, DeviceError when the process is gone."""
        if payload != TRIGGER:
            raise CodecError(f"{len(payload)} bytes that are not a trigger", where=self.name)
        self._child.give({"pictures": 1})

    def receive(self) -> list[Datagram]:
        """Packets since the last call, oldest first. Raises DeviceError for what stopped the camera."""
        records, self._kept = self._kept, []
        while (more := self._child.read_records()) is not None:
            records += more
        for record in records:
            self._raise_error(record)
        return [Datagram(record.payload, record.stamp_ns) for record in records if record.kind is RecordKind.RECEIVED]

    def report(self) -> dict[str, Any]:
        """Frames and markers seen so far, blocks the pipe did not take, and what is wrong in words.

        Raises:
            DeviceError: the process is gone or does not answer.
        """
        self._child.give({"report": True})
        return self._await(RecordKind.REPORT, _REPORT_s)

    def health(self) -> tuple[str, ...]:
        """What the camera's driver did not do as asked, in words."""
        return self._notes

    def _await(self, kind: RecordKind, patience_s: float) -> dict[str, Any]:
        """The next record of a kind; packets are kept for :meth:`receive`. An error while waiting is raised."""
        return self._child.await_record(kind, patience_s, self._keep)

    def _keep(self, record: Record) -> None:
        self._raise_error(record)
        self._kept.append(record)

    def _raise_error(self, record: Record) -> None:
        if record.kind is RecordKind.ERROR:
            raise DeviceError(record.payload.decode(), where=self.name)
