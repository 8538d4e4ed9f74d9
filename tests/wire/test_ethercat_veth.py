"""Our master on a real wire: raw sockets on a virtual cable, the emulated hand in another process at its far end."""

from __future__ import annotations

import subprocess
import time
from collections.abc import Iterator
from typing import Any

import pytest

from drivers.core.clock import MonotonicClock
from drivers.core.errors import DeviceError
from drivers.emulators.ethercat.server import EmulatedHandProcess
from drivers.emulators.ethercat.shadow_chain import ChainSettings
from drivers.ethercat.master import MasterSettings
from drivers.shadow.device.hand import ShadowHand
from drivers.shadow.device.hand_settings import HandSettings
from drivers.shadow.ethercat.hand_transport import EthercatSettings, EthercatTransport
from drivers.shadow.model.joint_calibration import JointCalibration
from drivers.shadow.protocol.palm_codec import PalmCommand, PalmStatus
from drivers.shadow.protocol.palm_images import PALMS
from tests.support.ethercat_wire import JOINTS, cable, check_it_moves

pytestmark = pytest.mark.usefixtures("real_time_alone")

PATIENT = MasterSettings(answer_s=0.05, setup_answer_s=0.1)
"""A shared machine may take its time; these tests judge content, not speed."""


@pytest.fixture(scope="module")
def ends() -> Iterator[tuple[str, str]]:
    with cable() as names:
        yield names


class RigRuntime:
    def __init__(self, interface: str, **settings: Any) -> None:
        self.clock = MonotonicClock()
        settings = {"master": PATIENT, "poll_every": 20} | settings
        self.transport = EthercatTransport("hand", EthercatSettings(interface=interface, **settings), self.clock)

    def hand(self, **settings: Any) -> ShadowHand:
        return ShadowHand(
            self.transport, self.clock, JointCalibration.load(JOINTS), HandSettings(cycle_s=0.002, **settings)
        )

    def ask(self, count: int, palm: str = "0220") -> list[PalmStatus | None]:
        image = PALMS[palm]  # type: ignore[index]
        statuses = []
        for cycle in range(count):
            self.transport.send(image.encode_command(PalmCommand(1, 3, cycle & 1, 2)))
            datagrams = self.transport.receive()
            statuses.append(image.decode_status(datagrams[0].payload) if datagrams else None)
            time.sleep(0.002)
        return statuses


def exchange(hand: ShadowHand, cycles: int) -> None:
    for _ in range(cycles):
        hand.exchange()


def fresh(hand: ShadowHand) -> bool:
    time.sleep(0.002)
    return hand.exchange().fresh


@pytest.mark.parametrize("palm", ["0220", "0230", "0240", "0250"])
def test_a_bare_hand_reaches_op_and_exchanges_its_image(ends: tuple[str, str], palm: Any) -> None:
    runtime = RigRuntime(ends[0])
    with EmulatedHandProcess(ends[1], JOINTS, ChainSettings(palm=palm)) as emulator:
        runtime.transport.open()
        assert (runtime.transport.hand.serial, runtime.transport.hand.image.name) == (634, palm)
        answered = [status for status in runtime.ask(50, palm) if status is not None and status.written]
        assert len(answered) >= 40
        assert {status.which_motors for status in answered} == {0, 1}
        assert emulator.order()["state"] == "OP"
        runtime.transport.close()
        assert emulator.order()["state"] == "INIT"


def test_the_hand_driver_moves_a_joint(ends: tuple[str, str]) -> None:
    runtime = RigRuntime(ends[0])
    with EmulatedHandProcess(ends[1], JOINTS):
        check_it_moves(runtime.hand(soft_start_s=0.0))


def test_losses_are_counted_as_the_slaves_count_them(ends: tuple[str, str]) -> None:
    runtime = RigRuntime(ends[0])
    with EmulatedHandProcess(ends[1], JOINTS) as emulator:
        runtime.transport.open()
        emulator.order(cable={"drop_share": 0.02})
        runtime.ask(300)
        counts = emulator.order(cable={"drop_share": 0.0})
        assert runtime.ask(3)[-1] is not None
        ours = runtime.transport.counts
        assert ours.lost - ours.stale == counts["lost"] > 0  # what a busy machine delivered late was not lost
        runtime.transport.close()


def test_a_killed_and_restarted_hand_is_reconnected(ends: tuple[str, str]) -> None:
    runtime = RigRuntime(ends[0], master=MasterSettings(answer_s=0.02, setup_answer_s=0.1))
    emulator = EmulatedHandProcess(ends[1], JOINTS)
    emulator.start()
    hand = runtime.hand(link_patience_s=0.1)
    hand.connect()
    emulator.kill()
    with pytest.raises(DeviceError, match=r"no valid status for 0\.1 s"):
        exchange(hand, 80)
    with pytest.raises(DeviceError, match="no EtherCAT frame comes back"):
        hand.reconnect()
    with EmulatedHandProcess(ends[1], JOINTS):
        hand.reconnect()
        assert any(fresh(hand) for _ in range(4))
        hand.close()


def test_a_watchdog_trip_is_mended_by_itself(ends: tuple[str, str]) -> None:
    runtime = RigRuntime(ends[0], watchdog_s=0.4, poll_every=1)
    with EmulatedHandProcess(ends[1], JOINTS) as emulator:
        runtime.transport.open()
        assert runtime.transport.hand.watchdog_s == pytest.approx(0.4)
        time.sleep(0.8)
        assert runtime.ask(8)[-1] is not None
        assert emulator.order()["watchdog_trips"] == runtime.transport.counts.restarts == 1
        runtime.transport.close()


def test_a_pulled_interface_is_told(ends: tuple[str, str]) -> None:
    with cable("p") as (near, far), EmulatedHandProcess(far, JOINTS):
        runtime = RigRuntime(near)
        runtime.transport.open()
        _set_down(near)
        with pytest.raises(DeviceError, match=f"{near}: the network interface is down or gone"):
            runtime.ask(3)
        runtime.transport.close()


def _set_down(interface: str) -> None:
    subprocess.run(["ip", "link", "set", interface, "down"], check=True)
