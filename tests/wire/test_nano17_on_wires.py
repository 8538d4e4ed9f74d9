"""The product's Nano17 driver over real sockets, pseudo terminals and a CAN bus, against the emulated units."""

from __future__ import annotations

import socket
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import can
import numpy as np
import pytest

from drivers.ati.nano17 import Nano17, Nano17Settings
from drivers.ati.wires import net_box
from drivers.ati.wires.gauge_volts import encode_volts
from drivers.ati.wiring import (
    CanWiring,
    ControllerWiring,
    DigitalWiring,
    NetBoxWiring,
    VoltsWiring,
)
from drivers.core.clock import MonotonicClock
from drivers.core.errors import DeviceError
from drivers.core.fingertip import load_fingertips
from drivers.core.transports import Transport
from drivers.emulators.ati.can_server import CanServer
from drivers.emulators.ati.can_unit import CanUnit
from drivers.emulators.ati.controller_unit import COUNTS_PER_N, ControllerUnit, COUNTS_PER_Nm
from drivers.emulators.ati.digital_unit import DigitalUnit
from drivers.emulators.ati.net_box_server import NetBoxServer
from drivers.emulators.ati.net_box_unit import NetBoxUnit
from drivers.emulators.ati.sensor import EmulatedSensor
from drivers.emulators.pty_port import PtyPort
from drivers.fingertips.wiring import make_transport, make_wire
from drivers.force.force_fingertip import WrenchSample
from drivers.force.wire_settings import WireSettings
from tests.support.faults import Drop, FaultyTransport, Reorder, When
from tests.support.repository import SIMULATED_HAND
from tests.support.slcan_unit import SlcanUnit

TIPS = SIMULATED_HAND / "fingertips.yaml"
CLOCK = MonotonicClock()
PRESSED = np.array([1.0, -0.5, 2.0, 0.010, -0.004, 0.002])
COUNT = np.repeat([5e-3, 5e-5], 3)


def device(
    wiring: WireSettings,
    folder: Path = TIPS.parent,
    wrap: Callable[[Transport], Transport] = lambda transport: transport,
) -> Nano17:
    transport = wrap(make_transport(wiring, "ft/FF", CLOCK))
    return Nano17("FF", transport, CLOCK, load_fingertips(TIPS)["FF"], Nano17Settings(), make_wire(wiring, folder))


def listen(tip: Nano17, count: int, seconds: float = 10.0) -> list[WrenchSample]:
    """Poll every 2 ms until ``count`` samples have come."""
    taken: list[WrenchSample] = []
    end = time.monotonic() + seconds
    while len(taken) < count:
        assert time.monotonic() < end, f"{len(taken)} of {count} samples; {tip.health()}"
        samples = tip.poll()
        tip.update(samples)
        taken += samples
        time.sleep(0.002)
    return taken


@pytest.fixture
def sensor() -> EmulatedSensor:
    made = EmulatedSensor(noise_counts=0.0)
    made.press(PRESSED)
    return made


@pytest.fixture
def box(sensor: EmulatedSensor) -> Iterator[NetBoxServer]:
    with NetBoxServer(NetBoxUnit(sensor), "127.0.0.1", port=0) as server:
        yield server


def box_wiring(box: NetBoxServer, **changes: object) -> NetBoxWiring:
    place = {"wire": "net-ft", "host": "127.0.0.1", "port": box.port, "http_port": box.http_port, "rate_hz": 500}
    return NetBoxWiring.model_validate(place | changes)


# --- Net F/T -------------------------------------------------------------------------------------------------------


def test_a_box_is_found_set_read_and_left_silent(box: NetBoxServer) -> None:
    tip = device(box_wiring(box, serial="FT00001"))
    tip.connect()
    assert box.unit.rate_hz == 500
    assert tip.identity == "FT00001, firmware emulated"
    samples = listen(tip, 200)
    np.testing.assert_allclose(np.mean([sample.wrench for sample in samples], axis=0), PRESSED, atol=COUNT[0])
    assert (tip.sequences.lost, tip.sequences.skipped, tip.sequences.disordered) == (0, 0, 0)
    tip.close()
    for _ in range(100):
        if not box.unit.streaming:
            break
        time.sleep(0.01)
    assert not box.unit.streaming


def test_an_old_stream_of_another_client_is_taken_over(box: NetBoxServer) -> None:
    first, second = device(box_wiring(box)), device(box_wiring(box))
    first.connect()
    listen(first, 20)
    second.connect()
    assert len(listen(second, 50)) >= 50
    second.close()
    first.close()


def test_lost_records_are_counted_exactly(box: NetBoxServer) -> None:
    tip = device(box_wiring(box))
    tip.connect()
    listen(tip, 1)  # what comes before the first sample is counted by nobody
    box.lose = lambda number: number % 10 == 3
    listen(tip, 300)
    box.lose = lambda number: False
    last = box.unit.sent + 1
    while listen(tip, 1)[-1].sent < last:
        pass  # what was lost last is known by what came after it
    assert tip.sequences.lost == box.lost > 0
    assert any("records lost" in problem for problem in tip.health())
    tip.close()


