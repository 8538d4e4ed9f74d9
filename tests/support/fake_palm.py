"""A fake palm that moves its joints by the demands that it receives, and a hand connected to it."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import numpy as np

from drivers.core.clock import VirtualClock
from drivers.core.transports import Datagram, MemoryTransport
from drivers.shadow.device.hand import ShadowHand
from drivers.shadow.device.hand_samples import HandSample
from drivers.shadow.device.hand_settings import HandSettings
from drivers.shadow.model.joint_calibration import JointCalibration
from drivers.shadow.model.kinematics import JOINT_INDEX, joint_vector
from drivers.shadow.model.motors import MotorMap
from drivers.shadow.protocol import palm_codec
from drivers.shadow.protocol.motor_data import FromMotor
from drivers.shadow.protocol.palm_codec import PalmCommand, PalmStatus
from tactile_lab import rigs

SIMULATED = Path(rigs.__file__).parent / "calibrations" / "simulated-hand"
CALIBRATION = JointCalibration.load(SIMULATED / "joints.yaml")
MOTORS = MotorMap.load(SIMULATED / "motors.yaml")
CYCLE_ns = 10_000_000
RADIANS_PER_COUNT = 2e-5
"""What the fake's joints turn in a cycle for each count of duty cycle."""
QUICK = HandSettings(soft_start_s=0.0)


class FakePalm:
    """The least that behaves like a palm: answers the previous command, moves joints in proportion to the duty."""

    def __init__(self, clock: VirtualClock, motors: MotorMap = MOTORS) -> None:
        self.clock, self.motors = clock, motors
        self.joints_rad = joint_vector({"FFJ3": 0.4, "FFJ1": 0.2, "FFJ2": 0.3, "THJ4": 0.6, "LFJ5": 0.2})
        self.commands: list[PalmCommand] = []
        self.flags, self.temperature_C = np.zeros(20, np.uint16), np.full(20, 30)
        self.silent: set[int] = set()
        self.delay_ns = 0
        self.mute = self.unwritten = self.frozen = False
        self.garbage = b""
        self._waiting: list[Datagram] = []
        self._payload = b""

    @property
    def pwm(self) -> list[int]:
        return list(self.commands[-1].motor_data)

    def write(self, payload: bytes) -> None:
        self.clock.sleep_until_ns(self.clock.now_ns() + self.delay_ns)
        previous = self.commands[-1] if self.commands else PalmCommand()
        self.commands.append(palm_codec.decode_command(payload))
        duty = np.array(self.commands[-1].motor_data, int) * self.motors.sign
        for motor, name in enumerate(self.motors.names):
            moved = [f"{name[:2]}J1", f"{name[:2]}J2"] if name.endswith("J0") else [name]
            for joint in moved:
                self.joints_rad[JOINT_INDEX[joint]] += duty[motor] * RADIANS_PER_COUNT / len(moved)
        if not self.frozen or not self._payload:
            self._payload = self.garbage or palm_codec.encode_status(self._status(previous))
        if not self.mute:
            self._waiting.append(Datagram(self._payload, self.clock.now_ns()))

    def read(self) -> list[Datagram]:
        waiting, self._waiting = self._waiting, []
        return waiting

    def _status(self, command: PalmCommand) -> PalmStatus:
        asked = np.arange(command.which_motors, 20, 2)
        answers = {
            FromMotor.FLAGS: self.flags,
            FromMotor.TEMPERATURE: self.temperature_C * 256,
            FromMotor.PWM: np.array(command.motor_data, int) & 0xFFFF,
        }
        misc = answers.get(FromMotor(command.from_motor_data_type), np.zeros(20, int))[asked]
        return PalmStatus(
            edc_command=0 if self.unwritten else min(command.edc_command, 1),
            sensors=np.clip(np.rint(CALIBRATION.raw_counts(self.joints_rad)), 0, 4095).astype(np.uint16),
            motor_data_type=command.from_motor_data_type,
            which_motors=command.which_motors,
            arrived=sum(1 << int(motor) for motor in asked if int(motor) not in self.silent),
            had_errors=0,
            torque=asked.astype(np.int16),
            misc=misc.astype(np.uint16),
            tactile_data_type=command.tactile_data_type,
            tactile_valid=31,
            tactile=np.arange(80, dtype=np.uint8).reshape(5, 16),
            idle_time_us=400,
        )


class Rig:
    """A hand on a fake palm."""

    def __init__(self, hand_settings: HandSettings = QUICK, motors: MotorMap = MOTORS) -> None:
        self.clock = VirtualClock()
        self.palm = FakePalm(self.clock, motors)
        self.hand = ShadowHand(MemoryTransport("hand", self.palm), self.clock, CALIBRATION, hand_settings, motors)

    def run(self, cycles: int) -> HandSample:
        for _ in range(cycles):
            sample = self.hand.exchange()
            self.clock.sleep_until_ns(self.clock.now_ns() + CYCLE_ns)
        return sample


def statuses(rig: Rig, cycles: int) -> Iterator[Datagram]:
    for cycle in range(cycles):
        rig.palm.joints_rad[JOINT_INDEX["FFJ3"]] = 0.4 + 0.01 * cycle
        rig.palm.write(palm_codec.encode_command(PalmCommand(1, 3 + cycle // 2 % 2, cycle % 2)))
        yield from rig.palm.read()
