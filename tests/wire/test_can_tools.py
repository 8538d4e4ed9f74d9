"""python-can's own command line tools on the hand's motor buses, over a real wire."""

from __future__ import annotations

import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path

import can
import pytest

from drivers.emulators.ethercat.motor_can import VERSION
from drivers.emulators.ethercat.server import EmulatedHandProcess
from drivers.shadow.ethercat.bootloader import bootloader_version
from drivers.shadow.protocol.palm_codec import MOTORS
from tests.support.ethercat_wire import JOINTS, cable
from tests.support.interruptible import interruptible


@pytest.fixture(scope="module")
def ends() -> Iterator[tuple[str, str]]:
    with cable("c") as names:
        yield names


def tool(name: str, interface: str, *words: str) -> list[str]:
    return [sys.executable, "-m", f"can.{name}", "-i", "shadow_bridge", "-c", interface, *words]


def test_all_bootloaders_answer_over_the_wire(ends: tuple[str, str]) -> None:
    with EmulatedHandProcess(ends[1], JOINTS), can.Bus(interface="shadow_bridge", channel=ends[0]) as bus:
        assert {bootloader_version(bus, motor, tries=3) for motor in range(MOTORS)} == {VERSION}


def test_the_player_plays_a_log_onto_the_buses(ends: tuple[str, str], tmp_path: Path) -> None:
    log = tmp_path / "questions.asc"
    with can.Logger(log) as writer:
        for number in range(10):
            question = can.Message(
                timestamp=1000.0 + 0.005 * number, arbitration_id=0x604 | number << 5, is_extended_id=False, channel=2
            )
            writer(question)
    with EmulatedHandProcess(ends[1], JOINTS) as emulator:
        done = subprocess.run(
            tool("player", ends[0], str(log)), capture_output=True, text=True, timeout=60, check=False
        )
        assert done.returncode == 0, done.stderr
        assert emulator.order()["can_frames"] == 10


def test_the_player_plays_a_log_in_which_another_program_numbered_the_buses(
    ends: tuple[str, str], tmp_path: Path
) -> None:
    log = tmp_path / "vendor.asc"
    frames = "".join(f"   {0.01 * n:.6f} {1 + n % 2}  {0x604 | n << 5:X}             Tx   d 0\n" for n in range(10))
    log.write_text("date Mon Nov 23 12:00:00.000 2026\nbase hex timestamps absolute\ninternal events logged\n" + frames)
    with EmulatedHandProcess(ends[1], JOINTS) as emulator:
        for options, heard in (((), 0), (("--bus-kwargs", "first_channel=0"), 10)):
            words = [sys.executable, "-m", "can.player", *options, "-i", "shadow_bridge", "-c", ends[0], str(log)]
            done = subprocess.run(words, capture_output=True, text=True, timeout=60, check=False)
            assert (done.returncode == 0) == bool(heard), done.stderr
            assert heard or "--bus-kwargs first_channel=0" in done.stderr
            assert emulator.order()["can_frames"] == heard


def test_the_logger_records_what_the_motors_say(ends: tuple[str, str], tmp_path: Path) -> None:
    log = tmp_path / "motors.blf"
    announced = [(1 + number % 2, number) for number in range(100)]
    with EmulatedHandProcess(ends[1], JOINTS) as emulator:
        for bus, number in announced:
            emulator.order(announce=[bus, 0x4A3, f"{number:02x}000000"])
        logger = subprocess.Popen(
            interruptible(tool("logger", ends[0], "-f", str(log))), stdout=subprocess.PIPE, text=True
        )
        until = time.monotonic() + 30.0
        while emulator.order()["served"] < 120 and time.monotonic() < until:
            time.sleep(0.05)
        logger.send_signal(signal.SIGINT)
        logger.communicate(timeout=30)
    with can.LogReader(log) as reader:
        heard = [(each.channel, each.data[0]) for each in reader]
    assert heard == [each for each in announced if each in heard]
    assert len(heard) >= 50  # a cycle in which the machine is busy loses the frame that it carried
