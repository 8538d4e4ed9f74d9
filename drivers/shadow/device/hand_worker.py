"""The hand's cycle in a process of its own, started by :class:`~drivers.shadow.device.hand_process.HandProcess`.

Takes orders on standard input (see :mod:`~drivers.core.orders`), first what to drive and how. Gives records on
standard output (see :mod:`~drivers.core.records`), some cycles at a time, without ever waiting for the reader.
When its standard input ends, the program that started it is gone: the hand gets zero demands and the process ends.
When orders only stop coming, that program hangs: the demands are taken away as well.
"""

from __future__ import annotations

import dataclasses
import gc
import json
import sys
import time

from drivers.core.clock import NANOSECONDS, Clock, MonotonicClock
from drivers.core.errors import DeviceError
from drivers.core.extensions import load_named_extensions
from drivers.core.orders import Order, OrderReader
from drivers.core.records import RecordKind, RecordPipe, report_failure
from drivers.core.transports import TappedTransport
from drivers.shadow.device.cycle_pace import CyclePace
from drivers.shadow.device.cycle_statistics import CycleStatistics
from drivers.shadow.device.first_move import check_motor_map
from drivers.shadow.device.hand import ShadowHand
from drivers.shadow.device.hand_samples import HandSample
from drivers.shadow.device.hand_setup import HandSetup
from drivers.shadow.device.real_time import request_real_time
from drivers.shadow.ethercat.hand_transport import EthercatTransport
from drivers.shadow.ethercat.pysoem_transport import PysoemTransport
from drivers.shadow.model.motors import MotorMap

FLUSH_ns = 10_000_000
"""Records are handed over this often: some cycles at a time."""

HandLink = EthercatTransport | PysoemTransport


class HandWorker:
    """Drives the hand cycle by cycle, obeying orders.

    Args:
        hand: connected.
        transport: the hand's, for its counts.
        motors: the hand's motor map.
        pipe: where records go; also the tap of the hand's transport.
        orders: where orders come from.
        clock: the session's.
        cycle_ns: period.
        patience_ns: without any order for so long the demands are taken away.
    """

    def __init__(
        self,
        hand: ShadowHand,
        transport: HandLink,
        motors: MotorMap,
        pipe: RecordPipe,
        orders: OrderReader,
        clock: Clock,
        cycle_ns: int,
        patience_ns: int,
    ) -> None:
        self._hand, self._transport, self._motors = hand, transport, motors
        self._pipe, self._orders, self._clock = pipe, orders, clock
        self._patience_ns = patience_ns
        self._pace, self._statistics = CyclePace(clock, cycle_ns), CycleStatistics()
        self._trouble = ""
        self._moving_by_itself = self._ended = False
        self._heard_ns = self._flushed_ns = clock.now_ns()

    def run(self) -> None:
        """Cycle until the orders end."""
        while not self._ended:
            self._turn()

    def _turn(self) -> HandSample | None:
        """One cycle; its sample, None when the hand has stopped itself."""
        self._statistics.add(*self._pace.wait())
        sample = self._exchange()
        self._flush_when_due()
        for order in self._orders.waiting():
            self._obey(order)
        self._watch_the_session()
        return sample

    def _exchange(self) -> HandSample | None:
        """A fault is reported once; the cycle continues with zero demands until it is resumed or ended."""
        try:
            return self._hand.exchange()
        except DeviceError as error:
            self._tell(str(error))
            return None

    def _flush_when_due(self) -> None:
        if (now_ns := self._clock.now_ns()) - self._flushed_ns >= FLUSH_ns:
            self._pipe.flush()
            self._flushed_ns = now_ns

    def _watch_the_session(self) -> None:
        """A session that has not moved anything yet may be busy with its other devices."""
        silent_ns = self._clock.now_ns() - self._heard_ns
        if silent_ns > self._patience_ns and self._hand.targets_rad and not self._moving_by_itself:
            self._hand.stop()
            self._tell(f"no command from the session for {silent_ns / NANOSECONDS:.1f} s: demands set to zero")

    def _tell(self, error: str) -> None:
        if not self._trouble:
            self._trouble = error
            self._pipe.put(RecordKind.ERROR, self._clock.now_ns(), error.encode())

    # --- orders ------------------------------------------------------------------------------------------------

    def _obey(self, order: Order) -> None:
        self._heard_ns = self._clock.now_ns()
        if "targets" in order:
            self._hand.set_targets(order["targets"])
        if order.get("stop"):
            self._hand.stop()
        if order.get("resume"):
            self._hand.resume()
            self._trouble = ""
        if order.get("report"):
            self._report()
        self._ended = self._ended or bool(order.get("end"))
        if "first_move" in order:
            self._check_motor_map(order["first_move"])

    def _report(self) -> None:
        report = {
            "punctuality": dataclasses.asdict(self._statistics.summary()),
            "wire": dataclasses.asdict(self._transport.counts),
            "hand": dataclasses.asdict(self._hand.counters),
            "processor_s": time.process_time(),
            "dropped_blocks": self._pipe.dropped_blocks,
            "health": self._hand.health() + self._transport.health(),
        }
        self._answer(RecordKind.REPORT, report)

    def _check_motor_map(self, joints: list[str] | None) -> None:
        self._moving_by_itself = True
        try:
            findings = check_motor_map(self._hand, self._motors, self._sound_turn, self._clock, joints)
            self._answer(RecordKind.MOVES, {"moved": [dataclasses.asdict(finding) for finding in findings]})
        except DeviceError as error:
            self._answer(RecordKind.MOVES, {"error": str(error)})
        finally:
            self._moving_by_itself, self._heard_ns = False, self._clock.now_ns()

    def _sound_turn(self) -> HandSample:
        """A cycle of the motor check, which ends with the session or with the hand."""
        if (sample := self._turn()) is None or self._ended:
            raise DeviceError(self._trouble or f"{self._transport.name}: the check of its motors was interrupted")
        return sample

    def _answer(self, kind: RecordKind, content: dict[str, object]) -> None:
        self._pipe.put(kind, self._clock.now_ns(), json.dumps(content).encode())
        self._pipe.flush()


def main() -> None:
    """Connect what the first order names, drive it, close it."""
    orders, clock, pipe = OrderReader(sys.stdin.fileno()), MonotonicClock(), RecordPipe(sys.stdout.fileno())
    start = orders.first()
    with report_failure(pipe, clock):
        load_named_extensions()
        setup = HandSetup.model_validate(start["setup"])
        transport = setup.transport(clock)
        hand = setup.device(TappedTransport(transport, pipe, clock), clock)
        hand.connect()
        ready = {"scheduling": request_real_time(), **_identity(transport)}
        gc.freeze()
        pipe.put(RecordKind.READY, clock.now_ns(), json.dumps(ready).encode())
        pipe.flush()
        try:
            cycle_ns, patience_ns = (round(s * NANOSECONDS) for s in (setup.hand.cycle_s, start["patience_s"]))
            HandWorker(hand, transport, setup.motor_map(), pipe, orders, clock, cycle_ns, patience_ns).run()
        finally:
            hand.close()


def _identity(transport: HandLink) -> dict[str, object]:
    """Who was found."""
    found = transport.hand
    board = {"palm": found.image.name, "revision": found.palm.revision}
    return {"serial": found.serial, **board, "watchdog_s": found.watchdog_s}


if __name__ == "__main__":
    main()
