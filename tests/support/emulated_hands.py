"""Hands by their files on the emulated ring, in this process and in virtual time."""

from __future__ import annotations

from drivers.core.clock import VirtualClock
from drivers.emulators.ethercat.shadow_chain import ChainSettings, emulated_hand
from drivers.shadow.device.first_move import MoveFinding, check_motor_map
from drivers.shadow.device.hand import ShadowHand
from drivers.shadow.device.hand_samples import HandSample
from drivers.shadow.device.hand_settings import HandSettings
from drivers.shadow.device.hand_setup import HandSetup
from drivers.shadow.ethercat.hand_transport import EthercatSettings, EthercatTransport
from tests.support.hand_folders import HandFolder
from tests.support.memory_port import MemoryPort


def setup_of(folder: HandFolder, serial: int | None = None) -> HandSetup:
    """A hand by the files of its folder."""
    ethercat, hand = EthercatSettings(interface="memory", serial=serial), HandSettings(cycle_s=0.002, palm=folder.palm)
    files = {"joints": folder.joints, "motors": folder.motors, "gains": folder.gains}
    return HandSetup(ethercat=ethercat, hand=hand, **files)


class EmulatedBench:
    """A hand by its files, and the emulated one that the files describe.

    Args:
        setup: the hand by its files.
        serial: of the emulated one.

    Raises:
        ConfigurationError: a file cannot be used.
    """

    def __init__(self, setup: HandSetup, serial: int = 634) -> None:
        self.clock, self.setup = VirtualClock(), setup
        setup.check_files()
        chain = ChainSettings(palm=setup.hand.palm, serial=serial)
        self.motors = setup.motor_map()
        self.emulated = emulated_hand(self.clock, setup.calibration(), chain, self.motors)
        port = MemoryPort(self.emulated.ring)
        transport = EthercatTransport("hand", setup.wiring(), self.clock, port)
        self.hand: ShadowHand = setup.device(transport, self.clock)

    def cycle(self) -> HandSample:
        """One cycle of 2 ms."""
        self.clock.sleep_until_ns(self.clock.now_ns() + 2_000_000)
        return self.hand.exchange()

    def moves(self) -> list[MoveFinding]:
        """What every motor moves.

        Raises:
            DeviceError: the hand does not connect, or stops itself.
        """
        self.hand.connect()
        findings = check_motor_map(self.hand, self.motors, self.cycle, self.clock)
        assert self.hand.health() == ()
        self.hand.close()
        return findings
