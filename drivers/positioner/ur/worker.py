"""The arm in a process of its own: ``python -m drivers.positioner.ur.worker``, started by ``UrProcess``.

Takes lines of JSON on standard input: first the arm and its limits, then commands, each of which is answered by a
status on standard output. Between them it streams places to the arm, whatever the session is busy with, and brakes
when no command comes. When its standard input ends, the session is gone: it brakes, gives the arm back, and ends.
"""

from __future__ import annotations

import json
import os
import sys
import threading
from collections.abc import Sequence
from typing import Any, Protocol

from drivers.core.clock import NANOSECONDS, Clock, MonotonicClock
from drivers.core.configuration import validate
from drivers.core.contacts import Array
from drivers.core.errors import DeviceError
from drivers.core.orders import Order, OrderReader
from drivers.core.records import RecordKind, RecordPipe, report_failure
from drivers.positioner.ur.checks import is_reachable, stop_cause
from drivers.positioner.ur.codec import (
    ArmCommand,
    ArmFlags,
    ArmOrder,
    ArmState,
    ArmStatus,
    decode_arm_command,
    encode_arm_status,
)
from drivers.positioner.ur.limiter import MotionLimiter
from drivers.positioner.ur.rtde_arm import RtdeArm
from drivers.positioner.ur.settings import UrSettings
from drivers.shadow.device.real_time import request_real_time, threads

_PRIORITY = 70
"""Where permitted the stream comes before sessions, and after the hand."""

_LISTENER_PRIORITY = 71
"""Of the package's own threads: calls of the package wait for what they hear, without giving the processor away."""

_RUNS = ArmFlags.HEARD | ArmFlags.PROGRAM
"""Without these the arm stops by itself, and would take no command."""


class Arm(Protocol):
    """What the worker needs of an arm: :class:`RtdeArm`, or a double."""

    braked: bool

    def state(self) -> ArmState: ...
    def q(self) -> Array: ...
    def servo(self, q: Array, /) -> None: ...
    def stand(self) -> None: ...
    def freedrive(self) -> None: ...
    def restart(self) -> None: ...


class Records(Protocol):
    """Where statuses go."""

    def put(self, kind: RecordKind, stamp_ns: int, payload: bytes) -> object: ...
    def flush(self) -> object: ...


class UrWorker:
    """Streams to the arm what commands ask for, within the limits.

    Args:
        arm: taken over.
        settings: its limits.
        pipe: where statuses go.
        clock: the session's.
    """

    def __init__(self, arm: Arm, settings: UrSettings, pipe: Records, clock: Clock) -> None:
        self._arm, self._settings, self._pipe, self._clock = arm, settings, pipe, clock
        self._last: ArmCommand | None = None
        self._commanded_ns = self._taken_ns = clock.now_ns()
        self._limiter = self._limiter_from(arm.q())

    def _limiter_from(self, q: Array) -> MotionLimiter:
        settings = self._settings
        speeds = settings.speed_m_s, settings.speed_rad_s
        return MotionLimiter(speeds, (settings.acceleration_m_s2, settings.acceleration_rad_s2), q)

    def on_orders(self, orders: Sequence[Order]) -> bool:
        """Obey commands; whether there can be more."""
        for order in orders:
            if order.get("end"):
                return False
            self._on_command(decode_arm_command(bytes.fromhex(order["command"])))
        return True

    def _on_command(self, command: ArmCommand) -> None:
        if command.targets is not None:
            if command.order is ArmOrder.RESUME and not self._is_streaming():
                self._restart()
            self._last, self._commanded_ns = command, self._clock.now_ns()
        status = encode_arm_status(ArmStatus(command.sequence, self._arm.q(), self._arm.state()))
        self._pipe.put(RecordKind.RECEIVED, self._clock.now_ns(), status)
        self._pipe.flush()

    def _restart(self) -> None:
        try:
            self._arm.restart()
            _prefer_listeners()
        except DeviceError:
            self._arm.braked = True  # the next statuses say why
        self._limiter = self._limiter_from(self._arm.q())

    def cycle(self) -> None:
        """One step of the stream. An arm that cannot take it any more is not streamed to until a restart."""
        try:
            self._step()
            self._taken_ns = self._clock.now_ns()
        except DeviceError:  # its state, in the next statuses, says why; one target alone may be late
            if self._clock.now_ns() - self._taken_ns > self._settings.unheard_s * NANOSECONDS:
                self._arm.braked = True

    def _step(self) -> None:
        arm, last = self._arm, self._last
        if last is None or arm.braked or stop_cause(arm.state(), self._settings) is not None:
            arm.braked = last is not None
            if _RUNS in arm.state().flags:
                arm.stand()
        elif last.order is ArmOrder.FREEDRIVE:
            arm.freedrive()
            self._limiter = self._limiter_from(arm.q())
        else:
            arm.servo(self._next_place(last))

    def _is_streaming(self) -> bool:
        return not self._arm.braked and _RUNS in self._arm.state().flags

    def _next_place(self, last: ArmCommand) -> Array:
        silent_ns = self._clock.now_ns() - self._commanded_ns
        target = last.targets
        assert target is not None
        if silent_ns > self._settings.patience_s * NANOSECONDS or not is_reachable(target, self._settings):
            return self._limiter.brake(self._settings.cycle_s)
        return self._limiter.step(target, self._settings.cycle_s)


def stream(worker: UrWorker, orders: OrderReader, clock: Clock, cycle_s: float) -> None:
    """Execute orders as they arrive, and step the stream at its period, until the orders end."""
    due_ns = clock.now_ns()
    while True:
        due_ns = max(due_ns + round(cycle_s * NANOSECONDS), clock.now_ns())
        while (left_ns := due_ns - clock.now_ns()) > 0:
            if not worker.on_orders(orders.waiting(left_ns / NANOSECONDS)):
                return
        worker.cycle()


def main() -> None:
    """Take over the arm that the first line names, stream to it, give it back."""
    clock, pipe = MonotonicClock(), RecordPipe(_own_output())
    orders = OrderReader(sys.stdin.fileno())
    arm: RtdeArm | None = None
    try:
        with report_failure(pipe, clock):
            first: dict[str, Any] = orders.first()
            settings = validate(first["settings"], UrSettings, where=first["name"])
            arm = RtdeArm(first["host"], settings, clock, first["name"])
            identity = arm.connect()
            pipe.put(RecordKind.READY, clock.now_ns(), json.dumps({"identity": identity}).encode())
            pipe.flush()
            request_real_time(_PRIORITY)
            _prefer_listeners()
            stream(UrWorker(arm, settings, pipe, clock), orders, clock, settings.cycle_s)
    finally:
        if arm is not None:
            arm.close()


def _prefer_listeners() -> None:
    """The package's threads come before the one that calls it; an arm that is heard late counts as unheard."""
    if os.sched_getscheduler(0) == os.SCHED_FIFO:
        request_real_time(_LISTENER_PRIORITY, set(threads()) - {threading.get_native_id()})


def _own_output() -> int:
    """Our standard output; the package prints on it, and on standard error, what people see in our own words."""
    own, nowhere = os.dup(sys.stdout.fileno()), os.open(os.devnull, os.O_WRONLY)
    for descriptor in (sys.stdout.fileno(), sys.stderr.fileno()):
        os.dup2(nowhere, descriptor)
    return own


if __name__ == "__main__":
    main()
