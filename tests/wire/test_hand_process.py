"""The hand's own process on a real wire: its cycle, its traffic, its reports, and how it ends."""

from __future__ import annotations

import os
import signal
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest
import yaml

from drivers.core.errors import DeviceError
from drivers.core.transports import Datagram
from drivers.emulators.ethercat.server import EmulatedHandProcess
from drivers.ethercat.master import MasterSettings
from drivers.shadow.device.hand_process import HandProcess
from drivers.shadow.device.hand_samples import HandDecoder
from drivers.shadow.device.hand_settings import HandSettings
from drivers.shadow.device.hand_setup import HandSetup
from drivers.shadow.ethercat.hand_transport import EthercatSettings
from drivers.shadow.model.joint_calibration import JointCalibration
from drivers.shadow.model.motors import DRIVEN_JOINTS, MotorMap
from drivers.shadow.protocol.palm_images import PALMS
from tests.support.ethercat_wire import JOINTS, cable

pytestmark = pytest.mark.usefixtures("real_time_alone")

MOTORS = JOINTS.with_name("motors.yaml")


class Tap:
    """Keeps what it sees."""

    def __init__(self) -> None:
        self.sent: list[Datagram] = []
        self.arrived: list[Datagram] = []

    def on_transmitted(self, transport: str, payload: bytes, stamp_ns: int) -> None:
        self.sent.append(Datagram(payload, stamp_ns))

    def on_received(self, transport: str, payload: bytes, stamp_ns: int) -> None:
        self.arrived.append(Datagram(payload, stamp_ns))

    def angles(self, joint: int = 2) -> list[float]:
        decoder = HandDecoder(JointCalibration.load(JOINTS))
        return [sample.joints_rad[joint] for sample in map(decoder.receive, self.arrived[-50:]) if sample is not None]

    def demands(self) -> list[int]:
        """The largest demand of each of the last messages sent."""
        images = (PALMS["0220"].decode_command(each.payload) for each in self.sent[-100:])
        return [max(map(abs, image.motor_data)) for image in images]


@pytest.fixture(scope="module")
def ends() -> Iterator[tuple[str, str]]:
    with cable("h") as names:
        yield names


def hand(
    interface: str, tap: Tap | None = None, link_patience_s: float = 2.0, patience_s: float = 60.0, **changes: Any
) -> HandProcess:
    transport = EthercatSettings(
        interface=interface, watchdog_s=1.0, master=MasterSettings(answer_s=0.02, setup_answer_s=0.1)
    )
    settings = HandSettings(cycle_s=0.002, soft_start_s=0.0, link_patience_s=link_patience_s)
    setup = HandSetup(ethercat=transport, hand=settings, joints=JOINTS, motors=MOTORS)
    return HandProcess(setup.model_copy(update=changes), tap, patience_s=patience_s)


def exchanged(process: HandProcess, until: Callable[[], bool], patience_s: float = 20.0) -> None:
    """Exchange as a session does until something is so."""
    given_up = time.monotonic() + patience_s
    while not until():
        process.exchange()
        time.sleep(0.01)
        assert time.monotonic() < given_up, "it did not come"


def test_it_drives_a_joint_and_shows_all_its_traffic(ends: tuple[str, str]) -> None:
    tap = Tap()
    with EmulatedHandProcess(ends[1], JOINTS):
        process = hand(ends[0], tap)
        process.connect()
        assert "SCHED_FIFO" in process.ready.scheduling
        assert (process.ready.serial, process.ready.palm) == (634, "0220")
        exchanged(process, lambda: len(tap.arrived) > 100)
        before = tap.angles()[-1]
        process.set_targets({"FFJ3": before + 0.3})
        exchanged(process, lambda: abs(tap.angles()[-1] - before - 0.3) < 0.05)
        report = process.report()
        assert report["dropped_blocks"] == 0
        assert report["hand"]["cycles"] >= report["punctuality"]["cycles"] > 100
        assert all(len(each.payload) == 70 for each in tap.sent)
        stamps = [each.stamp_ns for each in tap.arrived]
        assert stamps == sorted(stamps)
        process.close()
        process.close()


def test_the_watchdog_is_told_as_it_reads_back(ends: tuple[str, str]) -> None:
    with EmulatedHandProcess(ends[1], JOINTS):
        process = hand(ends[0])
        process.connect()
        process.close()
    assert process.ready.watchdog_s == pytest.approx(1.0, abs=1e-3)
    assert "hand 634, palm 0220 revision 1, in operation, watchdog reads back 1000.0 ms" in str(process.ready)


