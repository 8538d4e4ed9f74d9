"""The hand's driver and an emulated ring on one wire in memory."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from drivers.core.clock import VirtualClock
from drivers.emulators.ethercat.shadow_chain import ChainSettings, EmulatedHand, emulated_hand
from drivers.ethercat.master import EtherCatMaster
from drivers.shadow.ethercat.hand_transport import EthercatSettings, EthercatTransport
from drivers.shadow.model.joint_calibration import JointCalibration
from drivers.shadow.protocol.palm_codec import PalmCommand, PalmStatus
from drivers.shadow.protocol.palm_images import PALMS
from tactile_lab import rigs
from tests.support.memory_port import MemoryPort

FILES = Path(rigs.__file__).parent / "calibrations" / "simulated-hand"
CALIBRATION = JointCalibration.load(FILES / "joints.yaml")
MS = 1_000_000


class Wire:
    """A hand on a ring in memory, and a transport to it."""

    def __init__(self, chain: ChainSettings | None = None, **settings: Any) -> None:
        self.clock = VirtualClock()
        self.hand: EmulatedHand = emulated_hand(self.clock, CALIBRATION, chain)
        self.port = MemoryPort(self.hand.ring)
        self.transport = EthercatTransport(
            "hand", EthercatSettings(interface="memory", **settings), self.clock, self.port
        )
        self.image = PALMS[(chain or ChainSettings()).palm]
        self.parity = 0

    def open(self) -> Wire:
        self.transport.open()
        self.cycles(3)
        return self

    def cycle(self, command: PalmCommand | None = None) -> PalmStatus | None:
        self.clock.sleep_until_ns(self.clock.now_ns() + MS)
        self.parity ^= 1
        command = command or PalmCommand(1, 3, self.parity, 2)
        self.transport.send(self.image.encode_command(command))
        datagrams = self.transport.receive()
        return self.image.decode_status(datagrams[0].payload) if datagrams else None

    def cycles(self, count: int) -> list[PalmStatus | None]:
        return [self.cycle() for _ in range(count)]

    @property
    def states(self) -> list[int]:
        return [slave.al_status.state for slave in self.hand.ring.slaves]

    def master(self) -> EtherCatMaster:
        master = EtherCatMaster(self.port, self.clock)
        master.open()
        return master
