"""Measures both EtherCAT masters on the emulated two-slave hand, over a virtual cable: punctuality, losses, recovery.

Losses are compared with the emulator's own counts, and punctuality with a loop of the same priority that only waits: a
cycle that this loop misses, no program could have kept on this machine. Run it on an idle machine.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import tactile_lab
from drivers.core.clock import NANOSECONDS, MonotonicClock
from drivers.core.errors import DeviceError
from drivers.emulators.ethercat.server import EmulatedHandProcess
from drivers.emulators.ethercat.shadow_chain import ChainSettings
from drivers.emulators.laboratory.virtual_cable import virtual_cable
from drivers.ethercat.master import MasterSettings
from drivers.shadow.device.cycle_pace import CyclePace
from drivers.shadow.device.cycle_statistics import CycleStatistics, Punctuality
from drivers.shadow.device.hand import ShadowHand
from drivers.shadow.device.hand_process import HandProcess
from drivers.shadow.device.hand_settings import HandSettings
from drivers.shadow.device.hand_setup import HandSetup, Master
from drivers.shadow.device.real_time import PRIORITY, prefer
from drivers.shadow.ethercat.hand_transport import EthercatSettings

CALIBRATION = Path(tactile_lab.__file__).parent / "rigs" / "calibrations" / "simulated-hand"
CYCLE_s = 0.001
LOSS_SHARE, LOSSY_s = 0.01, 3.0
WATCHDOG_s = 0.1
_DRAIN_s, _PATIENCE_s, _GOOD_CYCLES = 0.02, 10.0, 20
_SAFEOP, _WATCHDOG_CODE = 4, 0x1B


@dataclass(frozen=True)
class WireRow:
    """One measurement.

    Attributes:
        master: ours, pysoem, or none.
        what: the test.
        noticed_ms: time until the hand reported the fault; None if there was none.
        back_ms: time until the hand was in operation again, or for the first time.
        detail: further figures, for people.
    """

    master: str
    what: str
    noticed_ms: float | None
    back_ms: float | None
    detail: str


def measure_ethercat(seconds: float) -> list[WireRow]:
    """Run all measurements of both masters; only of ours if SOEM is not installed, which a row then says.

    Args:
        seconds: how long each runs its 1 kHz cycle.

    Raises:
        DeviceError: no virtual cable can be created, or no raw socket opened; the message says what to do.
    """
    near, far = f"tlb{os.getpid()}", f"tlc{os.getpid()}"
    rows = [_nothing_but_waiting(seconds)]
    masters: tuple[Master, ...] = ("own", "pysoem")
    with virtual_cable(near, far):
        for master in masters:
            if master == "pysoem" and find_spec("pysoem") is None:
                rows.append(WireRow(master, "not measured", None, None, "the package pysoem is not installed"))
                continue
            trial = Trial(near, far, master)
            rows += [*trial.steady(seconds), trial.losses(), trial.kill(), trial.watchdog(), trial.bare()]
    return rows


class Trial:
    """One master on one cable.

    Args:
        near, far: the ends of the cable.
        master: name of the master.
    """

    def __init__(self, near: str, far: str, master: Master) -> None:
        self._near, self._far, self._master = near, far, master
        self._clock = MonotonicClock()

    def steady(self, seconds: float) -> list[WireRow]:
        """Run at 1 kHz in a separate process, with zero demands, and measure the processor time of a cycle."""
        with self._emulator("mapped") as emulator:
            process = HandProcess(self._setup(CYCLE_s))
            began_ns = self._clock.now_ns()
            process.connect()
            took_ms = self._since_ms(began_ns)
            try:
                first, before = process.report(), emulator.order()
                self._drain(process, seconds)
                report, after = process.report(), emulator.order()
            finally:
                process.close()
        return [
            WireRow(self._master, f"1 kHz for {seconds:g} s", None, took_ms, _steady(report, before, after)),
            WireRow(self._master, "processor time of a cycle", None, None, _processor(first, report)),
        ]

    def losses(self) -> WireRow:
        """Lose one frame in a hundred, and count losses."""
        with self._emulator("mapped") as emulator, self._hand() as (hand, _):
            before, counted = emulator.order(cable={"drop_share": LOSS_SHARE}), hand.counters
            longest_ns = fresh_ns = began_ns = self._clock.now_ns()
            longest_ns = 0
            while self._clock.now_ns() - began_ns < LOSSY_s * NANOSECONDS:
                if self._cycle(hand):
                    longest_ns, fresh_ns = max(longest_ns, self._clock.now_ns() - fresh_ns), self._clock.now_ns()
            after, now = emulator.order(cable={"drop_share": 0.0}), hand.counters
            back_ms = self._until(lambda: self._cycle(hand))
        lost = after["lost"] - before["lost"]
        detail = (
            f"{lost} of {after['frames'] - before['frames']} frames lost by the cable, {now.lost - counted.lost} "
            f"cycles lost by the hand's count; at most {longest_ns / 1e6:.1f} ms without a status"
        )
        return WireRow(self._master, f"{LOSS_SHARE:.0%} of frames lost", None, back_ms, detail)

    def kill(self) -> WireRow:
        """Kill the slaves' process, restart it, and reconnect."""
        emulator = EmulatedHandProcess(self._far, CALIBRATION / "joints.yaml", ChainSettings(eeprom="mapped"))
        emulator.start()
        try:
            with self._hand() as (hand, _):
                emulator.kill()
                noticed_ms, words = self._time_to_notice(hand)
                with self._emulator("mapped"):
                    back_ms = self._back(hand)
        finally:
            emulator.close()
        return WireRow(self._master, "slaves killed and restarted", noticed_ms, back_ms, words)

    def watchdog(self) -> WireRow:
        """Trip the palm's watchdog: by a pause if the master enables it, otherwise by an order to the palm."""
        own = self._master == "own"
        with self._emulator("mapped") as emulator, self._hand(watchdog_s=WATCHDOG_s if own else None) as (hand, wire):
            if own:
                self._clock.sleep_until_ns(self._clock.now_ns() + round(3 * WATCHDOG_s * NANOSECONDS))
                back_ms = self._until(lambda: self._cycle(hand))
                return WireRow(self._master, "watchdog of the palm", None, back_ms, "; ".join(wire.health()))
            emulator.order(fall=[_SAFEOP, _WATCHDOG_CODE])
            noticed_ms, words = self._time_to_notice(hand)
            back_ms = self._back(hand)
        return WireRow(self._master, "watchdog of the palm", noticed_ms, back_ms, words)

    def bare(self) -> WireRow:
        """Bring up a hand whose EEPROM holds only its identity."""
        began_ns = self._clock.now_ns()
        with self._emulator("bare"):
            began_ns = self._clock.now_ns()
            try:
                with self._hand():
                    back_ms = self._since_ms(began_ns)
                return WireRow(self._master, "bare EEPROM", None, back_ms, "in operation")
            except DeviceError as error:
                return WireRow(self._master, "bare EEPROM", self._since_ms(began_ns), None, f"refused: {error}")

    # --- parts -------------------------------------------------------------------------------------------------

    def _emulator(self, eeprom: Any) -> EmulatedHandProcess:
        return EmulatedHandProcess(self._far, CALIBRATION / "joints.yaml", ChainSettings(eeprom=eeprom))

    def _setup(self, cycle_s: float, watchdog_s: float | None = None, **hand: Any) -> HandSetup:
        settings = EthercatSettings(interface=self._near, watchdog_s=watchdog_s, master=MasterSettings(answer_s=0.01))
        return HandSetup(
            ethercat=settings,
            master=self._master,
            hand=HandSettings(cycle_s=cycle_s, **hand),
            joints=CALIBRATION / "joints.yaml",
            motors=CALIBRATION / "motors.yaml",
        )

    @contextmanager
    def _hand(self, **settings: Any) -> Iterator[tuple[ShadowHand, Any]]:
        """A connected hand in this process; closed afterwards, even if its slaves are gone."""
        setup = self._setup(0.002, **settings)
        transport = setup.transport(self._clock)
        hand = setup.device(transport, self._clock)
        hand.connect()
        try:
            yield hand, transport
        finally:
            _close(hand)

    def _cycle(self, hand: ShadowHand) -> bool:
        fresh = hand.exchange().fresh
        self._clock.sleep_until_ns(self._clock.now_ns() + round(CYCLE_s * NANOSECONDS))
        return fresh

    def _time_to_notice(self, hand: ShadowHand) -> tuple[float, str]:
        """Cycle until the hand stops itself; returns the time, milliseconds, and its message."""
        began_ns = self._clock.now_ns()
        while self._since_ms(began_ns) < 1000 * _PATIENCE_s:
            try:
                self._cycle(hand)
            except DeviceError as error:
                return self._since_ms(began_ns), str(error)
        raise DeviceError("the hand did not notice", where=self._master)

    def _back(self, hand: ShadowHand) -> float:
        """Reconnect and check that the hand keeps answering; returns the time, milliseconds."""
        began_ns = self._clock.now_ns()
        hand.reconnect()
        self._until(lambda: self._cycle(hand))
        back_ms = self._since_ms(began_ns)
        good = sum(self._cycle(hand) for _ in range(_GOOD_CYCLES))
        if not good:
            raise DeviceError("the hand answers no more after reconnecting", where=self._master)
        return back_ms

    def _until(self, done: Callable[[], bool]) -> float:
        began_ns = self._clock.now_ns()
        while not done():
            if self._since_ms(began_ns) > 1000 * _PATIENCE_s:
                raise DeviceError("the hand does not come back", where=self._master)
        return self._since_ms(began_ns)

    def _drain(self, process: HandProcess, seconds: float) -> None:
        until_ns = self._clock.now_ns() + round(seconds * NANOSECONDS)
        while self._clock.now_ns() < until_ns:
            self._clock.sleep_until_ns(self._clock.now_ns() + round(_DRAIN_s * NANOSECONDS))
            process.receive()

    def _since_ms(self, began_ns: int) -> float:
        return (self._clock.now_ns() - began_ns) / 1e6


