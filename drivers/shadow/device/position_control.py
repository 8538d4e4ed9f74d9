"""Position control of the driven joints from the host, as Shadow's does it: PID with a dead band.

Everything here is by motor number; a motor without a target or a demand of its own gets none.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from drivers.core.clock import NANOSECONDS
from drivers.core.contacts import Array
from drivers.core.errors import DeviceError
from drivers.shadow.model.gains import GainTable
from drivers.shadow.model.motors import MotorMap
from drivers.shadow.protocol.palm_codec import MOTORS

SPEED_FILTER_s = 0.05
"""Time constant of the joint speeds that damping sees, as in Shadow's motor board files (``pos_filter``)."""

_LONGEST_STEP_s = 0.1
"""After a longer pause speeds and integrals begin anew."""


class PositionControl:
    """Targets of the driven joints, and the demands that bring them there.

    Args:
        motors: which motor pulls which joint.
        gains: how hard.
        range_rad: angles that targets are clamped to, by motor number, shape (20, 2), radians; the published limits of
            the joints unless given.

    Attributes:
        active: whether any target or demand is set.
        driven: motors with a target or a demand of their own that may be driven, shape (20,).
        drivable: the driven joints whose largest demand is not zero. Shadow's files have zero where a tendon is
            unsound, or the joint fixed.
    """

    def __init__(self, motors: MotorMap, gains: GainTable, range_rad: Array | None = None) -> None:
        self._motors = motors
        self._range_rad = motors.limits_rad if range_rad is None else range_rad
        table = [gains.of(name) for name in motors.names]
        self._gain = np.array([each.pwm_per_rad for each in table])
        self._deadband_rad = np.array([each.deadband_rad for each in table])
        self._minus_deadband_rad = -self._deadband_rad
        self._limit = np.array([each.max_pwm for each in table])
        self.drivable: tuple[str, ...] = tuple(name for name in motors.driven if gains.of(name).is_driven)
        self._damping = np.array([each.damping for each in table])
        self._integral_gain = np.array([each.integral for each in table])
        self._integral_max = np.array([each.integral_max for each in table])
        self._dynamic = bool(self._damping.any() or self._integral_gain.any())
        self._targets_rad, self._is_set = np.zeros(MOTORS), np.zeros(MOTORS, dtype=bool)
        self._direct, self._is_direct = np.zeros(MOTORS), np.zeros(MOTORS, dtype=bool)
        self._choose()
        self._seen: tuple[int, Array] | None = None
        self._speed_rad_s, self._integral = np.zeros(MOTORS), np.zeros(MOTORS)

    def set_targets(self, targets_rad: Mapping[str, float]) -> None:
        """Set targets by driven joint, clamped to the joint limits; joints not named keep theirs.

        Raises:
            DeviceError: a name is not a driven joint, or a target is not a finite number. Nothing is changed then.
        """
        numbers, wanted_rad = self._numbers_and_values(targets_rad, "joint target")
        lowest_rad, highest_rad = self._range_rad[numbers].T
        self._targets_rad[numbers] = np.minimum(np.maximum(wanted_rad, lowest_rad), highest_rad)
        self._is_set[numbers], self._is_direct[numbers] = True, False
        self._choose()

    def set_demands(self, counts: Mapping[str, float]) -> None:
        """Set demands by driven joint in place of their position control, towards larger angles, clamped when sent.

        Raises:
            DeviceError: a name is not a driven joint, or a demand is not a finite number. Nothing is changed then.
        """
        numbers, wanted = self._numbers_and_values(counts, "demand")
        self._direct[numbers] = wanted
        self._is_set[numbers], self._is_direct[numbers] = False, True
        self._choose()

    def clear(self) -> None:
        """Forget all targets and demands: nothing moves until new ones are set."""
        self._is_set.fill(False)
        self._is_direct.fill(False)
        self._seen = None
        self._choose()

    def _choose(self) -> None:
        """What every cycle needs of the choice between targets, demands and nothing."""
        self._idle = ~(self._is_set | self._is_direct)
        self._any_direct = bool(self._is_direct.any())
        self.driven = ~self._idle & (self._limit > 0.0)
        self.active = not self._idle.all()

    @property
    def targets_rad(self) -> dict[str, float]:
        """The targets that are set, by driven joint, radians."""
        targets_rad = self._targets_rad.tolist()
        return {self._motors.names[motor]: targets_rad[motor] for motor in np.flatnonzero(self._is_set)}

    def demand(self, joints_rad: Array, limit_share: Array | float, now_ns: int = 0) -> NDArray[np.int16]:
        """Demand of each motor.

        Args:
            joints_rad: measured joint angles, shape (24,), radians. J0 is controlled on the sum of its two sensors.
            limit_share: share 0 to 1 of each motor's largest demand that may be used, shape (20,) or one number.
            now_ns: of the measurement; damping and integral need it.

        Returns:
            Counts, shape (20,), by motor number.
        """
        angle_rad = self._motors.from_joints.dot(joints_rad)
        error_rad = self._targets_rad - angle_rad
        beyond_rad = error_rad - np.minimum(np.maximum(error_rad, self._minus_deadband_rad), self._deadband_rad)
        wanted = self._gain * beyond_rad
        if self._dynamic:
            wanted = wanted + self._over_time(angle_rad, beyond_rad, now_ns)
        if self._any_direct:
            wanted = np.where(self._is_direct, self._direct, wanted)
        limit = self._limit * limit_share
        counts = np.rint(np.minimum(np.maximum(wanted, -limit), limit)) * self._motors.sign
        counts[self._idle] = 0.0
        return np.asarray(counts, dtype=np.int16)

    def _over_time(self, angle_rad: Array, beyond_rad: Array, now_ns: int) -> Array:
        """What damping and integral add, counts, shape (20,)."""
        before, self._seen = self._seen, (now_ns, angle_rad)
        elapsed_s = (now_ns - before[0]) / NANOSECONDS if before else np.inf
        if before is None or elapsed_s > _LONGEST_STEP_s:
            self._speed_rad_s, self._integral = np.zeros(MOTORS), np.zeros(MOTORS)
        elif elapsed_s > 0.0:
            share = 1.0 - np.exp(-elapsed_s / SPEED_FILTER_s)
            self._speed_rad_s = self._speed_rad_s + share * ((angle_rad - before[1]) / elapsed_s - self._speed_rad_s)
            grown = self._integral + self._integral_gain * beyond_rad * elapsed_s
            self._integral = np.minimum(np.maximum(grown, -self._integral_max), self._integral_max)
        return self._integral - self._damping * self._speed_rad_s

    def _numbers_and_values(self, by_joint: Mapping[str, float], what: str) -> tuple[list[int], Array]:
        unknown = [name for name in by_joint if name not in self._motors.numbers]
        if unknown:
            raise DeviceError(f"no motor drives {', '.join(unknown)}", where="hand", hint="J1 and J2 are driven as J0")
        values = np.array(list(by_joint.values()), dtype=float)
        if not np.isfinite(values).all():
            raise DeviceError(f"a {what} is not a finite number", where="hand", hint="Check the planned path")
        return [self._motors.numbers[name] for name in by_joint], values
