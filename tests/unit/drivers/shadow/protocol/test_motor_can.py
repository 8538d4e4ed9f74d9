from __future__ import annotations

import json
from pathlib import Path

import pytest

from drivers.core.errors import CodecError
from drivers.emulators.ethercat.motor_can import VERSION, MotorCanBuses
from drivers.shadow.protocol.motor_can import BootCommand, Direction, MotorIdentifier, bus_of
from drivers.shadow.protocol.motor_data import FromMotor, ToMotor
from drivers.shadow.protocol.palm_codec import CanFrame


def test_identifiers_are_those_of_the_published_examples(lab_data: Path) -> None:
    golden = json.loads((lab_data / "golden_vectors.json").read_text())["shadow_can"]
    mine = {
        "from_motor_id5_type3": MotorIdentifier(Direction.FROM_MOTOR, 5, FromMotor.PWM),
        "to_motor_id9_type2": MotorIdentifier(Direction.TO_MOTOR, 9, ToMotor.DEMAND_PWM),
        "bootloader_magic_id0": MotorIdentifier(Direction.BOOTLOADER, 0, BootCommand.MAGIC),
        "ack": MotorIdentifier(Direction.BOOTLOADER, 0, BootCommand.MAGIC, acknowledged=True),
    }
    assert {name: each.identifier for name, each in mine.items()} == {
        name: int(word, 16) for name, word in golden.items()
    }


def test_every_identifier_comes_apart_and_together_again() -> None:
    for identifier in range(0x800):
        assert MotorIdentifier.of(identifier).identifier == identifier
        assert str(MotorIdentifier.of(identifier))


@pytest.mark.parametrize("identifier", [-1, 0x800])
def test_more_than_eleven_bits_are_refused(identifier: int) -> None:
    with pytest.raises(CodecError, match="eleven bits"):
        MotorIdentifier.of(identifier)


def test_parts_that_do_not_fit_are_refused() -> None:
    with pytest.raises(CodecError, match="do not fit"):
        _ = MotorIdentifier(Direction.TO_MOTOR, 16, 2).identifier


@pytest.mark.parametrize(
    ("identifier", "words"),
    [
        (0x4A3, "motor 5 answers PWM"),
        (0x322, "motor 9 is sent DEMAND_PWM"),
        (0x604, "bootloader of motor 0: VERSION"),
        (0x614, "motor 0 acknowledges VERSION"),
        (0x60F, "bootloader of motor 0: command 15"),
        (0x007, "request for TEMPERATURE from the motors"),
    ],
)
def test_frames_are_told_in_words(identifier: int, words: str) -> None:
    assert str(MotorIdentifier.of(identifier)) == words


def test_motors_are_numbered_across_the_buses() -> None:
    for motor in range(20):
        bus, number = bus_of(motor)
        assert MotorIdentifier(Direction.TO_MOTOR, number, 0).motor(bus) == motor
    for bus, number in ((0, 1), (3, 1), (1, 10)):
        with pytest.raises(CodecError, match="no motor"):
            MotorIdentifier(Direction.TO_MOTOR, number, 0).motor(bus)


def test_emulated_bootloaders_answer_their_version_once_and_echo_the_rest() -> None:
    buses = MotorCanBuses(missing=frozenset({12}))
    assert buses.transfer(CanFrame(2, 0, 0x604)) == CanFrame(2, 4, 0x614, VERSION.ljust(8, b"\0"))
    assert buses.transfer(CanFrame()) == CanFrame()
    assert buses.transfer(CanFrame(1, 3, 0x605, b"12300000")) == CanFrame(1, 3, 0x615, b"12300000")
    assert buses.transfer(CanFrame(2, 0, 0x604 | 2 << 5)) == CanFrame()
    assert buses.transfer(CanFrame(1, 0, 0x604 | 12 << 5)) == CanFrame()