@pytest.mark.parametrize(("fault", "words"), [(Drop(), "records lost"), (Reorder(), "out of order")])
def test_a_fault_on_the_real_wire_is_counted(box: NetBoxServer, fault: Drop | Reorder, words: str) -> None:
    wrapped: list[FaultyTransport] = []

    def wrap(transport: Transport) -> Transport:
        wrapped.append(FaultyTransport(transport, fault, When(first=20, every=7, count=20)))
        return wrapped[0]

    tip = device(box_wiring(box), wrap=wrap)
    tip.connect()
    listen(tip, 300)
    assert wrapped[0].injected == 20
    counted = tip.sequences.lost if words == "records lost" else tip.sequences.disordered
    # a record behind the next one counts once as lost and once as out of order
    assert counted == 20
    assert any(words in problem for problem in tip.health())
    tip.close()


def test_a_forged_record_from_a_foreign_address_never_becomes_a_sample(box: NetBoxServer) -> None:
    tip = device(box_wiring(box))
    tip.connect()
    listen(tip, 10)
    transport = tip._transport
    port = transport._socket.getsockname()[1]  # type: ignore[attr-defined]
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as stranger:
        stranger.bind(("127.0.0.9", 0))
        for _ in range(5):
            stranger.sendto(bytes(36), ("127.0.0.1", port))
    samples = listen(tip, 50)
    assert all(sample.sent for sample in samples)
    assert transport.foreign == 5  # type: ignore[attr-defined]
    assert any("5 datagrams from other addresses" in problem for problem in tip.health())
    tip.close()


@pytest.mark.parametrize(
    ("changes", "complaint"),
    [
        ({"serial": "FT99999"}, "the box uses the calibration of FT00001, but the rig file names FT99999"),
        ({"counts_per_N": 20480.0}, "1e\\+06 counts per N .* the rig file says 20480"),
    ],
)
def test_a_box_set_otherwise_than_the_rig_says_is_refused(
    box: NetBoxServer, changes: dict[str, object], complaint: str
) -> None:
    with pytest.raises(DeviceError, match=complaint):
        device(box_wiring(box, **changes)).connect()


def test_a_box_that_keeps_its_rate_is_refused(box: NetBoxServer) -> None:
    box.unit.rate_locked = True
    with pytest.raises(DeviceError, match="500 records per second were requested, but the box stays at 7000"):
        device(box_wiring(box)).connect()


def test_no_box_and_another_web_server_are_told_apart(box: NetBoxServer) -> None:
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        nothing = free.getsockname()[1]
    with pytest.raises(DeviceError, match="no web page from the box"):
        device(box_wiring(box, http_port=nothing)).connect()
    with pytest.raises(DeviceError, match="refuses /other"):
        net_box._get("127.0.0.1", box.http_port, "/other", 2.0)


def test_a_box_whose_records_are_kept_back_is_told(box: NetBoxServer) -> None:
    box.lose = lambda number: True
    with pytest.raises(DeviceError, match=r"answers, but no record arrives\. Check the firewall"):
        device(box_wiring(box)).connect()


def test_a_box_that_dies_is_silent_and_says_so(sensor: EmulatedSensor) -> None:
    server = NetBoxServer(NetBoxUnit(sensor), port=0)
    tip = device(box_wiring(server))
    tip.connect()
    listen(tip, 20)
    server.close()
    time.sleep(0.15)
    tip.update(tip.poll())
    time.sleep(0.15)
    assert any(problem.startswith("no record for") for problem in tip.health())
    tip.close()


# --- serial lines --------------------------------------------------------------------------------------------------


@pytest.mark.usefixtures("patient")
@pytest.mark.parametrize("baud", [1_250_000, 115_200, 19_200])
def test_a_digital_sensor_streams_at_each_of_its_rates(sensor: EmulatedSensor, baud: int) -> None:
    with PtyPort(DigitalUnit(sensor, rate_hz=1000.0), baud) as port:
        tip = device(DigitalWiring.model_validate({"wire": "digital", "port": port.path, "baud": baud, "parity": "N"}))
        tip.connect()
        samples = listen(tip, 300)
        np.testing.assert_allclose(np.mean([sample.wrench for sample in samples], axis=0), PRESSED, atol=COUNT[0])
        assert tip.wire.health() == ()
        stamps = [sample.stamp_ns for sample in samples]
        assert stamps == sorted(stamps)
        tip.close()
        tip.connect()  # a second time, with the line as the first left it
        listen(tip, 50)
        tip.close()


def test_a_stream_that_an_old_program_left_running_is_ended_first(sensor: EmulatedSensor) -> None:
    unit = DigitalUnit(sensor, rate_hz=2000.0)
    unit.streaming = True
    with PtyPort(unit, 115_200) as port:
        tip = device(DigitalWiring(wire="digital", port=port.path, baud=115_200, parity="N"))
        tip.connect()
        listen(tip, 100)
        tip.close()


