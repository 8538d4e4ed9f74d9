"""The hand in a process of its own, seen from the session: start it, give it targets, collect its traffic.

The process keeps its cycle (1 kHz as Shadow's host does) whatever the session is busy with. Its traffic comes as
stamped bytes, for the recorder and for :class:`~drivers.shadow.device.hand_samples.HandDecoder`.
"""

from __future__ import annotations

import contextlib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from drivers.core.errors import DeviceError
from drivers.core.record_process import RecordProcess
from drivers.core.records import Record, RecordKind
from drivers.core.transports import Tap
from drivers.shadow.device.first_move import MoveFinding, require_motor_map
from drivers.shadow.device.hand_setup import HandSetup

PATIENCE_s = 1.0
"""Without any order for this time, the hand's process sets its demands to zero."""

_START_s, _REPORT_s, _MOVES_s, _END_s = 30.0, 5.0, 120.0, 10.0


@dataclass(frozen=True)
class HandReady:
    """What the process says when the hand is connected.

    Attributes:
        scheduling: of the process, in words.
        serial, palm, revision: of the hand that was found; the revision is its palm's.
        watchdog_s: time without commands after which the palm leaves operation, as read back; None when it never does.
    """

    scheduling: str
    serial: int = 0
    palm: str = ""
    revision: int = 0
    watchdog_s: float | None = None

    def __str__(self) -> str:
        """In words."""
        watchdog = "no watchdog" if self.watchdog_s is None else f"watchdog reads back {1000 * self.watchdog_s:.1f} ms"
        who = f"hand {self.serial}, palm {self.palm} revision {self.revision}, in operation"
        return f"{who}, {watchdog}, {self.scheduling}"


class HandProcess:
    """A hand on EtherCAT, driven in another process.

    Args:
        setup: the hand.
        tap: sees all traffic, in :meth:`exchange`; without one :meth:`receive` gives it.
        patience_s: see :data:`PATIENCE_s`.
        check_map: when connecting, nudge each motor to see that it moves the joint its map says.
    """

    def __init__(
        self,
        setup: HandSetup,
        tap: Tap | None = None,
        *,
        patience_s: float = PATIENCE_s,
        check_map: bool = False,
    ) -> None:
        self.name, self._setup, self._tap = setup.name, setup, tap
        self._check_map = check_map
        self._start = {"setup": setup.model_dump(mode="json"), "patience_s": patience_s}
        self._child = RecordProcess("drivers.shadow.device.hand_worker", setup.name)
        self._targets_rad: dict[str, float] = {}
        self._kept: list[Record] = []
        self.ready = HandReady("")

    # --- lifecycle ---------------------------------------------------------------------------------------------

    def connect(self) -> None:
        """Start the process and wait until the hand is connected. All or nothing, repeatable.

        Raises:
            DeviceError: the hand does not connect, in the driver's own words, or its motor map is wrong.
        """
        if self._child.started:
            return
        self._kept, self._targets_rad = [], {}
        self._child.start(self._start)
        try:
            self.ready = HandReady(**self._await(RecordKind.READY, _START_s))
            if self._check_map:
                require_motor_map(self.first_move(), self.name)
        except BaseException:
            self.close()
            raise

    def close(self) -> None:
        """End the process: the hand gets zero demands, which the tap sees, and is disconnected. Idempotent."""
        kept, self._kept = self._kept, []
        for record in [*kept, *self._child.last_records(_END_s)]:
            self._show(record)

    # --- motion ------------------------------------------------------------------------------------------------

    def set_targets(self, targets_rad: Mapping[str, float]) -> None:
        """As :meth:`~drivers.shadow.device.hand.ShadowHand.set_targets`, with the next :meth:`exchange`."""
        self._targets_rad |= targets_rad

    def stop(self) -> None:
        """Zero demands from the process's next cycle on, until :meth:`resume`. Never raises."""
        self._targets_rad = {}
        with contextlib.suppress(DeviceError):  # a process that is gone has taken the demands with it
            self._child.give({"stop": True})

    def resume(self) -> None:
        """Take back a stop or a fault; nothing moves before new targets are set."""
        self._child.give({"resume": True})

    def first_move(self, joints: Sequence[str] | None = None) -> list[MoveFinding]:
        """Nudge motor after motor, as :func:`drivers.shadow.device.first_move.check_motor_map`.

        Raises:
            DeviceError: the hand stopped itself, or its process is gone.
        """
        self._child.give({"first_move": None if joints is None else list(joints)})
        answer = self._await(RecordKind.MOVES, _MOVES_s)
        if "error" in answer:
            raise DeviceError(answer["error"])
        return [MoveFinding(**finding) for finding in answer["moved"]]

    # --- traffic -----------------------------------------------------------------------------------------------

    def exchange(self) -> None:
        """Hand over the newest targets, or a sign of life, and show the tap what has come.

        Raises:
            DeviceError: the hand has stopped itself, in its own words, or its process is gone.
        """
        targets_rad, self._targets_rad = self._targets_rad, {}
        self._child.give({"targets": targets_rad} if targets_rad else {"alive": True})
        self.catch_up()

    def catch_up(self) -> None:
        """Show the tap what has come since the last look. Raises DeviceError as :meth:`exchange`."""
        errors = [self._show(record) for record in self.receive()]
        if told := [error for error in errors if error]:
            raise DeviceError(told[0])

    def description(self) -> str:
        """Which hand was found, its watchdog as read back, and how its process is scheduled."""
        return str(self.ready)

    def receive(self) -> list[Record]:
        """Traffic and errors that have come since the last call, oldest first; does not wait.

        Raises:
            DeviceError: the process is gone.
        """
        records, self._kept = self._kept, []
        try:
            while (more := self._child.read_records()) is not None:
                records += more
        except DeviceError:
            if not records:  # its last words come first
                raise
        return records

    def report(self) -> dict[str, Any]:
        """Punctuality, counts of the wire and of the hand, and what is wrong in words.

        Raises:
            DeviceError: the process is gone or does not answer.
        """
        self._child.give({"report": True})
        return self._await(RecordKind.REPORT, _REPORT_s)

    def health(self) -> tuple[str, ...]:
        """What is wrong with hand and wire, in words. Raises DeviceError when the process is gone."""
        return tuple(self.report()["health"])

    def losses(self) -> dict[str, int]:
        """Cycles without a valid status, and blocks of traffic not read in time. Raises as :meth:`report`."""
        report = self.report()
        return {"lost cycles": report["hand"]["lost"], "queue drops": report["dropped_blocks"]}

    def _show(self, record: Record) -> str:
        """Show the tap a message; an error's words."""
        if record.kind is RecordKind.ERROR:
            return record.payload.decode()
        if self._tap is not None and record.kind is RecordKind.TRANSMITTED:
            self._tap.on_transmitted(self.name, record.payload, record.stamp_ns)
        if self._tap is not None and record.kind is RecordKind.RECEIVED:
            self._tap.on_received(self.name, record.payload, record.stamp_ns)
        return ""

    def _await(self, kind: RecordKind, patience_s: float) -> dict[str, Any]:
        """The next record of a kind; traffic goes to the tap, errors are kept. An error while starting is raised."""
        return self._child.await_record(kind, patience_s, self._raise if kind is RecordKind.READY else self._set_aside)

    def _raise(self, record: Record) -> None:
        if record.kind is RecordKind.ERROR:
            raise DeviceError(record.payload.decode())
        self._set_aside(record)

    def _set_aside(self, record: Record) -> None:
        if self._tap is None or record.kind is RecordKind.ERROR:
            self._kept.append(record)
        else:
            self._show(record)
