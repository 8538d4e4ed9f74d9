"""The hand's own process on a real wire: its cycle, its traffic, its reports, and how it ends."""

from __future__ import annotations

import os
import signal
import time
from collections.abc import Iterator
from pathlib import Path

import pytest
from ethercat_wire import JOINTS, cable

from drivers.emulators.ethercat_server import EmulatedHandProcess
from drivers.ethercat.master import MasterSettings
from drivers.links import Datagram
from drivers.shadow.ethercat_link import EthercatSettings
from drivers.shadow.hand_process import HandProcess
from drivers.shadow.hand_records import Record, RecordKind
from drivers.shadow.hand_samples import HandDecoder
from drivers.shadow.hand_settings import HandSettings
from drivers.shadow.joint_calibration import JointCalibration
from tactile_lab.errors import DeviceError


@pytest.fixture(scope="module")
def ends() -> Iterator[tuple[str, str]]:
    with cable("h") as names:
        yield names


def hand(interface: str, lost_limit: int = 200) -> HandProcess:
    link = EthercatSettings(interface=interface, master=MasterSettings(answer_s=0.02, setup_answer_s=0.1))
    settings = HandSettings(cycle_s=0.002, soft_start_s=0.0, lost_limit=lost_limit)
    return HandProcess("hand", link, settings, JOINTS, JOINTS.with_name("motors.yaml"))


def gathered(process: HandProcess, duration_s: float) -> list[Record]:
    records, until = [], time.monotonic() + duration_s
    while time.monotonic() < until:
        records += process.receive()
        time.sleep(0.02)
    return records


def samples(records: list[Record]) -> list[float]:
    decoder = HandDecoder(JointCalibration.load(JOINTS))
    received = [Datagram(each.payload, each.stamp_ns) for each in records if each.kind is RecordKind.RECEIVED]
    return [sample.joints_rad[2] for sample in map(decoder.receive, received) if sample is not None]


def test_it_drives_a_joint_and_hands_over_all_its_traffic(ends: tuple[str, str]) -> None:
    with EmulatedHandProcess(ends[1], JOINTS):
        process = hand(ends[0])
        process.connect()
        assert "SCHED_FIFO" in process.scheduling
        before = samples(gathered(process, 0.3))[-1]
        process.set_targets({"FFJ3": before + 0.3})
        records = gathered(process, 1.5)
        assert samples(records)[-1] == pytest.approx(before + 0.3, abs=0.05)
        report = process.report()
        assert report["dropped_blocks"] == 0
        assert report["hand"]["cycles"] >= report["punctuality"]["cycles"] > 100
        sent = [each for each in records if each.kind is RecordKind.TRANSMITTED]
        assert all(len(each.payload) == 70 for each in sent)
        stamps = [each.stamp_ns for each in records]
        assert stamps == sorted(stamps)
        process.close()
        process.close()


def test_a_hand_that_dies_is_told_once_and_the_process_goes_on(ends: tuple[str, str]) -> None:
    process = hand(ends[0], lost_limit=5)
    with EmulatedHandProcess(ends[1], JOINTS) as emulator:
        process.connect()
        emulator.kill()
        errors = [each for each in gathered(process, 1.0) if each.kind is RecordKind.ERROR]
        assert len(errors) == 1
        assert b"cycles in a row without a valid status" in errors[0].payload
        assert "frames lost" in " ".join(process.report()["health"])
    process.close()


def test_a_hand_that_is_not_there_is_told_in_the_drivers_words(ends: tuple[str, str]) -> None:
    process = hand(ends[0])
    with pytest.raises(DeviceError, match="no EtherCAT frame comes back"):
        process.connect()
    with pytest.raises(DeviceError, match="not connected"):
        process.receive()


def test_when_the_session_dies_the_hand_is_left_without_demands(ends: tuple[str, str], tmp_path: Path) -> None:
    with EmulatedHandProcess(ends[1], JOINTS) as emulator:
        session = os.fork()
        if session == 0:
            _session_that_hangs(ends[0], tmp_path / "ready")
        until = time.monotonic() + 30.0
        while not (tmp_path / "ready").exists() and time.monotonic() < until:
            time.sleep(0.05)
        assert emulator.order()["state"] == "OP"
        os.kill(session, signal.SIGKILL)
        os.waitpid(session, 0)
        while emulator.order()["state"] != "INIT" and time.monotonic() < until:
            time.sleep(0.05)
        assert emulator.order()["state"] == "INIT"


def _session_that_hangs(interface: str, ready: Path) -> None:
    try:
        process = hand(interface)
        process.connect()
        process.set_targets({"FFJ3": 1.0})
        ready.touch()
        time.sleep(60)
    finally:
        os._exit(1)
