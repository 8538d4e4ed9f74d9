"""The hand's two EtherCAT slaves on the far end of its cable, fed by the plant."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from drivers.biotac.biotac import load_biotacs
from drivers.emulators.ethercat_server import HandServer
from drivers.emulators.motor_can import MotorCanBuses
from drivers.emulators.shadow_chain import ChainSettings, EmulatedHand, emulated_hand
from drivers.emulators.stamped_port import StampedPort
from drivers.emulators.wired.plant_mirror import PlantMirror
from drivers.shadow.joint_calibration import JointCalibration
from drivers.shadow.motors import MotorMap
from drivers.shadow.real_time import request_real_time
from drivers.simulation.biotac_emulator import BiotacSection
from drivers.simulation.settings import BiotacSettings, JointSensorSettings
from tactile_lab.clock import Clock, VirtualClock
from tactile_lab.geometry.contacts import FINGERS


class HandStation:
    """A hand that serves frames."""

    def __init__(
        self, hand: EmulatedHand, time: VirtualClock, interface: str, can: MotorCanBuses, clock: Clock
    ) -> None:
        self._port = StampedPort(interface, clock)
        self._port.open()
        self._server = HandServer(hand, time, self._port, can, clock)

    def serve(self) -> None:
        """Serve until standard input ends. Raises DeviceError when the interface goes."""
        request_real_time()
        self._server.run()


def make(start: dict[str, Any], clock: Clock) -> HandStation:
    """The hand at the interface ``far_end``, with the joint and motor tables, and BioTacs, of the files named.

    Raises:
        DeviceError: the interface can not be used.
        ConfigurationError: a file that can not be used.
    """
    can, time = MotorCanBuses(), VirtualClock(clock.now_ns())
    mirror = PlantMirror(Path(start["mirror"]), time)
    hand = emulated_hand(
        time,
        JointCalibration.load(Path(start["joints"])),
        ChainSettings(palm=start["palm"], eeprom="mapped", serial=start["serial"], seed=start["seed"]),
        MotorMap.load(Path(start["motors"])),
        can,
        mirror,
        JointSensorSettings.model_validate(start["joint_sensors"]),
        _tactile(start, mirror),
    )
    return HandStation(hand, time, start["far_end"], can, clock)


def _tactile(start: dict[str, Any], mirror: PlantMirror) -> BiotacSection | None:
    if start["biotacs"] is None:
        return None
    settings, rng = BiotacSettings.model_validate(start["biotac"]), np.random.default_rng([start["seed"], len(FINGERS)])
    return BiotacSection.fitted(mirror, load_biotacs(Path(start["biotacs"])), settings, rng)