def _nothing_but_waiting(seconds: float) -> WireRow:
    """Punctuality of a program on this machine that does nothing in its 1 kHz cycle."""
    clock, statistics = MonotonicClock(), CycleStatistics()
    with prefer(PRIORITY):
        pace, until_ns = CyclePace(clock, round(CYCLE_s * NANOSECONDS)), clock.now_ns() + round(seconds * NANOSECONDS)
        while clock.now_ns() < until_ns:
            statistics.add(*pace.wait())
    return WireRow("none", f"1 kHz for {seconds:g} s, only waiting", None, None, str(statistics.summary()))


def _close(hand: ShadowHand) -> None:
    """Close the hand; it is not an error if these trials have made it disappear."""
    try:
        hand.close()
    except DeviceError:
        return


def _steady(report: Mapping[str, Any], before: Mapping[str, Any], after: Mapping[str, Any]) -> str:
    hand, wire = report["hand"], report["wire"]
    stale = f", {wire['stale']} came back late and were left out" if wire else ""
    return (
        f"{Punctuality(**report['punctuality'])}; {hand['lost']} lost{stale}; the emulator saw "
        f"{after['frames'] - before['frames']} frames and lost {after['lost'] - before['lost']}"
    )


def _processor(first: Mapping[str, Any], last: Mapping[str, Any]) -> str:
    """Processor time of the hand's process per cycle, between two reports."""
    cycles = last["punctuality"]["cycles"] - first["punctuality"]["cycles"]
    return f"{1000.0 * (last['processor_s'] - first['processor_s']) / max(cycles, 1):.3f} ms in the hand's process"
