"""The motor buses through python-can: its own bus factory, readers, writers and filters on the emulated hand."""

from __future__ import annotations

from collections.abc import Iterator
from importlib.metadata import entry_points
from itertools import pairwise
from pathlib import Path

import can
import pytest
from can import Message

from drivers.core.clock import VirtualClock
from drivers.core.errors import DeviceError
from drivers.emulators.ethercat.motor_can import VERSION, MotorCanBuses
from drivers.emulators.ethercat.shadow_chain import ChainSettings, emulated_hand
from drivers.shadow.ethercat.bootloader import bootloader_version
from drivers.shadow.ethercat.can_bridge import ShadowBridgeBus
from drivers.shadow.ethercat.hand_transport import EthercatSettings, EthercatTransport
from drivers.shadow.model.joint_calibration import JointCalibration
from drivers.shadow.protocol.palm_codec import MOTORS, CanFrame
from drivers.shadow.protocol.palm_images import PalmName
from tactile_lab import rigs
from tests.support.memory_port import MemoryPort

CALIBRATION = JointCalibration.load(Path(rigs.__file__).parent / "calibrations" / "simulated-hand" / "joints.yaml")


class Rig:
    """The emulated hand, and python-can's bus on it, which takes the palm from its product code."""

    def __init__(self, palm: PalmName = "0220", *, missing: frozenset[int] = frozenset(), **options: object) -> None:
        self.clock, self.motors = VirtualClock(), MotorCanBuses(missing)
        self.hand = emulated_hand(self.clock, CALIBRATION, ChainSettings(palm=palm), can=self.motors)
        port = MemoryPort(self.hand.ring)
        self.transport = EthercatTransport(
            "hand", EthercatSettings(interface="memory", poll_every=10), self.clock, port
        )
        self.bus = can.Bus(
            interface="shadow_bridge", channel="memory", transport=self.transport, clock=self.clock, **options
        )


@pytest.fixture
def rig() -> Iterator[Rig]:
    made = Rig()
    yield made
    made.bus.shutdown()


def message(identifier: int, data: bytes = b"", bus: int | None = 1) -> Message:
    return Message(arbitration_id=identifier, is_extended_id=False, data=data, channel=bus)


def content(each: Message) -> tuple[int, bytes, object]:
    return each.arbitration_id, bytes(each.data), each.channel


def test_the_interface_is_an_entry_point_of_python_can(rig: Rig) -> None:
    found = entry_points(group="can.interface")["shadow_bridge"]
    assert found.load() is ShadowBridgeBus
    assert isinstance(rig.bus, ShadowBridgeBus)
    assert "1000 kbit/s" in rig.bus.channel_info


@pytest.mark.parametrize("palm", ["0220", "0230", "0240", "0250"])
def test_a_frame_goes_out_on_its_bus_and_the_answer_comes_back(palm: PalmName) -> None:
    rig = Rig(palm)
    rig.bus.send(message(0x605, b"\x01\x02\x03", bus=2))
    answer = rig.bus.recv(0.1)
    assert answer is not None
    assert content(answer) == (0x615, b"\x01\x02\x03", 2)
    assert rig.motors.heard == [CanFrame(2, 3, 0x605, b"\x01\x02\x03".ljust(8, b"\0"))]
    rig.bus.shutdown()


def test_one_frame_a_cycle_each_way(rig: Rig) -> None:
    for number in range(5):
        rig.motors.announce(CanFrame(1, 1, 0x4A3, bytes([number]).ljust(8, b"\0")))
    received = [rig.bus.recv(1.0) for _ in range(5)]
    assert [each.data[0] for each in received if each is not None] == [0, 1, 2, 3, 4]
    stamps = [each.timestamp for each in received if each is not None]
    assert all(later - earlier == pytest.approx(0.001, abs=1e-4) for earlier, later in pairwise(stamps))


def test_receiving_ends_in_time_when_nobody_speaks(rig: Rig) -> None:
    before_ns = rig.clock.now_ns()
    assert rig.bus.recv(0.05) is None
    assert rig.clock.now_ns() - before_ns >= 50_000_000


def test_a_message_without_a_channel_goes_to_the_default_bus() -> None:
    rig = Rig(motor_bus=2)
    rig.bus.send(message(0x604, bus=None))
    assert rig.bus.recv(0.1).channel == 2
    rig.bus.shutdown()


def test_filters_of_python_can_hold(rig: Rig) -> None:
    rig.bus.set_filters([{"can_id": 0x614, "can_mask": 0x7FF}])
    rig.motors.announce(CanFrame(1, 0, 0x4A3))
    rig.bus.send(message(0x604))
    assert rig.bus.recv(0.1).arbitration_id == 0x614
    assert rig.bus.recv(0.01) is None


def test_a_palm_that_has_not_taken_the_frame_before_gets_it_again(rig: Rig) -> None:
    rig.hand.palm.service_ns = 2_500_000
    for number in range(4):
        rig.bus.send(message(0x605, bytes([number])))
    while rig.bus.recv(0.01) is not None:
        pass
    assert [frame.data[0] for frame in rig.motors.heard] == [0, 1, 2, 3]


def test_bootloaders_tell_their_versions(rig: Rig) -> None:
    assert [bootloader_version(rig.bus, motor, tries=1) for motor in range(MOTORS)] == [VERSION] * MOTORS


