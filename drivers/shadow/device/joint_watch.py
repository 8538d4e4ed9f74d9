"""Is what the joint sensors say believable? Looked at in every cycle, before a demand goes out that rests on it.

A sensor whose wire is broken reads 0 or 4095, or anything; one whose converter hangs does not change. Control would
drive the joint at its full demand on such a word.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from drivers.core.clock import NANOSECONDS
from drivers.core.configuration import StrictModel
from drivers.core.contacts import Array
from drivers.shadow.device.motor_watch import Fault
from drivers.shadow.model.joint_calibration import JOINT_OF_SENSOR, SENSOR_HAS_JOINT, JointCalibration, joint_counts
from drivers.shadow.model.kinematics import JOINT_INDEX, JOINTS
from drivers.shadow.model.motors import MotorMap, angles_of_driven

FULL_SCALE = 4095
"""Largest count of the palm's converters, 12 bits."""

_RAIL = 3  # counts from either end of the scale, where no magnet of a sound sensor gets
_LONGEST_STEP_s = 0.1  # after a longer pause a joint may be anywhere


class SensorLimits(StrictModel):
    """What a joint sensor may say.

    Attributes:
        margin: how far beyond its calibrated counts a joint may read, as a share of their span.
        rate_rad_s: quicker than this no joint turns, even when it is let go.
        jump_rad: a step of this size between two readings is noise.
        frozen_s: a driven joint with an identical reading for this time is blocked, or its sensor is frozen. At its
            largest demand a finger turns by 10 to 15 degrees in the default time.
        frozen_share: driven with this share of its largest demand at least.
        idle_torque_counts: with a smaller strain-gauge difference the motor pushes against nothing, so that a driven
            joint has to move.
    """

    margin: float = Field(default=0.3, ge=0.0)
    rate_rad_s: float = Field(default=30.0, gt=0.0)
    jump_rad: float = Field(default=0.1, ge=0.0)
    frozen_s: float = Field(default=0.1, gt=0.0)
    frozen_share: float = Field(default=0.3, gt=0.0, le=1.0)
    idle_torque_counts: float = Field(default=100.0, ge=0.0)


