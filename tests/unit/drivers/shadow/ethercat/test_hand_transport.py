"""Our master against the emulated two-slave hand, in memory and on virtual time."""

from __future__ import annotations

from typing import Any

import pytest

from drivers.core.clock import MonotonicClock, VirtualClock
from drivers.core.errors import CodecError, ConfigurationError, DeviceError
from drivers.emulators.ethercat.shadow_chain import ChainSettings, emulated_hand
from drivers.ethercat.master import Slave
from drivers.ethercat.ports import RawPort
from drivers.ethercat.registers import AlState
from drivers.shadow.device.hand import ShadowHand
from drivers.shadow.device.hand_settings import HandSettings
from drivers.shadow.device.hand_setup import HandSetup
from drivers.shadow.ethercat.hand_transport import EthercatSettings, EthercatTransport, find_palm
from drivers.shadow.protocol.palm_codec import PalmCommand
from tests.support.emulated_hand_wire import CALIBRATION, FILES, MS, Wire
from tests.support.memory_port import MemoryPort


def test_a_bare_hand_comes_into_operation_and_tells_who_it_is() -> None:
    wire = Wire(ChainSettings(serial=1178))
    wire.transport.open()
    assert wire.states == [AlState.OP, AlState.OP]
    found = wire.transport.hand
    assert (found.serial, found.image.name, found.palm.vendor, found.bridge.product) == (1178, "0220", 0x530, 0)
    assert found.watchdog_s is None


@pytest.mark.parametrize("palm", ["0220", "0230", "0240", "0250"])
def test_the_product_code_tells_the_palm_without_touching_the_slaves(palm: Any) -> None:
    wire = Wire(ChainSettings(palm=palm)).open()
    assert find_palm(EthercatSettings(interface="memory"), wire.clock, MemoryPort(wire.hand.ring)) == palm
    assert wire.states == [AlState.OP, AlState.OP]
    assert wire.cycle() is not None


def test_a_product_code_that_can_not_be_driven_is_told_with_what_to_do() -> None:
    wire = Wire(ChainSettings(product=0x0B))
    with pytest.raises(DeviceError, match=r"a board this program does not know \(product 0xb\)") as told:
        find_palm(EthercatSettings(interface="memory"), wire.clock, wire.port)
    assert "0220, 0230, 0240 and 0250 are supported; ask Shadow Robot" in str(told.value)
    with pytest.raises(DeviceError, match="not open"):
        wire.port.send(b"")


def test_two_hands_on_one_cable_are_told_with_their_serial_numbers() -> None:
    wire = Wire(ChainSettings(serial=378))
    wire.hand.ring.slaves += emulated_hand(wire.clock, CALIBRATION, ChainSettings(serial=554)).ring.slaves
    with pytest.raises(DeviceError, match=r"two hands on one cable, 378 and 554\. Connect each hand to an interface"):
        wire.transport.open()


def test_a_stated_palm_is_not_looked_for() -> None:
    stated = EthercatSettings(interface="nosuch0", palm="0240")
    looked_for = setup_of(EthercatSettings(interface="nosuch0"), palm="0230").with_known_palm(VirtualClock())
    assert looked_for.hand.palm == "0230"
    assert setup_of(stated).with_known_palm(VirtualClock()).hand.palm == "0240"
    with pytest.raises(DeviceError, match="nosuch0: no such network interface"):
        setup_of(EthercatSettings(interface="nosuch0")).with_known_palm(VirtualClock())
    with pytest.raises(ConfigurationError, match="palm differ"):
        setup_of(stated, palm="0230").transport(VirtualClock())


def setup_of(ethercat: EthercatSettings, **hand: Any) -> HandSetup:
    return HandSetup(
        ethercat=ethercat, hand=HandSettings(**hand), joints=FILES / "joints.yaml", motors=FILES / "motors.yaml"
    )


@pytest.mark.parametrize("palm", ["0220", "0230", "0240", "0250"])
def test_images_go_both_ways_in_the_layout_of_the_product(palm: Any) -> None:
    wire = Wire(ChainSettings(palm=palm)).open()
    assert wire.transport.hand.image.name == palm
    asked = wire.cycle(PalmCommand(1, 4, 1, 2))
    answer = wire.cycle(PalmCommand(1, 3, 0, 2))
    assert asked is not None
    assert answer is not None
    assert answer.written
    assert (answer.motor_data_type, answer.which_motors, answer.arrived) == (4, 1, 0xAAAAA)
    assert wire.transport.counts.empty <= 2