def test_a_missing_motor_is_named() -> None:
    rig = Rig(missing=frozenset({13}))
    with pytest.raises(DeviceError, match="motor bus 2: motor 13 does not report"):
        bootloader_version(rig.bus, 13, tries=2)
    assert bootloader_version(rig.bus, 12, tries=2) == VERSION
    rig.bus.shutdown()


@pytest.mark.parametrize("suffix", [".asc", ".blf", ".csv", ".log"])
def test_traffic_is_recorded_read_and_played_by_python_can_itself(rig: Rig, tmp_path: Path, suffix: str) -> None:
    for bus, identifier, data in ((1, 0x4A3, b"\x01\x02\x03\x04"), (2, 0x322, b"\xff\x00"), (1, 0x61A, b"")):
        rig.motors.announce(CanFrame(bus, len(data), identifier, data.ljust(8, b"\0")))
    path = tmp_path / f"motors{suffix}"
    with can.Logger(path) as writer:
        recorded = [rig.bus.recv(0.1) for _ in range(3)]
        for each in recorded:
            writer(each)
    with can.LogReader(path) as reader:
        read = list(reader)
    assert [content(each)[:2] for each in read] == [content(each)[:2] for each in recorded]
    for each in read:
        rig.bus.send(each)
    rig.bus.recv(0.01)
    assert [(frame.identifier, frame.length) for frame in rig.motors.heard] == [(0x4A3, 4), (0x322, 2), (0x61A, 0)]
    if suffix != ".csv":  # python-can's CSV has no column for the channel
        assert [frame.bus for frame in rig.motors.heard] == [1, 2, 1]


ANOTHER_PROGRAMS = """date Mon Nov 23 12:00:00.000 2026
base hex timestamps absolute
internal events logged
   0.000100 1  4A3             Rx   d 2 61 62
   0.000200 2  322             Rx   d 2 00 01
"""


def test_a_log_of_another_program_is_played_to_the_buses_that_it_names(rig: Rig, tmp_path: Path) -> None:
    log = tmp_path / "motors.asc"
    log.write_text(ANOTHER_PROGRAMS)
    with can.LogReader(log) as reader:
        read = list(reader)
    with pytest.raises(can.CanOperationError, match=r"no motor bus 0.*play a file of another program.*first_channel=0"):
        rig.bus.send(read[0])
    rig.bus._first_channel = 0
    for each in read:
        rig.bus.send(each)
    rig.bus.recv(0.01)
    assert [(frame.bus, frame.identifier) for frame in rig.motors.heard] == [(1, 0x4A3), (2, 0x322)]
    with pytest.raises(can.CanOperationError, match=r"no motor bus 2\. Set the message's channel to 0 or 1"):
        rig.bus.send(message(1, bus=2))


def test_a_notifier_hands_messages_to_listeners(rig: Rig) -> None:
    rig.motors.announce(CanFrame(1, 2, 0x4A3, b"ab".ljust(8, b"\0")))
    buffer = can.BufferedReader()
    buffer.on_message_received(rig.bus.recv(0.1))
    assert bytes(buffer.get_message(0).data) == b"ab"
    buffer.stop()


@pytest.mark.parametrize(
    ("bad", "words"),
    [
        (Message(arbitration_id=0x12345, is_extended_id=True), "11-bit data frames only"),
        (Message(arbitration_id=1, is_extended_id=False, is_remote_frame=True, dlc=2), "11-bit data frames only"),
        (Message(arbitration_id=1, is_extended_id=False, is_fd=True, data=bytes(12)), "11-bit data frames only"),
        (message(1, bus=3), "no motor bus 3. Set the message's channel to 1 or 2"),
    ],
)
def test_what_the_buses_do_not_have_is_refused(rig: Rig, bad: Message, words: str) -> None:
    with pytest.raises(can.CanOperationError, match=words):
        rig.bus.send(bad)


def test_a_failing_wire_is_told_in_the_drivers_words(rig: Rig) -> None:
    rig.hand.ring.faults.drop = 1000
    with pytest.raises(can.CanOperationError, match="did not accept the frame"):
        rig.bus.send(message(0x604), timeout=0.01)
    rig.hand.ring.faults.drop = 0
    rig.hand.ring.faults.connected = 1
    with pytest.raises(can.CanOperationError, match="the frame: 1 EtherCAT slaves answer instead of 2") as failed:
        rig.bus.send(message(0x604), timeout=0.01)
    assert len(rig.transport.health()) > 1
    assert rig.transport.health()[1] not in str(failed.value), "one problem is enough to know what to look at"


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({"motor_bus": 3}, "no motor bus 3"),
        ({"first_channel": 2}, "the first bus cannot be channel 2"),
        ({"palm": "0320"}, "unknown palm 0320"),
        ({"channel": "nosuch0"}, "nosuch0: no such network interface"),
        ({"channel": ""}, "no channel. Give the network interface"),
    ],
)
def test_options_that_do_not_fit_are_named(options: dict[str, object], words: str) -> None:
    with pytest.raises(can.CanInitializationError, match=words):
        ShadowBridgeBus(**{"channel": "memory", **options})  # type: ignore[arg-type]


def test_interfaces_are_offered_to_python_cans_detection() -> None:
    assert all(each["interface"] == "shadow_bridge" for each in ShadowBridgeBus._detect_available_configs())
