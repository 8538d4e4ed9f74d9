"""Every fault of a wire against the Nano17 on each of its wires."""

from __future__ import annotations

import struct
from collections.abc import Callable
from dataclasses import replace
from typing import ClassVar

import numpy as np

from drivers.ati.nano17 import Nano17, Nano17Settings
from drivers.ati.protocols.cal_file import AtiCalibration
from drivers.ati.protocols.rdt_codec import SATURATION
from drivers.ati.wires.can_wire import CanWire
from drivers.ati.wires.controller_wire import ControllerWire
from drivers.ati.wires.digital_wire import DigitalWire
from drivers.ati.wires.gauge_volts import GaugeVoltsWire, encode_volts
from drivers.ati.wires.rdt_wire import RdtWire
from drivers.ati.wires.wire import ForceWire
from drivers.core.clock import VirtualClock
from drivers.core.fingertip import load_fingertips
from drivers.core.transports import MemoryTransport, Transport
from drivers.emulators.ati.can_unit import CanUnit
from drivers.emulators.ati.controller_unit import COUNTS_PER_N, ControllerUnit, COUNTS_PER_Nm
from drivers.emulators.ati.digital_unit import DigitalUnit
from drivers.emulators.ati.net_box_unit import NetBoxUnit
from drivers.emulators.ati.sensor import RANGES, EmulatedSensor
from drivers.emulators.ati.unit import Unit
from tests.support.driver_sweep import DriverSweep, SweptDevice
from tests.support.faults import Field, MessageLayout
from tests.support.repository import SIMULATED_HAND
from tests.support.unit_peer import UnitPeer

TIPS = SIMULATED_HAND / "fingertips.yaml"
NO_CHECK = "bits of a reading carry no check of their own here; the wire below has one"


def runtime_of(unit: Unit, wire: Callable[[], ForceWire]) -> SweptDevice:
    clock = VirtualClock()
    peer = _Waking(unit, clock)
    tips = load_fingertips(TIPS)

    def build(transport: Transport) -> Nano17:
        return Nano17("FF", transport, clock, tips["FF"], Nano17Settings(), wire())

    def use(device: Nano17) -> list[object]:
        samples = device.poll()
        device.update(samples)
        return list(samples)

    return SweptDevice(MemoryTransport("ft/FF", peer), clock, build, peer.tick, use)


class _Waking(UnitPeer):
    """A device that has always just sent something when it is first listened to, as a free-running one has."""

    def read(self):  # type: ignore[no-untyped-def]
        arrived = super().read()
        if not arrived and isinstance(self.unit, _Volts):
            self.tick()
            arrived = super().read()
        return arrived


class TestNetBox(DriverSweep):
    layout = MessageLayout(
        counters=(Field(0, 4), Field(4, 4)),
        values=(12, 36),
        saturate=lambda payload: payload[:8] + struct.pack(">I", SATURATION | 1 << 31) + payload[12:],
    )
    blind: ClassVar[dict[str, str]] = {"flip a bit": NO_CHECK}

    def runtime(self) -> SweptDevice:
        return runtime_of(NetBoxUnit(rate_hz=100), lambda: RdtWire(1e6, 1e6))


def _digital_seal(payload: bytes) -> bytes:
    return payload[:12] + bytes([sum(payload[:12]) & 0x7F])


class TestDigital(DriverSweep):
    layout = MessageLayout(
        values=(0, 12),
        seal=_digital_seal,
        saturate=lambda payload: _digital_seal(struct.pack(">h", 32767) + payload[2:]),
    )
    blind: ClassVar[dict[str, str]] = dict.fromkeys(
        ("drop", "duplicate", "reorder"), "the line has no counter: whole samples come and go unseen"
    )

    def runtime(self) -> SweptDevice:
        return runtime_of(DigitalUnit(rate_hz=100.0), DigitalWire)


class TestControllerAscii(DriverSweep):
    layout = MessageLayout()
    blind: ClassVar[dict[str, str]] = {
        "drop": "whole lines come and go unseen: they carry no counter",
        "duplicate": "as drop",
        "reorder": "as drop",
    }

    def runtime(self) -> SweptDevice:
        return runtime_of(ControllerUnit(), lambda: ControllerWire("ascii", COUNTS_PER_N, COUNTS_PER_Nm))


class TestControllerBinary(DriverSweep):
    layout = MessageLayout(saturate=lambda payload: payload.replace(b"QR\r\n\0", b"QR\r\n\1", 1))
    blind: ClassVar[dict[str, str]] = {
        "duplicate": "an answer given twice carries no counter",
    }

    def runtime(self) -> SweptDevice:
        return runtime_of(ControllerUnit(), lambda: ControllerWire("binary", COUNTS_PER_N, COUNTS_PER_Nm))


class TestCan(DriverSweep):
    layout = MessageLayout(
        values=(2, 10), saturate=lambda payload: payload[:4] + struct.pack(">h", -32768) + payload[6:]
    )
    blind: ClassVar[dict[str, str]] = {"flip a bit": NO_CHECK}

    def runtime(self) -> SweptDevice:
        return runtime_of(CanUnit(), CanWire)


class _Volts:
    """A data acquisition program."""

    rate_hz = 100.0

    def __init__(self) -> None:
        self._sensor, self._counter = EmulatedSensor(), 0

    def handle(self, payload: bytes) -> list[bytes]:
        return []

    def tick(self) -> bytes | None:
        self._counter += 1
        return encode_volts(self._counter, tuple(gauge / 3276.8 for gauge in self._sensor.gauges()))


def volts_calibration() -> AtiCalibration:
    told = EmulatedSensor().calibration
    volts = AtiCalibration("FT1", "SI-12-0.12", "DAQ", "N", "Nm", told.working_matrix * 3276.8, None, np.array(RANGES))
    return replace(volts, output_range_V=20.0)


class TestGaugeVolts(DriverSweep):
    layout = MessageLayout(
        counters=(Field(0, 4, "little"),),
        values=(4, 52),
        saturate=lambda payload: payload[:4] + struct.pack("<d", 10.0) + payload[12:],
    )

    def runtime(self) -> SweptDevice:
        return runtime_of(_Volts(), lambda: GaugeVoltsWire(volts_calibration()))
