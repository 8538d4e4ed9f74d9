"""The one Nano17 device over each wire: what it reads, what it checks at start, and how it says that it cannot."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from drivers.ati.nano17 import Nano17, Nano17Settings
from drivers.ati.protocols import cal_file
from drivers.ati.wires.can_wire import CanWire
from drivers.ati.wires.controller_wire import ControllerWire
from drivers.ati.wires.conversation import Conversation
from drivers.ati.wires.digital_wire import DigitalWire
from drivers.ati.wires.gauge_volts import GaugeVoltsWire, encode_volts
from drivers.ati.wires.rdt_wire import RdtWire
from drivers.ati.wires.wire import ForceWire, spread_stamps
from drivers.core.clock import VirtualClock
from drivers.core.contacts import Array
from drivers.core.errors import CodecError, DeviceError
from drivers.core.fingertip import RigidTransform, load_fingertips
from drivers.core.transports import Datagram, MemoryTransport, Transport
from drivers.emulators.ati.can_unit import CanUnit
from drivers.emulators.ati.controller_unit import COUNTS_PER_N, ControllerUnit, COUNTS_PER_Nm
from drivers.emulators.ati.digital_unit import DigitalUnit
from drivers.emulators.ati.net_box_unit import NetBoxUnit
from drivers.emulators.ati.sensor import EmulatedSensor, emulated_calibration
from drivers.emulators.ati.unit import Unit
from drivers.force.force_fingertip import WrenchSample
from tests.support.repository import SIMULATED_HAND
from tests.support.unit_peer import UnitPeer

TIPS = SIMULATED_HAND / "fingertips.yaml"
PRESSED = np.array([1.0, -0.5, 2.0, 0.010, -0.004, 0.002])

WIRES: dict[str, tuple[Callable[[EmulatedSensor], Unit], Callable[[], ForceWire], float]] = {
    "net box": (NetBoxUnit, lambda: RdtWire(1e6, 1e6), 1e-5),
    "digital": (DigitalUnit, DigitalWire, 1e-5),
    "controller ascii": (ControllerUnit, lambda: ControllerWire("ascii", COUNTS_PER_N, COUNTS_PER_Nm), 0.5),
    "controller binary": (ControllerUnit, lambda: ControllerWire("binary", COUNTS_PER_N, COUNTS_PER_Nm), 0.5),
    "can": (CanUnit, CanWire, 1e-5),
}


class Line:
    """A device on an in-memory transport whose received messages are kept, as a recording keeps them."""

    def __init__(self, unit: Unit, wire: ForceWire, settings: Nano17Settings | None = None) -> None:
        self.clock = VirtualClock()
        self.peer = UnitPeer(unit, self.clock)
        self.recorded: list[Datagram] = []
        self.transport: Transport = _Recording(MemoryTransport("ft/FF", self.peer), self.recorded)
        self.device = Nano17(
            "FF", self.transport, self.clock, load_fingertips(TIPS)["FF"], settings or Nano17Settings(), wire
        )

    def cycle(self) -> list[WrenchSample]:
        self.clock.sleep_until_ns(self.clock.now_ns() + 10_000_000)
        self.peer.tick()
        samples = self.device.poll()
        self.device.update(samples)
        return samples

    def run(self, cycles: int = 40) -> list[WrenchSample]:
        return [sample for _ in range(cycles) for sample in self.cycle()]


class _Recording:
    def __init__(self, transport: Transport, kept: list[Datagram]) -> None:
        self.name, self._transport, self._kept = transport.name, transport, kept
        self.open, self.close, self.send = transport.open, transport.close, transport.send

    def receive(self) -> list[Datagram]:
        arrived = self._transport.receive()
        self._kept += arrived
        return arrived


def measured(line: Line) -> Array:
    return np.array([sample.wrench for sample in line.run()]).mean(axis=0)


@pytest.mark.parametrize("name", WIRES)
def test_every_wire_gives_the_wrench_that_acts(name: str) -> None:
    make_unit, make_wire, tolerance = WIRES[name]
    sensor = EmulatedSensor(noise_counts=0.0)
    sensor.press(PRESSED)
    line = Line(make_unit(sensor), make_wire())
    line.device.connect()
    # a gauge count is 0.7 mN and 12 uN m; a count of the controller 3 mN and 16 uN m
    step = np.repeat([1e-3 + 3e-3 * tolerance, 2e-5 + 1.6e-5 * tolerance], 3)
    assert np.all(np.abs(measured(line) - PRESSED) < step)
    line.device.close()


@pytest.mark.parametrize("name", WIRES)
def test_a_replay_of_the_received_messages_alone_gives_the_same_samples(name: str) -> None:
    make_unit, make_wire, _ = WIRES[name]
    line = Line(make_unit(EmulatedSensor(seed=3)), make_wire())
    line.device.connect()
    told = len(line.recorded)
    live = line.run()
    replayed = Nano17("FF", line.transport, VirtualClock(), load_fingertips(TIPS)["FF"], Nano17Settings(), make_wire())
    for datagram in line.recorded[:told]:
        replayed.receive(datagram)
    again = [sample for datagram in line.recorded[told:] for sample in replayed.receive(datagram)]
    assert len(live) >= 30
    assert [(s.stamp_ns, s.sent, s.wrench.tobytes()) for s in again] == [
        (s.stamp_ns, s.sent, s.wrench.tobytes()) for s in live
    ]


@pytest.mark.parametrize("name", [name for name in WIRES if name != "net box"])
def test_a_device_that_is_not_there_is_told_and_the_link_closed(name: str) -> None:
    class Nobody:
        rate_hz = 1.0

        def handle(self, payload: bytes) -> list[bytes]:
            return []

        def tick(self) -> bytes | None:
            return None

    line = Line(Nobody(), WIRES[name][1]())
    with pytest.raises(DeviceError, match=r"ft/FF: .*answer.*\. Check power"):
        line.device.connect()
    with pytest.raises(DeviceError, match="not open"):
        line.transport.receive()


@pytest.mark.parametrize(("unit", "wire"), [(DigitalUnit, DigitalWire), (CanUnit, CanWire)])
def test_another_sensor_than_the_rig_names_is_refused(
    unit: Callable[[EmulatedSensor], Unit], wire: Callable[..., ForceWire]
) -> None:
    sensor = EmulatedSensor(emulated_calibration("FT11111"))
    with pytest.raises(DeviceError, match="the sensor is FT11111, but the rig file names FT22222"):
        Line(unit(sensor), wire(serial="FT22222")).device.connect()
    line = Line(unit(sensor), wire(serial="FT11111"))
    line.device.connect()
    assert line.run()


def test_garbage_on_the_line_is_taken_for_a_wrong_baud_rate() -> None:
    class Garbled(ControllerUnit):
        def handle(self, payload: bytes) -> list[bytes]:
            return [bytes(0x80 | byte for answer in super().handle(payload) for byte in answer)]

    with pytest.raises(DeviceError, match="at this baud rate"):
        Line(Garbled(), ControllerWire("ascii", 320, 64_000)).device.connect()


def test_a_sensor_that_reports_a_fault_is_not_started() -> None:
    unit = DigitalUnit()
    unit.status = 32
    with pytest.raises(DeviceError, match="the sensor reports: supply voltage too low"):
        Line(unit, DigitalWire()).device.connect()


def test_an_empty_calibration_slot_is_told() -> None:
    with pytest.raises(DeviceError, match="calibration 2 of the sensor is not usable"):
        Line(DigitalUnit(), DigitalWire(slot=2)).device.connect()


def test_a_sensor_of_a_smaller_range_than_the_settings_is_refused() -> None:
    settings = Nano17Settings(force_range_N=(25.0, 25.0, 35.0), torque_range_Nm=(0.25, 0.25, 0.25))
    with pytest.raises(DeviceError, match=r"range is 12 12 17 N, 120 120 120 N mm, but the settings say 25 25 35 N"):
        Line(DigitalUnit(), DigitalWire(), settings).device.connect()


@pytest.mark.parametrize("unit", [DigitalUnit, CanUnit])
def test_one_saturated_gauge_voids_the_whole_reading_before_the_matrix(unit: Callable[..., Unit]) -> None:
    class Loose(EmulatedSensor):
        def gauges(self) -> tuple[int, ...]:
            return (*super().gauges()[:3], -32768, *super().gauges()[4:])

    line = Line(unit(Loose()), DigitalWire() if unit is DigitalUnit else CanWire())
    line.device.connect()
    samples = line.run()
    assert all(np.isnan(sample.wrench).all() and sample.faults == ("gauge 3 saturated",) for sample in samples)
    assert line.device.load_N(np.eye(3)) == np.inf
    assert "gauge 3 saturated" in line.device.health()


def test_a_status_error_in_the_stream_voids_the_reading() -> None:
    unit = CanUnit()
    line = Line(unit, CanWire())
    line.device.connect()
    unit.status = 0x8010
    assert line.run()[-1].faults == ("supply voltage too high",)
    digital = DigitalUnit()
    line = Line(digital, DigitalWire())
    line.device.connect()
    digital.status = 16
    assert line.run()[-1].faults == ("the sensor reports a status error",)


def test_a_controllers_error_voids_the_reading() -> None:
    unit = ControllerUnit()
    unit.error = 4
    line = Line(unit, ControllerWire("binary", COUNTS_PER_N, COUNTS_PER_Nm))
    line.device.connect()
    assert line.run()[-1].faults == ("the controller reports error 4",)


def test_the_tool_transform_moves_the_wrench() -> None:
    sensor = EmulatedSensor(noise_counts=0.0)
    sensor.press(np.array([0.0, 2.0, 0.0, 0.0, 0.0, 0.0]))
    tool = RigidTransform(translation_m=(0.0, 0.0, 0.010), rpy_rad=(0.0, 0.0, np.pi / 2))
    line = Line(CanUnit(sensor), CanWire(), Nano17Settings(sensor_T_tool=tool))
    line.device.connect()
    # +y of the sensor is +x of the tool; about the tool's origin, 10 mm above, the force turns by -y x ... = +0.02
    np.testing.assert_allclose(measured(line), [2.0, 0.0, 0.0, 0.0, -0.02, 0.0], atol=2e-3)


def test_near_the_end_of_the_range_the_load_is_infinite() -> None:
    sensor = EmulatedSensor(noise_counts=0.0)
    line = Line(CanUnit(sensor), CanWire())
    line.device.connect()
    line.run()
    assert line.device.load_N(np.eye(3)) < 0.2
    sensor.press(np.array([0.0, 0.0, 14.0, 0.0, 0.0, 0.0]))
    line.run()
    assert line.device.load_N(np.eye(3)) == np.inf
    assert "Fz at 82 % of the calibration range" in line.device.health()


def test_drift_between_tares_and_an_old_tare_are_told() -> None:
    sensor = EmulatedSensor(noise_counts=0.5)
    line = Line(CanUnit(sensor), CanWire())
    line.device.connect()
    line.run()
    line.device.tare(np.eye(3), reason="start")
    assert line.device.health() == ()
    sensor.press(np.array([0.0, 0.3, 0.0, 0.0, 0.0, 0.0]))
    line.run()
    line.device.tare(np.eye(3), reason="again")
    assert [text for text in line.device.health() if "moved" in text] == [
        "the bias moved by 0.30 N and 0.00 N mm in 0 s"
    ]
    line.clock.sleep_until_ns(line.clock.now_ns() + 31 * 60 * 10**9)
    line.cycle()
    assert "tared 31 minutes ago" in line.device.health()


def test_stamps_of_a_piece_are_spread_back_to_the_piece_before() -> None:
    assert spread_stamps(0, 1000, 4, 5000) == [250, 500, 750, 1000]
    assert spread_stamps(None, 1000, 3, 5000) == [1000, 1000, 1000]
    assert spread_stamps(0, 9000, 3, 300) == [8800, 8900, 9000]
    assert spread_stamps(0, 1000, 0, 5000) == []


# --- volts and .cal files ------------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", ["FT14048.cal", "FT11564.cal"])
def test_volts_go_through_a_real_calibration_file(lab_data: Path, name: str) -> None:
    calibration = cal_file.load(lab_data / "ati_cal" / name)
    settings = Nano17Settings(force_range_N=(50.0, 50.0, 70.0), torque_range_Nm=(0.5, 0.5, 0.5))
    wrench = np.array([2.0, -1.0, 5.0, 0.02, 0.03, -0.01])
    volts = np.linalg.solve(calibration.working_matrix, wrench)
    tip = Nano17(
        "FF",
        MemoryTransport("ft/FF", UnitPeer(CanUnit(), VirtualClock())),
        VirtualClock(),
        load_fingertips(TIPS)["FF"],
        settings,
        GaugeVoltsWire(calibration),
    )
    (sample,) = tip.receive(Datagram(encode_volts(7, tuple(volts)), 5))
    np.testing.assert_allclose(sample.wrench, wrench, atol=1e-9)
    assert sample.sent == 7
    (void,) = tip.receive(Datagram(encode_volts(8, (*volts[:5], 9.95)), 6))
    assert void.faults == ("gauge 5 saturated",)


def test_a_calibration_in_counts_is_refused_for_volts(lab_data: Path) -> None:
    with pytest.raises(CodecError, match=r"FT10484 is in counts.*Give the sensor's \.cal file"):
        GaugeVoltsWire(cal_file.load(lab_data / "ati_cal" / "FT10484_Net.xml"))


def test_temperature_terms_of_the_file_correct_the_volts(lab_data: Path) -> None:
    plain = cal_file.load(lab_data / "ati_cal" / "FT14048.cal")
    terms = cal_file.TemperatureTerms(np.full(6, 0.01), np.full(6, 0.02), thermistor_V=2.0)
    wire = GaugeVoltsWire(replace(plain, temperature=terms))
    volts = np.array([0.5, -0.2, 0.1, 0.3, -0.4, 0.2])
    (sample,) = wire.receive(Datagram(encode_volts(1, (*volts, 2.5)), 0))
    np.testing.assert_allclose(sample.wrench, plain.working_matrix @ ((volts + 0.005) / 0.99), atol=1e-12)
    (uncorrected,) = wire.receive(Datagram(encode_volts(2, tuple(volts)), 0))
    np.testing.assert_allclose(uncorrected.wrench, plain.working_matrix @ volts, atol=1e-12)


def test_no_volts_is_told() -> None:
    clock = VirtualClock()
    peer = UnitPeer(CanUnit(), clock)
    transport = MemoryTransport("ft/LF", peer)
    transport.open()
    calibration = replace(
        cal_file.AtiCalibration("FT1", "", "DAQ", "N", "Nm", np.eye(6), None, np.ones(6)), output_range_V=20.0
    )
    wire = GaugeVoltsWire(calibration)
    with pytest.raises(DeviceError, match="ft/LF: no gauge volts arrive"):
        wire.start(Conversation(transport, clock, wire.receive))
