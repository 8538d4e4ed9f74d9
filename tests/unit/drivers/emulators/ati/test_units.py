"""Emulated ATI units as another program sees them: what they answer, ignore and count."""

from __future__ import annotations

import numpy as np
import pytest

from drivers.ati.protocols import can_codec, modbus, rdt_codec
from drivers.ati.protocols.can_codec import Op
from drivers.ati.protocols.modbus import Frame
from drivers.ati.protocols.rdt_codec import Command
from drivers.ati.wires import net_box
from drivers.emulators.ati.can_unit import CanUnit
from drivers.emulators.ati.controller_unit import COUNTS_PER_N, ControllerUnit
from drivers.emulators.ati.digital_unit import DigitalUnit
from drivers.emulators.ati.net_box_unit import COUNTS_PER_UNIT, NetBoxUnit
from drivers.emulators.ati.sensor import EmulatedSensor
from drivers.hardware.can_bus import decode_frame, encode_frame

PRESS = np.array([1.0, -2.0, 3.0, 0.01, -0.02, 0.03])


def pressed() -> EmulatedSensor:
    sensor = EmulatedSensor(noise_counts=0.0)
    sensor.press(PRESS)
    return sensor


def test_a_sensor_measures_what_presses_it_up_to_its_counts_and_saturates() -> None:
    sensor = pressed()
    np.testing.assert_allclose(sensor.wrench(), PRESS, atol=2e-3)
    sensor.press(100.0 * PRESS)
    assert set(map(abs, sensor.gauges())) <= {32767, 32768}


def test_a_box_sends_as_many_records_as_asked_for_and_counts_on_without_a_client() -> None:
    box = NetBoxUnit(pressed())
    assert box.tick() is None
    box.handle(rdt_codec.encode_request(Command.START, 2))
    first, second, third = (box.tick() for _ in range(3))
    assert first is not None
    assert second is not None
    assert third is None
    (one,), (other,) = rdt_codec.records(first), rdt_codec.records(second)
    assert (one[0], other[0], other[1] - one[1]) == (1, 2, 1)
    np.testing.assert_allclose(np.array(one[3:]) / COUNTS_PER_UNIT, PRESS, atol=2e-3)
    assert not box.streaming


def test_a_box_tares_itself_on_request_and_stops_its_stream() -> None:
    box = NetBoxUnit(pressed())
    box.handle(rdt_codec.encode_request(Command.START, 0))
    box.handle(rdt_codec.encode_request(Command.SET_SOFTWARE_BIAS, 0))
    assert not box.streaming
    box.handle(rdt_codec.encode_request(Command.START, 0))
    record = box.tick()
    assert record is not None
    assert max(map(abs, next(rdt_codec.records(record))[3:])) <= 1


def test_a_box_ignores_what_is_no_request_and_pages_that_it_does_not_have() -> None:
    box = NetBoxUnit()
    assert box.handle(b"hello") == []
    assert box.refused == 1
    assert box.page("/index.htm") is None


@pytest.mark.parametrize(
    ("asked", "locked", "rate_hz"), [("1000", False, 1000), ("no", False, 7000), ("1000", True, 7000)]
)
def test_a_box_takes_a_rate_from_its_page_unless_it_is_locked(asked: str, locked: bool, rate_hz: int) -> None:
    box = NetBoxUnit()
    box.rate_locked = locked
    assert box.page(f"/comm.cgi?comrdtrate={asked}") is not None
    assert box.rate_hz == rate_hz
    state = box.page(net_box.PAGE)
    assert state is not None
    assert f"<comrdtrate>{rate_hz}</comrdtrate>".encode() in state


def test_a_board_answers_its_own_requests_only_and_never_streams() -> None:
    board = CanUnit(pressed(), base=0x12)
    own, foreign = (encode_frame(can_codec.request(Op.SERIAL, b"", base)) for base in (0x12, 0x13))
    (answer,) = board.handle(own)
    assert decode_frame(answer).data == b"FT00001\0"
    assert board.handle(foreign) == []
    assert board.handle(b"\xff") == []
    assert board.tick() is None
    assert len(board.handle(encode_frame(can_codec.request(Op.GAUGES, b"", 0x12)))) == 2
    assert board.sent == 1


def test_a_sensor_on_a_line_refuses_unknown_requests_and_addresses_in_the_form_of_modbus() -> None:
    sensor = DigitalUnit()
    (unknown,) = sensor.handle(modbus.encode(Frame(modbus.SLAVE, 0x11, bytes(4))))
    (beyond,) = sensor.handle(modbus.encode(modbus.read_request(0x0FFF, 2)))
    assert [modbus.decode(answer).function for answer in (unknown, beyond)] == [0x91, modbus.READ_HOLDING | 0x80]
    assert [modbus.decode(answer).data for answer in (unknown, beyond)] == [b"\x01", b"\x02"]


def test_a_stream_on_a_line_ends_after_fourteen_bytes() -> None:
    sensor = DigitalUnit()
    sensor.handle(modbus.encode(Frame(modbus.SLAVE, modbus.START_STREAM, b"\x55")))
    assert sensor.tick() is not None
    sensor.handle(bytes(13))
    assert sensor.streaming
    sensor.handle(bytes(1))
    assert sensor.tick() is None


def test_a_controller_echoes_answers_and_counts_what_it_does_not_know() -> None:
    controller = ControllerUnit(pressed())
    controller.handle(b"CD A\r")
    (line,) = controller.handle(b"QR\r")
    echo, *rest = line.split(b"\r\n")
    assert echo == b"QR"
    assert b"%d" % round(PRESS[1] * COUNTS_PER_N) in b"".join(rest)
    (unknown,) = controller.handle(b"hello\r")
    assert unknown == b"HELLO\r\nE\r\n>"
    assert (controller.unknown, controller.sent) == (1, 1)


def test_any_carriage_return_ends_a_controllers_stream() -> None:
    controller = ControllerUnit()
    controller.handle(b"QS\r")
    assert controller.tick() is not None
    controller.handle(b"\r")
    assert controller.tick() is None