def test_a_hand_that_dies_is_told_once_and_the_process_goes_on(ends: tuple[str, str]) -> None:
    process = hand(ends[0], link_patience_s=0.2)
    with EmulatedHandProcess(ends[1], JOINTS) as emulator:
        process.connect()
        emulator.kill()
        with pytest.raises(DeviceError, match=r"no valid status for 0\.2 s"):
            exchanged(process, lambda: False)
        exchanged(process, lambda: "frames lost" in " ".join(process.health()))
    process.close()


def test_a_palm_that_is_cut_off_from_the_ring_ends_the_session(ends: tuple[str, str]) -> None:
    tap = Tap()
    with EmulatedHandProcess(ends[1], JOINTS) as emulator:
        process = hand(ends[0], tap)
        process.connect()
        process.set_targets({"FFJ3": 1.5})
        exchanged(process, lambda: any(tap.demands()))
        emulator.order(cable={"connected": 1})
        with pytest.raises(DeviceError, match="1 EtherCAT slaves answer instead of 2"):
            exchanged(process, lambda: False)
        process.close()
        assert not any(tap.demands()[-5:])


def test_a_hand_that_is_not_there_is_told_in_the_drivers_words(ends: tuple[str, str]) -> None:
    process = hand(ends[0])
    with pytest.raises(DeviceError, match="no EtherCAT frame comes back"):
        process.connect()
    with pytest.raises(DeviceError, match="not connected"):
        process.receive()


def test_a_stop_takes_the_demands_away(ends: tuple[str, str]) -> None:
    tap = Tap()
    with EmulatedHandProcess(ends[1], JOINTS):
        process = hand(ends[0], tap)
        process.connect()
        process.set_targets({"FFJ3": 1.5})
        exchanged(process, lambda: any(tap.demands()))
        process.stop()
        exchanged(process, lambda: not any(tap.demands()[-20:]))
        process.close()


def test_without_orders_for_long_the_demands_are_taken_away(ends: tuple[str, str]) -> None:
    tap = Tap()
    with EmulatedHandProcess(ends[1], JOINTS):
        process = hand(ends[0], tap, patience_s=0.5)
        process.connect()
        process.set_targets({"FFJ3": 1.5})
        exchanged(process, lambda: any(tap.demands()))
        time.sleep(1.5)  # a session that hangs
        with pytest.raises(DeviceError, match=r"no command from the session for \d\.\d s: demands set to zero"):
            process.exchange()
        assert not any(tap.demands()[-20:])
        process.close()


def test_motor_boards_are_set_up_when_connecting(ends: tuple[str, str], tmp_path: Path) -> None:
    boards, tap = tmp_path / "boards.yaml", Tap()
    one = {"max_pwm": 500, "sgleftref": 0, "sgrightref": 0, "f": 300, "p": 4500, "i": 0, "d": 0, "imax": 0}
    one |= {"deadband": 5, "sign": 0, "torque_limit": 400, "torque_limiter_gain": 64}
    board = {"pid": one, "backlash_compensation": True}
    boards.write_text(yaml.safe_dump({name.lower(): board for name in MotorMap.load(MOTORS).names}))
    with EmulatedHandProcess(ends[1], JOINTS):
        process = hand(ends[0], tap, boards=boards)
        process.connect()
        exchanged(process, lambda: len(tap.sent) > 20)
        process.close()
    kinds = {PALMS["0220"].decode_command(each.payload).to_motor_data_type for each in tap.sent}
    assert len(kinds) > 5


def test_the_motor_map_is_checked_in_the_process(ends: tuple[str, str], tmp_path: Path) -> None:
    content = yaml.safe_load(MOTORS.read_text())
    exchanged_map = content["motors"]
    exchanged_map["FFJ3"], exchanged_map["MFJ3"] = exchanged_map["MFJ3"], exchanged_map["FFJ3"]
    wrong = tmp_path / "motors.yaml"
    wrong.write_text(yaml.safe_dump(content))
    with EmulatedHandProcess(ends[1], JOINTS):
        process = hand(ends[0])
        process.connect()
        findings = process.first_move()
        assert [finding.joint for finding in findings if finding.ok] == list(DRIVEN_JOINTS)
        process.close()
        process = hand(ends[0], motors=wrong)
        process.connect()
        (finding,) = process.first_move(["FFJ3", "THJ2"])
        assert "moves MFJ3, but the motor map says FFJ3" in str(finding)
        process.close()


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
        process.exchange()
        ready.touch()
        time.sleep(60)
    finally:
        os._exit(1)