@pytest.mark.parametrize("palm", ["0220", "0230", "0240", "0250"])
def test_the_hand_driver_moves_a_joint_over_ethercat(palm: Any) -> None:
    wire = Wire(ChainSettings(palm=palm))
    hand = ShadowHand(wire.transport, wire.clock, CALIBRATION, HandSettings(palm=palm, cycle_s=0.001, soft_start_s=0.0))
    hand.connect()
    hand.set_targets({"FFJ3": 1.0})
    for _ in range(700):
        wire.clock.sleep_until_ns(wire.clock.now_ns() + MS)
        sample = hand.exchange()
    assert sample.fresh
    assert wire.hand.plant.joints_rad[2] == pytest.approx(1.0, abs=0.05)
    hand.close()
    assert wire.states == [AlState.INIT, AlState.INIT]


def test_before_its_first_service_the_palm_shows_its_marks() -> None:
    wire = Wire()
    wire.transport.open()
    master = wire.master()
    palm = Slave(1, 2)
    master.change_state(palm, AlState.PREOP)
    master.change_state(palm, AlState.SAFEOP)
    assert master.read(palm, 0x1046, 220)[:8] == bytes.fromhex("cc000000adde adde")


@pytest.mark.parametrize(
    ("chain", "settings", "words"),
    [
        (ChainSettings(vendor=0x2), {}, "first slave is from vendor 0x2, not from Shadow Robot"),
        (ChainSettings(product=0x01000002), {}, "second slave is a muscle hand"),
        (ChainSettings(product=77), {}, r"does not know \(product 0x4d\)"),
        (ChainSettings(palm="0240"), {"palm": "0220"}, 'a 0240 palm, not a 0220. Set hand.palm to "0240"'),
        (ChainSettings(serial=3), {"serial": 4}, "hand 3, not hand 4"),
        (ChainSettings(palm="0230", product=0x01000001), {"side": "right"}, "the palm of a left hand, not of a right"),
    ],
)
def test_a_wrong_device_is_named_with_what_to_do(chain: ChainSettings, settings: Any, words: str) -> None:
    wire = Wire(chain, **settings)
    with pytest.raises(DeviceError, match=words):
        wire.transport.open()
    with pytest.raises(DeviceError, match="not open"):
        wire.transport.send(bytes(70))


@pytest.mark.parametrize(("connected", "words"), [(0, "0 EtherCAT slaves"), (1, "1 EtherCAT slaves instead of")])
def test_an_incomplete_ring_is_named(connected: int, words: str) -> None:
    wire = Wire()
    wire.hand.ring.faults.connected = connected
    with pytest.raises(DeviceError, match=words):
        wire.transport.open()


def test_a_silent_wire_is_named() -> None:
    wire = Wire()
    wire.hand.ring.faults.drop = 1000
    with pytest.raises(DeviceError, match="no EtherCAT frame comes back"):
        wire.transport.open()


def test_frames_lost_while_setting_up_are_sent_again() -> None:
    wire = Wire(ChainSettings(seed=1))
    wire.hand.ring.faults.drop_share = 0.05
    wire.transport.open()
    assert wire.states == [AlState.OP, AlState.OP]


def test_a_command_of_another_palm_is_refused_before_it_is_sent() -> None:
    wire = Wire().open()
    with pytest.raises(CodecError, match="a command of 74 bytes instead of 70"):
        wire.transport.send(bytes(74))


def test_opening_twice_and_closing_twice_do_no_harm() -> None:
    wire = Wire().open()
    wire.transport.open()
    assert wire.transport.counts.openings == 1
    wire.transport.close()
    wire.transport.close()
    wire.transport.open()
    assert all(status is not None for status in wire.cycles(3))


def test_a_missing_interface_is_named_beside_those_present() -> None:
    with pytest.raises(DeviceError, match=r"nosuch0: no such network interface. Available interfaces: .*lo"):
        EthercatTransport("hand", EthercatSettings(interface="nosuch0"), MonotonicClock()).open()


def test_without_the_right_to_raw_sockets_the_hint_says_how_to_get_it(monkeypatch: pytest.MonkeyPatch) -> None:
    def refuse(*_: object) -> None:
        raise PermissionError(1, "Operation not permitted")

    monkeypatch.setattr("drivers.ethercat.ports.socket.socket", refuse)
    with pytest.raises(DeviceError, match=r"no permission for raw sockets.*setcap cap_net_raw"):
        RawPort("lo").open()
