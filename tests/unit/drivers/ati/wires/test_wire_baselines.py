"""Every word between a program and a Nano17 on each of its wires: start, stream, faults, silence; and what is told."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from drivers.ati.nano17 import Nano17, Nano17Settings
from drivers.ati.protocols.cal_file import AtiCalibration
from drivers.ati.protocols.modbus import SLAVE, START_STREAM, Frame
from drivers.ati.wires.can_wire import CanWire
from drivers.ati.wires.controller_wire import ControllerWire
from drivers.ati.wires.digital_wire import DigitalWire
from drivers.ati.wires.gauge_volts import GaugeVoltsWire, decode_volts, encode_volts
from drivers.ati.wires.net_box import achievable_rate, parse_page
from drivers.ati.wires.patience import Patience
from drivers.ati.wires.rdt_wire import RdtWire
from drivers.ati.wires.wire import ForceWire, spread_stamps
from drivers.core.clock import VirtualClock
from drivers.core.errors import CodecError, DeviceError
from drivers.core.fingertip import load_fingertips
from drivers.core.transports import Datagram, MemoryTransport
from drivers.emulators.ati.can_unit import CanUnit
from drivers.emulators.ati.controller_unit import COUNTS_PER_N, ControllerUnit, COUNTS_PER_Nm
from drivers.emulators.ati.digital_unit import DigitalUnit
from drivers.emulators.ati.net_box_unit import NetBoxUnit
from drivers.emulators.ati.sensor import RANGES, EmulatedSensor, emulated_calibration
from drivers.emulators.ati.unit import Unit
from tests.support.baseline import assert_baseline
from tests.support.digest import digest
from tests.support.plain_values import plain
from tests.support.repository import SIMULATED_HAND
from tests.support.unit_peer import UnitPeer

MS = 1_000_000
LOAD = np.array([0.4, -0.3, 1.2, 0.004, 0.002, -0.003])
_KEPT = 40


def sensor() -> EmulatedSensor:
    """A sensor whose calibration is the same to the last bit everywhere."""
    told = emulated_calibration()
    return EmulatedSensor(replace(told, matrix=np.round(told.matrix, 3) + 0.0))


class Volts:
    """A program that sends gauge volts on its own."""

    rate_hz, status = 100.0, 0

    def __init__(self) -> None:
        self.sensor, self.count = sensor(), 0

    def handle(self, payload: bytes) -> list[bytes]:
        return []

    def tick(self) -> bytes | None:
        self.count += 1
        return encode_volts(self.count, tuple(gauge / 3276.8 for gauge in self.sensor.gauges()))


def volts_wire() -> GaugeVoltsWire:
    told = sensor().calibration
    volts = AtiCalibration("FT1", "SI-12-0.12", "DAQ", "N", "Nm", told.working_matrix * 3276.8, None, np.array(RANGES))
    return GaugeVoltsWire(replace(volts, output_range_V=20.0))


class Unwilling(DigitalUnit):
    """A digital sensor that answers, but does not stream."""

    def _answer(self, request: Frame) -> Frame:
        return Frame(SLAVE, START_STREAM, b"\0") if request.function == START_STREAM else super()._answer(request)


WIRES: dict[str, tuple[Callable[[], Unit], Callable[[], ForceWire]]] = {
    "box": (lambda: NetBoxUnit(sensor(), 100), lambda: RdtWire(1e6, 1e6)),
    "digital": (lambda: DigitalUnit(sensor(), 100.0), DigitalWire),
    "digital slot 2": (lambda: DigitalUnit(sensor(), 100.0), lambda: DigitalWire(slot=2)),
    "digital other": (lambda: DigitalUnit(sensor(), 100.0), lambda: DigitalWire(serial="FT9")),
    "digital unwilling": (lambda: Unwilling(sensor(), 100.0), DigitalWire),
    "ascii": (lambda: ControllerUnit(sensor()), lambda: ControllerWire("ascii", COUNTS_PER_N, COUNTS_PER_Nm)),
    "binary": (lambda: ControllerUnit(sensor()), lambda: ControllerWire("binary", COUNTS_PER_N, COUNTS_PER_Nm)),
    "can": (lambda: CanUnit(sensor()), CanWire),
    "can other": (lambda: CanUnit(sensor()), lambda: CanWire(serial="FT9")),
    "volts": (Volts, volts_wire),
}


class Line(MemoryTransport):
    """Notes what passes; an unplugged one loses everything."""

    def __init__(self, peer: UnitPeer, clock: VirtualClock) -> None:
        super().__init__("ft/FF", peer)
        self.told: list[list[Any]] = []
        self.plugged = True
        self._clock, self._unit = clock, peer
        self._next_ns = 0

    def send(self, payload: bytes) -> None:
        self.told.append([self._clock.now_ns() // MS, "to", payload.hex()])
        if self.plugged:
            super().send(payload)

    def receive(self) -> list[Datagram]:
        while self._next_ns <= self._clock.now_ns():
            self._unit.tick()
            self._next_ns += 10 * MS
        arrived = super().receive() if self.plugged else []
        self.told += [[self._clock.now_ns() // MS, "from", each.payload.hex()] for each in arrived]
        return arrived


class Bench:
    def __init__(self, name: str) -> None:
        make_unit, make_wire = WIRES[name]
        self.clock, self.unit = VirtualClock(), make_unit()
        self.line = Line(UnitPeer(self.unit, self.clock), self.clock)
        tips = load_fingertips(SIMULATED_HAND / "fingertips.yaml")
        self.tip = Nano17("FF", self.line, self.clock, tips["FF"], Nano17Settings(), make_wire())
        self.found: dict[str, Any] = {}

    def connect(self) -> None:
        try:
            self.tip.connect()
            self.found["identity"] = self.tip.identity
        except DeviceError as refused:
            self.found["refused"] = f"{refused.where}: {refused.what} / {refused.hint}"
        self.found["connected"] = self.line.told[:_KEPT]
        self.found["sizes"] = [len(self.line.told), self.clock.now_ns()]

    def poll(self, what: str, times: int = 3) -> None:
        self.line.told.clear()
        samples = []
        for _ in range(times):
            self.clock.sleep_until_ns(self.clock.now_ns() + 10 * MS)
            taken = self.tip.poll()
            self.tip.update(taken)
            samples += taken
        seen = [[s.stamp_ns, s.wrench, s.sent, s.measured, s.status, list(s.faults), list(s.remarks)] for s in samples]
        self.found[what] = plain([self.line.told[:_KEPT], seen[-3:], len(seen), list(self.tip.health())])


@pytest.mark.parametrize("name", WIRES)
def test_a_session_on_each_wire(name: str) -> None:
    bench = Bench(name)
    bench.unit.sensor.press(LOAD)
    bench.connect()
    if "refused" not in bench.found:
        bench.poll("stream")
        bench.unit.status = 0x24
        bench.poll("status")
        bench.unit.status = 0
        bench.unit.sensor.press(1e4 * LOAD)
        bench.poll("saturated")
        bench.line.plugged = False
        bench.poll("unplugged", 15)
        bench.line.plugged = True
        bench.poll("plugged in", 15)
        bench.line.told.clear()
        bench.tip.close()
        bench.found["closed"] = bench.line.told
    assert_baseline(f"ati/{name.replace(' ', '_')}", bench.found, rtol=1e-6, atol=1e-9)


def test_what_is_told_of_each_device_that_does_not_answer_or_is_faulty() -> None:
    found = {}
    for name in ("box", "digital", "ascii", "binary", "can", "volts"):
        silent = Bench(name)
        silent.line.plugged = False
        silent.connect()
        faulty = Bench(name)
        faulty.unit.status = 0x11
        faulty.connect()
        if "refused" not in faulty.found:
            faulty.poll("stream", 1)
        found[name] = [silent.found.get("refused"), silent.found["sizes"], silent.found["connected"][:6]]
        found[f"{name} faulty"] = [faulty.found.get("refused"), faulty.found.get("stream")]
    assert_baseline("ati/silent", found, rtol=1e-6, atol=1e-9)


def test_pages_rates_stamps_and_patience() -> None:
    page = NetBoxUnit().page("/netftapi2.xml") or b""
    patience, told = Patience(0.1, 0), []
    for now_ms in (5, 10, 90, 91, 130, 150, 400):
        told.append(patience.over(now_ms * MS))
    rates = {str(wanted): achievable_rate(wanted) for wanted in (1, 2, 100, 999, 1000, 1400, 4000, 7000, 9000)}
    stamps = [
        spread_stamps(before, 100 * MS, count, 50 * MS)
        for before, count in ((None, 3), (60 * MS, 4), (10 * MS, 4), (100 * MS, 2), (200 * MS, 2), (60 * MS, 0))
    ]
    found = {"page": plain(parse_page(page)), "rates": rates, "stamps": stamps, "patience": told}
    found["volts"] = plain(decode_volts(encode_volts(7, (0.1, -0.2, 0.3, -0.4, 0.5, 9.9))))
    found["state"] = digest(list(page))
    for damaged in (
        page.replace(b"1000000", b"0"),
        page.replace(b"FT00001", b""),
        page[:40],
        page.replace(b">N<", b">x<"),
    ):
        try:
            told.append(str(parse_page(damaged).serial))
        except (CodecError, DeviceError) as error:
            told.append(str(error))
    assert_baseline("ati/pages", found)
