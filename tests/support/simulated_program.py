"""The host's side of the simulated rig's transports, for tests."""

from __future__ import annotations

from typing import Any

import numpy as np

from drivers.ati.protocols import rdt_codec
from drivers.core.transports import Datagram, Transport
from drivers.positioner.codec import PositionerCommand, decode_status, encode_command
from drivers.shadow.model.motors import MotorMap
from drivers.shadow.protocol import palm_codec
from drivers.shadow.protocol.motor_data import ToMotor
from drivers.shadow.protocol.palm_codec import EdcCommand, PalmCommand, PalmStatus
from drivers.shadow.protocol.palm_codec import decode_status as decode_palm
from drivers.simulation.settings import ForceSensorSettings, JointSensorSettings, SimulationSettings
from drivers.simulation.world import SimulatedWorld

MS = 1_000_000
CYCLE_ns = 10 * MS
PERFECT_JOINTS = JointSensorSettings(bias_rad=0, wrist_bias_rad=0, noise_rad=0)
PERFECT_FORCES = ForceSensorSettings(offset_N=0, offset_Nm=0, drift_N=0, drift_Nm=0, noise_lsb=0)
PERFECT = SimulationSettings(joint_sensors=PERFECT_JOINTS, force_sensors=PERFECT_FORCES)
BIOTAC = SimulationSettings(fingertips="biotac")
MOTORS = MotorMap.load()


class Program:
    """A minimal host for the simulated rig's transports."""

    def __init__(self, settings: SimulationSettings = PERFECT, seed: int = 0) -> None:
        self.world = SimulatedWorld(settings, seed)
        self.transports: dict[str, Transport] = self.world.transports()
        for transport in self.transports.values():
            transport.open()
        self.sequence = 0
        self.plant = self.world._plant  # not visible to a real program

    def wait(self, duration_ns: int = CYCLE_ns) -> None:
        self.world.clock.sleep_until_ns(self.world.clock.now_ns() + duration_ns)

    def ask(self, **changes: Any) -> Datagram:
        """Send one command to the palm; returns what came back with it."""
        command = PalmCommand(**{"edc_command": EdcCommand.SENSOR_DATA, **changes})
        self.transports["hand"].send(palm_codec.encode_command(command))
        (datagram,) = self.transports["hand"].receive()
        return datagram

    def status(self, **changes: Any) -> PalmStatus:
        """The status that answers a command; it comes back with the next command."""
        self.ask(**changes)
        return decode_palm(self.ask(**changes).payload)

    def drive(self, duty: dict[str, int], cycles: int) -> PalmStatus:
        """Apply PWM demands for a number of cycles; all others are zero."""
        words = np.zeros(20, int)
        for joint, value in duty.items():
            words[MOTORS.numbers[joint]] = value
        for _ in range(cycles):
            answer = self.ask(to_motor_data_type=ToMotor.DEMAND_PWM, motor_data=words)
            self.wait()
        return decode_palm(answer.payload)

    def move_base(self, q: np.ndarray, cycles: int = 60) -> np.ndarray:
        for _ in range(cycles):
            self.sequence += 1
            self.transports["base"].send(encode_command(PositionerCommand(self.sequence, q)))
            self.wait()
        return decode_status(self.transports["base"].receive()[-1].payload).q

    def joints_rad(self) -> np.ndarray:
        return self.world.calibration.joints.angles_rad(self.status().sensors)

    def start_forces(self, finger: str = "FF") -> Transport:
        transport = self.transports[f"ft/{finger}"]
        transport.send(rdt_codec.encode_request(rdt_codec.Command.START))
        return transport


def records(datagrams: list[Datagram]) -> np.ndarray:
    return np.frombuffer(b"".join(datagram.payload for datagram in datagrams), rdt_codec.RECORD)
