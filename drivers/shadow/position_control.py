"""Position control of the driven joints by duty cycle, as Shadow's host does it: P with a dead band.

Everything here is by motor number; a motor without a target gets no demand.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from drivers.shadow.motors import GainTable, MotorMap
from drivers.shadow.palm_codec import MOTORS
from tactile_lab.errors import DeviceError
from tactile_lab.geometry.contacts import Array


class PositionControl:
    """Targets of the driven joints, and the demands that bring them there.

    Args:
        motors: which motor pulls which joint.
        gains: how hard.
    """

    def __init__(self, motors: MotorMap, gains: GainTable) -> None:
        self._motors = motors
        table = [gains.of(name) for name in motors.names]
        self._gain = np.array([each.pwm_per_rad for each in table])
        self._deadband_rad = np.array([each.deadband_rad for each in table])
        self._limit = np.array([each.max_pwm for each in table])
        self._targets_rad, self._is_set = np.zeros(MOTORS), np.zeros(MOTORS, dtype=bool)

    def set_targets(self, targets_rad: Mapping[str, float]) -> None:
        """Set targets by driven joint, clamped to the joint limits; joints not named keep theirs.

        Raises:
            DeviceError: a name is not a driven joint, or a target is not a finite number. Nothing is changed then.
        """
        unknown = [name for name in targets_rad if name not in self._motors.numbers]
        if unknown:
            raise DeviceError(f"no motor drives {', '.join(unknown)}", where="hand", hint="J1 and J2 are driven as J0")
        numbers = [self._motors.numbers[name] for name in targets_rad]
        wanted_rad = np.array(list(targets_rad.values()), dtype=float)
        if not np.isfinite(wanted_rad).all():
            raise DeviceError("a joint target is not a finite number", where="hand", hint="Check the planned path")
        lowest_rad, highest_rad = self._motors.limits_rad[numbers].T
        self._targets_rad[numbers] = np.minimum(np.maximum(wanted_rad, lowest_rad), highest_rad)
        self._is_set[numbers] = True

    def clear(self) -> None:
        """Forget all targets: no demand until new ones are set."""
        self._is_set.fill(False)

    @property
    def active(self) -> bool:
        """Whether any target is set."""
        return bool(self._is_set.any())

    @property
    def targets_rad(self) -> dict[str, float]:
        """The targets that are set, by driven joint, radians."""
        targets_rad = self._targets_rad.tolist()
        return {self._motors.names[motor]: targets_rad[motor] for motor in np.flatnonzero(self._is_set)}

    def demand(self, joints_rad: Array, limit_share: Array | float) -> NDArray[np.int16]:
        """Duty cycle of each motor.

        Args:
            joints_rad: measured joint angles, shape (24,), radians. J0 is controlled on the sum of its two sensors.
            limit_share: share 0 to 1 of each motor's largest duty cycle that may be used, shape (20,) or one number.

        Returns:
            Counts of 1023, shape (20,), by motor number.
        """
        error_rad = self._targets_rad - self._motors.from_joints @ joints_rad
        beyond_rad = error_rad - np.minimum(np.maximum(error_rad, -self._deadband_rad), self._deadband_rad)
        limit = self._limit * limit_share
        pwm = np.rint(np.minimum(np.maximum(self._gain * beyond_rad, -limit), limit)) * self._motors.sign
        pwm[~self._is_set] = 0.0
        return np.asarray(pwm, dtype=np.int16)
