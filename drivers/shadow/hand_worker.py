"""The hand's cycle in a process of its own: ``python -m drivers.shadow.hand_worker``, started by ``HandProcess``.

Takes orders on standard input (see :mod:`~drivers.orders`), first what to drive and how. Gives records on
standard output (see :mod:`~drivers.records`), some cycles at a time, without ever waiting for the reader.
When its standard input ends, the program that started it is gone: the hand gets zero demands and the process ends.
When orders only stop coming, that program hangs: the demands are taken away as well.
"""

from __future__ import annotations

import dataclasses
import gc
import json
import sys
import time

from drivers.links import TappedLink
from drivers.orders import Order, OrderReader
from drivers.records import RecordKind, RecordPipe
from drivers.shadow.cycle_pace import CyclePace
from drivers.shadow.cycle_statistics import CycleStatistics
from drivers.shadow.ethercat_link import EthercatLink
from drivers.shadow.first_move import check_motor_map
from drivers.shadow.hand import ShadowHand
from drivers.shadow.hand_samples import HandSample
from drivers.shadow.hand_setup import HandSetup
from drivers.shadow.motors import MotorMap
from drivers.shadow.pysoem_link import PysoemLink
from drivers.shadow.real_time import request_real_time
from tactile_lab.clock import NANOSECONDS, Clock, MonotonicClock
from tactile_lab.errors import DeviceError, TactileLabError

FLUSH_ns = 10_000_000
"""Records are handed over this often: some cycles at a time."""

HandLink = EthercatLink | PysoemLink


class HandWorker:
    """Drives the hand cycle by cycle, obeying orders.

    Args:
        hand: connected.
        link: the hand's, for its counts.
        motors: the hand's motor map.
        pipe: where records go; also the tap of the hand's link.
        orders: where orders come from.
        clock: the session's.
        cycle_ns: period.
        patience_ns: without any order for so long the demands are taken away.
    """

    def __init__(
        self,
        hand: ShadowHand,
        link: HandLink,
        motors: MotorMap,
        pipe: RecordPipe,
        orders: OrderReader,
        clock: Clock,
        cycle_ns: int,
        patience_ns: int,
    ) -> None:
        self._hand, self._link, self._motors = hand, link, motors
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
        """A fault is told once; the cycle goes on with zero demands until someone resumes or ends it."""
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
            self._tell(f"no order from the session for {silent_ns / NANOSECONDS:.1f} s: demands taken away")

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
            "wire": dataclasses.asdict(self._link.counts),
            "hand": dataclasses.asdict(self._hand.counters),
            "processor_s": time.process_time(),
            "dropped_blocks": self._pipe.dropped_blocks,
            "health": self._hand.health() + self._link.health(),
        }
        self._answer(RecordKind.REPORT, report)

    def _check_motor_map(self, joints: list[str]) -> None:
        self._moving_by_itself = True
        try:
            findings = check_motor_map(self._hand, self._motors, self._sound_turn, joints)
            self._answer(RecordKind.MOVES, {"moved": [dataclasses.asdict(finding) for finding in findings]})
        except DeviceError as error:
            self._answer(RecordKind.MOVES, {"error": str(error)})
        finally:
            self._moving_by_itself, self._heard_ns = False, self._clock.now_ns()

    def _sound_turn(self) -> HandSample:
        """A cycle of the motor check, which ends with the session or with the hand."""
        if (sample := self._turn()) is None or self._ended:
            raise DeviceError(self._trouble or f"{self._link.name}: the check of its motors was broken off")
        return sample

    def _answer(self, kind: RecordKind, content: dict[str, object]) -> None:
        self._pipe.put(kind, self._clock.now_ns(), json.dumps(content).encode())
        self._pipe.flush()


def main() -> None:
    """Connect what the first order names, drive it, close it."""
    orders, clock, pipe = OrderReader(sys.stdin.fileno()), MonotonicClock(), RecordPipe(sys.stdout.fileno())
    start = orders.first()
    try:
        setup = HandSetup.model_validate(start["setup"])
        link = setup.link(clock)
        hand = setup.device(TappedLink(link, pipe, clock), clock)
        hand.connect()
        ready = {"scheduling": request_real_time(), **_identity(link)}
        gc.freeze()
        pipe.put(RecordKind.READY, clock.now_ns(), json.dumps(ready).encode())
        pipe.flush()
        try:
            cycle_ns, patience_ns = (round(s * NANOSECONDS) for s in (setup.hand.cycle_s, start["patience_s"]))
            HandWorker(hand, link, setup.motor_map(), pipe, orders, clock, cycle_ns, patience_ns).run()
        finally:
            hand.close()
    except TactileLabError as error:
        pipe.put(RecordKind.ERROR, clock.now_ns(), str(error).encode())
        sys.exit(error.exit_code)
    finally:
        pipe.close()


def _identity(link: HandLink) -> dict[str, object]:
    """Who was found."""
    found = link.hand
    board = {"palm": found.image.name, "revision": found.palm.revision}
    return {"serial": found.serial, **board, "watchdog_s": found.watchdog_s}


if __name__ == "__main__":
    main()
