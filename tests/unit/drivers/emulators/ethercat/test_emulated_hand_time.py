"""The emulated hand's time is that of its wire: its process may be late, the hand it stands for is not."""

from __future__ import annotations

import os
import sys
from collections import deque
from collections.abc import Iterator
from pathlib import Path

import pytest

from drivers.core.clock import VirtualClock
from drivers.emulators.ethercat.motor_can import MotorCanBuses
from drivers.emulators.ethercat.server import HandServer
from drivers.emulators.ethercat.shadow_chain import EmulatedHand, emulated_hand
from drivers.emulators.ethercat.stamped_port import StampedPort
from drivers.ethercat.frames import encode_frame
from drivers.ethercat.registers import AlState
from drivers.shadow.ethercat.hand_transport import EthercatSettings, EthercatTransport
from drivers.shadow.ethercat.ring import image_telegram
from drivers.shadow.model.joint_calibration import JointCalibration
from drivers.shadow.protocol.motor_data import FromMotor, MotorFlag
from drivers.shadow.protocol.palm_codec import PalmCommand
from drivers.shadow.protocol.palm_images import PALMS
from tactile_lab import rigs
from tests.support.memory_port import MemoryPort

JOINTS = JointCalibration.load(Path(rigs.__file__).parent / "calibrations" / "simulated-hand" / "joints.yaml")
MS, IMAGE = 1_000_000, PALMS["0220"]
COMMAND = encode_frame((image_telegram(IMAGE, IMAGE.encode_command(PalmCommand(1, FromMotor.FLAGS, 0, 2))),), bytes(6))


class QueuedPort(StampedPort):
    """Frames that arrived while this program was put aside; with the last of them its orders end."""

    def __init__(self, clock: VirtualClock, arrivals_ns: list[int], orders: int) -> None:
        super().__init__("memory", clock)
        self._arrivals_ns, self._orders = deque(arrivals_ns), orders

    def receive(self, timeout_s: float) -> bytes | None:
        if not self._arrivals_ns:
            if self._orders >= 0:
                os.close(self._orders)
                self._orders = -1
            self._clock.sleep_until_ns(self._clock.now_ns() + 5 * MS)
            return None
        self.arrived_ns = self._arrivals_ns.popleft()
        return COMMAND

    def send(self, frame: bytes) -> None:
        """The answers are not looked at."""


@pytest.fixture
def orders(monkeypatch: pytest.MonkeyPatch) -> Iterator[int]:
    reading, writing = os.pipe()
    with os.fdopen(reading) as standard_input:
        monkeypatch.setattr(sys, "stdin", standard_input)
        yield writing


def served(time: VirtualClock, intervals_ms: list[int], orders: int) -> EmulatedHand:
    """A hand in operation, with a watchdog of 15 ms, whose program gets to its frames when the last has just come."""
    hand, can = emulated_hand(time, JOINTS), MotorCanBuses()
    EthercatTransport(
        "hand", EthercatSettings(interface="memory", watchdog_s=0.015), time, MemoryPort(hand.ring)
    ).open()
    began_ns = time.now_ns()
    arrivals_ns = [began_ns + MS * sum(intervals_ms[: count + 1]) for count in range(len(intervals_ms))]
    late = VirtualClock(arrivals_ns[-1])
    HandServer(hand, time, QueuedPort(late, arrivals_ns, orders), can, late).run()
    return hand


def flags(hand: EmulatedHand) -> int:
    """The motors' flags when they were last asked."""
    payload = hand.palm.palm.serve(IMAGE.encode_command(PalmCommand(1, FromMotor.FLAGS, 0, 2)))
    assert payload is not None
    return int(IMAGE.decode_status(payload).misc[0])


def test_frames_that_waited_are_taken_as_they_arrived(orders: int) -> None:
    time = VirtualClock()
    hand = served(time, [1] * 100, orders)
    counts = hand.palm_slave.counts
    assert counts.commands >= 100
    assert (counts.refused, counts.watchdog_trips) == (0, 0)
    assert not flags(hand) & MotorFlag.NO_DEMAND


def test_a_pause_of_the_master_halts_motors_and_trips_the_watchdog_even_if_it_is_looked_at_late(orders: int) -> None:
    time = VirtualClock()
    hand = served(time, [1, 1, 21, 1, 1], orders)
    assert hand.palm_slave.counts.watchdog_trips == 1
    assert hand.palm_slave.al_status.state == AlState.SAFEOP
    assert flags(hand) & MotorFlag.NO_DEMAND
