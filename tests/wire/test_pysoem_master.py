"""An independent master, SOEM by way of pysoem, takes the emulated hand for a real one."""

from __future__ import annotations

import time
from collections.abc import Iterator
from typing import Any

import pytest

from drivers.core.clock import MonotonicClock
from drivers.core.errors import ConfigurationError, DeviceError
from drivers.emulators.ethercat.server import EmulatedHandProcess
from drivers.emulators.ethercat.shadow_chain import ChainSettings
from drivers.ethercat.master import MasterSettings
from drivers.shadow.device.hand import ShadowHand
from drivers.shadow.device.hand_settings import HandSettings
from drivers.shadow.ethercat.hand_transport import EthercatSettings
from drivers.shadow.ethercat.pysoem_transport import PysoemTransport
from drivers.shadow.model.joint_calibration import JointCalibration
from drivers.shadow.protocol.palm_codec import PalmCommand
from drivers.shadow.protocol.palm_images import PALMS
from tests.support.ethercat_wire import JOINTS, cable, check_it_moves

pytestmark = pytest.mark.usefixtures("real_time_alone")

pysoem = pytest.importorskip("pysoem", reason="the [ethercat] extra is not installed")


@pytest.fixture(scope="module")
def ends() -> Iterator[tuple[str, str]]:
    with cable("y") as names:
        yield names


def transport(interface: str, **settings: Any) -> PysoemTransport:
    settings = {"master": MasterSettings(answer_s=0.05)} | settings
    return PysoemTransport("hand", EthercatSettings(interface=interface, **settings), MonotonicClock())


def cycle(hand: PysoemTransport, count: int) -> None:
    for _ in range(count):
        hand.send(bytes(70))
        hand.receive()


def test_soem_finds_both_boards_by_their_eeproms(ends: tuple[str, str]) -> None:
    with EmulatedHandProcess(ends[1], JOINTS, ChainSettings(serial=1178)):
        master = pysoem.Master()
        master.open(ends[0])
        try:
            assert master.config_init() == 2
            assert [(each.man, each.id) for each in master.slaves] == [(0x530, 0), (0x530, 6)]
            serial = master.slaves[1].eeprom_read(0x0E)
            assert int.from_bytes(serial[:4], "little") == 1178
        finally:
            master.close()


@pytest.mark.parametrize("palm", ["0220", "0230", "0240"])
def test_soem_reaches_op_and_exchanges_the_image(ends: tuple[str, str], palm: Any) -> None:
    image, hand = PALMS[palm], transport(ends[0])  # type: ignore[index]
    with EmulatedHandProcess(ends[1], JOINTS, ChainSettings(palm=palm, eeprom="mapped")) as emulator:
        hand.open()
        written = 0
        for turn in range(60):
            hand.send(image.encode_command(PalmCommand(1, 3 + turn // 2 % 3, turn & 1, 2)))
            for datagram in hand.receive():
                written += image.decode_status(datagram.payload).written
            time.sleep(0.002)
        assert written >= 45
        assert emulator.order()["state"] == "OP"
        hand.close()


def test_the_hand_driver_works_through_soem(ends: tuple[str, str]) -> None:
    clock = MonotonicClock()
    with EmulatedHandProcess(ends[1], JOINTS, ChainSettings(eeprom="mapped")):
        settings = HandSettings(cycle_s=0.002, soft_start_s=0.0)
        check_it_moves(ShadowHand(transport(ends[0]), clock, JointCalibration.load(JOINTS), settings))


def test_a_bare_eeprom_is_refused_with_the_way_out(ends: tuple[str, str]) -> None:
    with EmulatedHandProcess(ends[1], JOINTS), pytest.raises(DeviceError, match=r"0 \+ 0 bytes.*the built-in master"):
        transport(ends[0]).open()


def test_a_palm_that_falls_back_is_told(ends: tuple[str, str]) -> None:
    hand = transport(ends[0], poll_every=2)
    with EmulatedHandProcess(ends[1], JOINTS, ChainSettings(eeprom="mapped")) as emulator:
        hand.open()
        emulator.order(fall=[4, 0x1A])
        with pytest.raises(DeviceError, match="palm has left operation: it is in SAFEOP with error 0x001A"):
            cycle(hand, 4)
        hand.close()


def test_a_palm_that_is_cut_off_while_running_is_told(ends: tuple[str, str]) -> None:
    hand = transport(ends[0], poll_every=2)
    with EmulatedHandProcess(ends[1], JOINTS, ChainSettings(eeprom="mapped")) as emulator:
        hand.open()
        emulator.order(cable={"connected": 1})
        with pytest.raises(DeviceError, match="palm has left operation"):
            cycle(hand, 4)
        hand.close()


def test_another_hand_is_named(ends: tuple[str, str]) -> None:
    with (
        EmulatedHandProcess(ends[1], JOINTS, ChainSettings(serial=3)),
        pytest.raises(DeviceError, match="hand 3, not hand 4"),
    ):
        transport(ends[0], serial=4).open()


def test_wrong_interface_and_missing_slaves_are_named(ends: tuple[str, str]) -> None:
    with pytest.raises(DeviceError, match="no network interface nosuch0"):
        transport("nosuch0").open()
    with pytest.raises(DeviceError, match="0 EtherCAT slaves instead of 2"):
        transport(ends[0]).open()


def test_the_watchdog_is_not_promised(ends: tuple[str, str]) -> None:
    with pytest.raises(ConfigurationError, match="does not set the palm's watchdog"):
        transport(ends[0], watchdog_s=0.1)