class JointWatch:
    """Checks the readings of all joints, and reports those that are driven.

    Args:
        calibration: of the hand's joints; says which counts each may have.
        motors: which motor pulls which joint.
        largest: largest demand of each motor, shape (20,), counts.
        limits: see :class:`SensorLimits`.
        where: name of the hand in messages.
    """

    def __init__(
        self, calibration: JointCalibration, motors: MotorMap, largest: Array, limits: SensorLimits, where: str
    ) -> None:
        self._motors, self._limits, self._where = motors, limits, where
        self._calibrated = calibration.range_counts
        span = limits.margin * np.diff(self._calibrated, axis=1)[:, 0]
        here = calibration.turns  # nothing rests on what a fixed joint reads
        self._low = np.where(here, np.maximum(self._calibrated[:, 0] - span, _RAIL), -np.inf)
        self._high = np.where(here, np.minimum(self._calibrated[:, 1] + span, FULL_SCALE - _RAIL), np.inf)
        self._sensor = np.flatnonzero(SENSOR_HAS_JOINT)[here[JOINT_OF_SENSOR]]
        self._joint_of_sensor = JOINT_OF_SENSOR[here[JOINT_OF_SENSOR]]
        self._pushing_from = np.maximum(limits.frozen_share * largest, 1.0)
        self._joints_of_motor = np.array([_first_and_last(name, calibration) for name in motors.names])
        self.restart()

    def restart(self) -> None:
        """Forget everything seen so far."""
        self._stamp_ns: int | None = None
        self._broken: dict[int, int] = {}
        self._counts, self._angles_rad = np.zeros(len(JOINTS)), np.zeros(len(JOINTS))
        self._jumped, self._outside = (np.zeros(len(JOINTS), dtype=bool) for _ in range(2))
        self._same_since_ns = np.zeros(len(JOINTS), dtype=np.int64)
        self._pushing_since_ns: NDArray[np.int64] | None = None

    def see(self, sensors: NDArray[np.uint16], angles_rad: Array, stamp_ns: int) -> None:
        """Take a reading of all sensors, shape (37,), and the angles that it means, shape (24,)."""
        counts = joint_counts(sensors)
        elapsed_s = np.inf if self._stamp_ns is None else (stamp_ns - self._stamp_ns) / NANOSECONDS
        self._outside, self._broken = (counts < self._low) | (counts > self._high), {}
        own = sensors[self._sensor]
        if (rail := (own < _RAIL) | (own > FULL_SCALE - _RAIL)).any():  # one of two is hidden in their average
            self._broken = dict(zip(self._joint_of_sensor[rail].tolist(), own[rail].tolist(), strict=True))
            self._outside[self._joint_of_sensor[rail]] = True
        if elapsed_s > _LONGEST_STEP_s:
            self._jumped.fill(False)
            self._same_since_ns.fill(stamp_ns)
        else:
            largest_rad = self._limits.rate_rad_s * elapsed_s + self._limits.jump_rad
            self._jumped = np.abs(angles_rad - self._angles_rad) > largest_rad
            self._same_since_ns[counts != self._counts] = stamp_ns
        self._counts, self._angles_rad, self._stamp_ns = counts, angles_rad, stamp_ns

    def fault(self, driven: NDArray[np.bool_]) -> Fault | None:
        """What the newest reading says of the joints of driven motors, shape (20,), that cannot be."""
        wrong = self._outside | self._jumped
        if not wrong.any():
            return None
        motors = np.flatnonzero(driven & wrong[self._joints_of_motor].any(axis=1)).tolist()
        if not motors:
            return None
        joint = next(joint for joint in self._joints_of_motor[motors[0]].tolist() if wrong[joint])
        return self._fault(motors[0], joint, self._out_of_range(joint) if self._outside[joint] else self._jump(joint))

    def frozen(self, words: NDArray[np.int16], torque: Array, now_ns: int) -> Fault | None:
        """A joint among those driven by these demands, shape (20,), that ought to move and reads the very same.

        Args:
            words: demands by motor number.
            torque: strain-gauge differences the motors report, shape (20,), NaN where unknown.
            now_ns: present time.
        """
        loose = ~(np.abs(torque) > self._limits.idle_torque_counts)
        pushing = (np.abs(words) >= self._pushing_from) & loose
        if self._pushing_since_ns is None:
            self._pushing_since_ns = np.full(len(words), now_ns, dtype=np.int64)
        self._pushing_since_ns[~pushing] = now_ns
        if not pushing.any():
            return None
        since_ns = np.maximum(self._same_since_ns[self._joints_of_motor].min(axis=1), self._pushing_since_ns)
        motor = int(since_ns.argmin())
        if now_ns - int(since_ns[motor]) <= self._limits.frozen_s * NANOSECONDS:
            return None
        joint = min(self._joints_of_motor[motor].tolist(), key=lambda each: int(self._same_since_ns[each]))
        what = f"its sensor stands at {self._counts[joint]:.0f} counts for {self._limits.frozen_s:g} s while driven"
        return self._fault(motor, joint, (what, "Look whether the joint moves freely; then its sensor and its tendon"))

    def problems(self) -> list[str]:
        """What cannot be in the newest reading, of joints driven or not, in words."""
        outside = np.flatnonzero(self._outside).tolist()
        return [f"{self._where}, {JOINTS[joint]}: {self._out_of_range(joint)[0]}" for joint in outside]

    def _out_of_range(self, joint: int) -> tuple[str, str]:
        low, high = self._calibrated[joint]
        count = self._broken.get(joint, self._counts[joint])
        what = f"its sensor reads {count:.0f} counts, calibrated are {low:.0f} to {high:.0f}"
        if joint in self._broken:
            return what, "Its wire or connector is broken: look at it, or have the hand serviced"
        return what, "Is this the hand's own calibration file? If so, calibrate the joint again, or check its sensor"

    def _jump(self, joint: int) -> tuple[str, str]:
        what = f"its sensor jumps by more than a joint can turn, to {self._counts[joint]:.0f} counts"
        return what, "Its wire or connector has a loose contact: look at it, or have the hand serviced"

    def _fault(self, motor: int, joint: int, words: tuple[str, str]) -> Fault:
        what, hint = words
        return Fault(f"stopped: {what}", f"{self._where}, {JOINTS[joint]} (motor {motor})", hint)


def _first_and_last(driven: str, calibration: JointCalibration) -> tuple[int, int]:
    """The joints of a motor that can be seen turning; any for a place without a motor, which has no demand."""
    joints = [JOINT_INDEX[name] for name in (angles_of_driven(driven) if driven else JOINTS[:1])]
    seen = [joint for joint in joints if calibration.turns[joint]] or joints
    return seen[0], seen[-1]
