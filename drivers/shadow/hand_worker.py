"""The hand's cycle in a process of its own: ``python -m drivers.shadow.hand_worker``, started by ``HandProcess``.

Takes lines of JSON on standard input, first what to drive and how, then orders. Gives records on standard output (see
:mod:`~drivers.shadow.hand_records`), about twenty cycles at a time, without ever waiting for the reader. When its
standard input ends, the program that started it is gone: the hand gets zero demands and the process ends.
"""

from __future__ import annotations

import dataclasses
import gc
import json
import select
import sys
from pathlib import Path
from typing import Any

from drivers.links import TappedLink
from drivers.shadow.cycle_statistics import CycleStatistics
from drivers.shadow.ethercat_link import EthercatLink, EthercatSettings
from drivers.shadow.hand import ShadowHand
from drivers.shadow.hand_records import RecordKind, RecordPipe
from drivers.shadow.hand_settings import HandSettings
from drivers.shadow.joint_calibration import JointCalibration
from drivers.shadow.motors import MotorMap
from drivers.shadow.real_time import request_real_time
from tactile_lab.clock import NANOSECONDS, Clock, MonotonicClock
from tactile_lab.errors import DeviceError, TactileLabError

CYCLES_PER_BLOCK = 20


class HandWorker:
    """Drives the hand cycle by cycle, obeying orders.

    Args:
        hand: connected.
        link: the hand's, for its counts.
        pipe: where records go; also the tap of the hand's link.
        clock: the session's.
        cycle_ns: period.
    """

    def __init__(self, hand: ShadowHand, link: EthercatLink, pipe: RecordPipe, clock: Clock, cycle_ns: int) -> None:
        self._hand, self._link, self._pipe, self._clock, self._cycle_ns = hand, link, pipe, clock, cycle_ns
        self._statistics = CycleStatistics()
        self._failed = self._ended = False

    def run(self) -> None:
        """Cycle until the orders end."""
        next_ns = self._clock.now_ns() + self._cycle_ns
        while not self._ended:
            self._clock.sleep_until_ns(next_ns)
            late_ns = self._clock.now_ns() - next_ns
            left_out = late_ns // self._cycle_ns
            self._statistics.add(late_ns, left_out)
            self._exchange()
            next_ns += self._cycle_ns * (1 + left_out)
            if self._statistics.cycles % CYCLES_PER_BLOCK == 0:
                self._pipe.flush()
            if select.select([sys.stdin], [], [], 0)[0]:
                self._obey(sys.stdin.readline())

    def _exchange(self) -> None:
        """A fault is told once; the cycle goes on with zero demands until someone resumes or ends it."""
        try:
            self._hand.exchange()
        except DeviceError as error:
            if not self._failed:
                self._failed = True
                self._pipe.put(RecordKind.ERROR, self._clock.now_ns(), str(error).encode())

    def _obey(self, line: str) -> None:
        order: dict[str, Any] = json.loads(line) if line else {"end": True}
        if "targets" in order:
            self._hand.set_targets(order["targets"])
        if order.get("stop"):
            self._hand.stop()
        if order.get("resume"):
            self._hand.resume()
            self._failed = False
        if order.get("report"):
            self._report()
        self._ended = bool(order.get("end"))

    def _report(self) -> None:
        report = {
            "punctuality": dataclasses.asdict(self._statistics.summary()),
            "wire": dataclasses.asdict(self._link.counts),
            "hand": dataclasses.asdict(self._hand.counters),
            "dropped_blocks": self._pipe.dropped_blocks,
            "health": self._hand.health() + self._link.health(),
        }
        self._pipe.put(RecordKind.REPORT, self._clock.now_ns(), json.dumps(report).encode())
        self._pipe.flush()


def main() -> None:
    """Connect what the first line names, drive it, close it."""
    start = json.loads(sys.stdin.readline())
    clock, pipe = MonotonicClock(), RecordPipe(sys.stdout.fileno())
    try:
        hand, link = _made(start, clock, pipe)
        hand.connect()
        scheduling = request_real_time()
        gc.freeze()
        pipe.put(RecordKind.READY, clock.now_ns(), json.dumps({"scheduling": scheduling}).encode())
        pipe.flush()
        try:
            HandWorker(hand, link, pipe, clock, round(start["hand"]["cycle_s"] * NANOSECONDS)).run()
        finally:
            hand.close()
    except TactileLabError as error:
        pipe.put(RecordKind.ERROR, clock.now_ns(), str(error).encode())
        sys.exit(error.exit_code)
    finally:
        pipe.close()


def _made(start: dict[str, Any], clock: Clock, pipe: RecordPipe) -> tuple[ShadowHand, EthercatLink]:
    link = EthercatLink(start["name"], EthercatSettings.model_validate(start["link"]), clock)
    joints, motors = JointCalibration.load(Path(start["joints"])), MotorMap.load(Path(start["motors"]))
    settings = HandSettings.model_validate(start["hand"])
    return ShadowHand(TappedLink(link, pipe, clock), clock, joints, settings, motors), link


if __name__ == "__main__":
    main()
