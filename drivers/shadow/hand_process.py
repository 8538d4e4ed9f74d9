"""The hand in a process of its own, seen from the session: start it, give it targets, collect its traffic.

The process keeps its cycle (1 kHz as Shadow's host does) whatever the session is busy with. Its traffic comes as
stamped bytes, for the recorder and for :class:`~drivers.shadow.hand_samples.HandDecoder`.
"""

from __future__ import annotations

import json
import os
import select
import subprocess
import sys
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from drivers.shadow.ethercat_link import EthercatSettings
from drivers.shadow.hand_records import Record, RecordKind, RecordReader
from drivers.shadow.hand_settings import HandSettings
from tactile_lab.clock import NANOSECONDS, Clock, MonotonicClock
from tactile_lab.errors import DeviceError

_START_s, _REPORT_s, _END_s = 30.0, 5.0, 10.0
_READ_BYTES = 1_048_576


class HandProcess:
    """A hand on EtherCAT, driven in another process.

    Args:
        name: the device's name in the rig.
        link: how the hand is reached.
        hand: how it is driven; ``cycle_s`` is the period of its cycle.
        joints, motors: calibration files.
        clock: for waiting on the process; it stamps with the monotonic clock.
    """

    def __init__(
        self,
        name: str,
        link: EthercatSettings,
        hand: HandSettings,
        joints: Path,
        motors: Path,
        clock: Clock | None = None,
    ) -> None:
        self.name, self._clock = name, clock or MonotonicClock()
        self._start = {
            "name": name,
            "link": link.model_dump(mode="json"),
            "hand": hand.model_dump(mode="json"),
            "joints": str(joints),
            "motors": str(motors),
        }
        self._process: subprocess.Popen[bytes] | None = None
        self._reader, self._kept = RecordReader(), list[Record]()
        self.scheduling = ""

    def connect(self) -> None:
        """Start the process and wait until the hand is connected. All or nothing, repeatable.

        Raises:
            DeviceError: the hand does not connect, in the driver's own words.
        """
        if self._process is not None:
            return
        command = [sys.executable, "-m", "drivers.shadow.hand_worker"]
        self._process = subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE)
        self._reader, self._kept = RecordReader(), []
        try:
            self._order(self._start)
            self.scheduling = json.loads(self._wait_for(RecordKind.READY, _START_s).payload)["scheduling"]
        except BaseException:
            self.close()
            raise

    def set_targets(self, targets_rad: Mapping[str, float]) -> None:
        """As :meth:`~drivers.shadow.hand.ShadowHand.set_targets`; a wrong name ends the process with an error."""
        self._order({"targets": dict(targets_rad)})

    def stop(self) -> None:
        """Zero demands from the next cycle on, until :meth:`resume`."""
        self._order({"stop": True})

    def resume(self) -> None:
        """Take back a stop or a fault; nothing moves before new targets are set."""
        self._order({"resume": True})

    def receive(self) -> list[Record]:
        """Traffic and errors that have come since the last call, oldest first; does not wait.

        Raises:
            DeviceError: the process is gone.
        """
        records, self._kept = self._kept, []
        while (more := self._read(0.0)) is not None:
            records += more
        return records

    def report(self) -> dict[str, Any]:
        """Punctuality, counts of the wire and of the hand, and what is wrong in words.

        Raises:
            DeviceError: the process is gone or does not answer.
        """
        self._order({"report": True})
        answer: dict[str, Any] = json.loads(self._wait_for(RecordKind.REPORT, _REPORT_s).payload)
        return answer

    def close(self) -> None:
        """End the process: the hand gets zero demands and is disconnected. Idempotent."""
        if self._process is None:
            return
        process, self._process = self._process, None
        try:
            process.communicate(timeout=_END_s)
        except subprocess.TimeoutExpired:
            process.kill()
            process.communicate()

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
        while (left_ns := until_ns - self._clock.now_ns()) > 0:
            for record in self._read(left_ns / NANOSECONDS) or []:
                if record.kind is kind:
                    return record
                if record.kind is RecordKind.ERROR and kind is RecordKind.READY:
                    raise DeviceError(record.payload.decode())
                self._kept.append(record)
        raise DeviceError("its process does not answer", where=self.name, hint="Connect again")

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
            raise DeviceError("not connected", where=self.name, hint="Connect the hand first")
        return self._process

    def _gone(self) -> DeviceError:
        return DeviceError("its process has ended", where=self.name, hint="See its last error, and connect again")
