"""The hand's two emulated EtherCAT slaves at the far end of its cable, driven by the plant."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from drivers.core.clock import Clock, VirtualClock
from drivers.core.contacts import FINGERS
from drivers.emulators.ethercat.motor_can import MotorCanBuses
from drivers.emulators.ethercat.server import HandServer
from drivers.emulators.ethercat.shadow_chain import ChainSettings, EmulatedHand, emulated_hand
from drivers.emulators.ethercat.stamped_port import StampedPort
from drivers.emulators.laboratory.plant_mirror import PlantMirror
from drivers.fingertips.kind import PalmKind
from drivers.fingertips.kinds import FINGERTIPS
from drivers.shadow.device.real_time import request_real_time
from drivers.shadow.model.hand_form import HandForm
from drivers.shadow.model.joint_calibration import JointCalibration
from drivers.shadow.model.motors import MotorMap
from drivers.simulation.fingertips import tactile_section
from drivers.simulation.sections import TactileSection
from drivers.simulation.settings import SimulationSettings


class HandHost:
    """Serves a hand's frames."""

    def __init__(
        self, hand: EmulatedHand, time: VirtualClock, interface: str, can: MotorCanBuses, clock: Clock
    ) -> None:
        self._port = StampedPort(interface, clock)
        self._port.open()
        self._server = HandServer(hand, time, self._port, can, clock)

    def serve(self) -> None:
        """Serve until standard input ends. Raises DeviceError if the interface disappears."""
        request_real_time()
        self._server.run()


def make(start: dict[str, Any], clock: Clock) -> HandHost:
    """The hand at the interface ``far_end``, with joint tables, motor tables and fingertips from the given files.

    Raises:
        DeviceError: the interface cannot be used.
        ConfigurationError: a file cannot be used.
    """
    can, time = MotorCanBuses(), VirtualClock(clock.now_ns())
    mirror, motors = PlantMirror(Path(start["mirror"]), time), MotorMap.load(Path(start["motors"]))
    hand = emulated_hand(
        time,
        JointCalibration.load(Path(start["joints"]), HandForm(driven=motors.driven).joints),
        ChainSettings(palm=start["palm"], eeprom="mapped", serial=start["serial"], seed=start["seed"]),
        motors,
        can,
        mirror,
        SimulationSettings.model_validate(start["simulation"]).joint_sensors,
        _tactile(start, mirror),
    )
    return HandHost(hand, time, start["far_end"], can, clock)


def _tactile(start: dict[str, Any], mirror: PlantMirror) -> TactileSection | None:
    settings = SimulationSettings.model_validate(start["simulation"])
    if not isinstance(kind := FINGERTIPS[settings.fingertips], PalmKind):
        return None
    rng = np.random.default_rng([start["seed"], len(FINGERS)])
    known = kind.load({"fingertips": Path(start["tips"])})
    return tactile_section(settings.fingertips, mirror, known, settings, rng)