@pytest.mark.usefixtures("patient")
@pytest.mark.parametrize("mode", ["ascii", "binary"])
def test_a_controller_answers_in_both_forms(sensor: EmulatedSensor, mode: str) -> None:
    with PtyPort(ControllerUnit(sensor, rate_hz=100.0), 9600) as port:
        settings = {"wire": "controller", "port": port.path, "mode": mode}
        scale = {"counts_per_N": COUNTS_PER_N, "counts_per_Nm": COUNTS_PER_Nm}
        tip = device(ControllerWiring.model_validate(settings | scale))
        tip.connect()
        samples = listen(tip, 20)
        np.testing.assert_allclose(np.mean([sample.wrench for sample in samples], axis=0), PRESSED, atol=COUNT[0])
        assert tip.wire.health() == ()
        tip.close()


def test_a_line_at_another_speed_is_no_sensor(sensor: EmulatedSensor) -> None:
    with PtyPort(DigitalUnit(sensor), 19_200) as port:
        tip = device(DigitalWiring(wire="digital", port=port.path, baud=115_200, parity="N"))
        with pytest.raises(DeviceError, match=r"ft/FF: the sensor does not answer\. .*baud rate"):
            tip.connect()


def test_an_adapter_that_is_pulled_out_ends_the_driver_in_order(sensor: EmulatedSensor) -> None:
    port = PtyPort(DigitalUnit(sensor, rate_hz=500.0), 115_200)
    tip = device(DigitalWiring(wire="digital", port=port.path, baud=115_200, parity="N"))
    tip.connect()
    listen(tip, 20)
    port.close()
    with pytest.raises(DeviceError, match=r"the serial port .* was disconnected"):
        listen(tip, 1000)
    tip.close()
    tip.close()


# --- CAN and volts -------------------------------------------------------------------------------------------------


@pytest.mark.usefixtures("patient")
def test_a_board_on_a_can_bus_answers_and_others_do_not_disturb(sensor: EmulatedSensor) -> None:
    wiring = CanWiring(wire="can-oem", interface="virtual", channel="nano17")
    with (
        CanServer(CanUnit(sensor), can.Bus(interface="virtual", channel="nano17")),
        CanServer(CanUnit(base=0x21), can.Bus(interface="virtual", channel="nano17")),
    ):
        tip = device(wiring)
        tip.connect()
        samples = listen(tip, 30)
        np.testing.assert_allclose(samples[-1].wrench, PRESSED, atol=COUNT[0])
        assert tip.wire.health() == ()
        tip.close()


def test_no_board_at_the_base_identifier_is_told() -> None:
    wiring = CanWiring(wire="can-oem", interface="virtual", channel="empty", base=0x33)
    with pytest.raises(DeviceError, match=r"no board answers at base identifier 0x33"):
        device(wiring).connect()


def test_volts_arrive_from_an_acquisition_program(lab_data: Path) -> None:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as free:
        free.bind(("127.0.0.1", 0))
        port = free.getsockname()[1]
    wiring = VoltsWiring(wire="gauge-volts", calibration="FT14048.cal", local_port=port)
    tip = device(wiring, lab_data / "ati_cal")
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as program:
        program.bind(("127.0.0.1", 0))
        tip._transport.open()
        for number in range(40):
            program.sendto(encode_volts(number, (0.1, 0.2, -0.1, 0.0, 0.05, 0.01 * (number % 2))), ("127.0.0.1", port))
        tip.connect()
        for number in range(40, 60):
            program.sendto(encode_volts(number, (0.1, 0.2, -0.1, 0.0, 0.05, 0.01 * (number % 2))), ("127.0.0.1", port))
        samples = listen(tip, 20)
    assert [sample.sent for sample in samples][-1] == 59
    assert tip.sequences.lost == 0
    tip.close()


def slcan(port: PtyPort) -> CanWiring:
    return CanWiring(wire="can-oem", interface="slcan", channel=port.path)


def test_a_board_behind_a_serial_can_adapter_answers_and_damaged_lines_are_counted(sensor: EmulatedSensor) -> None:
    adapter = SlcanUnit(CanUnit(sensor))
    with PtyPort(adapter, 115_200) as port:
        tip = device(slcan(port))
        tip.connect()
        samples = listen(tip, 20)
        np.testing.assert_allclose(samples[-1].wrench, PRESSED, atol=COUNT[0])
        assert "damaged" not in "; ".join(tip.wire.health())  # a busy machine's adapter may answer late
        count = 0

        def damage(line: bytes) -> bytes:
            nonlocal count
            count += 1
            return b"t2X" + line[3:] if count % 8 == 0 else line

        adapter.damage = damage
        listen(tip, 20)
        adapter.damage = lambda line: line
        listen(tip, 10)
        problems = "; ".join(tip.health())
        tip.close()
    assert "damaged readings of the adapter" in problems
    assert "lost one of their two frames" in problems or "requests without an answer" in problems
    assert adapter.refused == 0
