"""A hand in free air, without physics: joints turn in proportion to their motors' duty cycle, up to their limits."""

from __future__ import annotations

import numpy as np
from gtsam import Pose3

from drivers.core.clock import NANOSECONDS, Clock
from drivers.core.contacts import Array
from drivers.shadow.model.kinematics import JOINT_INDEX, JOINTS, JOINT_LIMITS_rad, palm_T_distal
from drivers.shadow.model.motors import DRIVEN_JOINTS, angles_of_driven
from drivers.simulation.devices.geared_motors import motor_class
from drivers.simulation.devices.motor_bank import DEMAND_TIMEOUT_ns
from drivers.simulation.hand_plant import TrueContact

FULL_SPEED_rad_s = 4.0
"""Speed of every joint at full duty cycle (assumed)."""

_LOOK_ns = 100_000  # readings closer together, within one cycle of the palm, see the same posture
_LOWEST_rad, _HIGHEST_rad = (np.ascontiguousarray(limits_rad) for limits_rad in JOINT_LIMITS_rad.T)


class FreeHand:
    """Joints that follow their motors on a clock's time; at a limit the motor pushes with its stall torque.

    The joints are updated only when they are read, which may be after the motors have halted for lack of demands. So
    the halt is computed here as well.

    Args:
        clock: the clock that the joints follow.
    """

    def __init__(self, clock: Clock) -> None:
        self._clock = clock
        self._spread = _shares_of_motors()
        self._of_motors = np.ascontiguousarray(self._spread.T)
        self._low_rad, self._high_rad = self._of_motors @ _LOWEST_rad, self._of_motors @ _HIGHEST_rad
        self._stall_Nm = np.array([motor_class(joint).stall_Nm for joint in DRIVEN_JOINTS])
        self._angles_rad: Array = (_LOWEST_rad + _HIGHEST_rad) / 2
        self._moved_ns = self._driven_ns = clock.now_ns()
        self._resting = True
        self.drive(np.zeros(len(DRIVEN_JOINTS)))

    @property
    def stamp_ns(self) -> int:
        """Present time."""
        return self._clock.now_ns()

    @property
    def joints_rad(self) -> Array:
        """Joint angles, shape (24,), radians."""
        self._look()
        return self._angles_rad.copy()

    @property
    def motor_torque_Nm(self) -> Array:
        """Torque of each driven joint's motor, shape (20,): zero unless it pushes against a limit."""
        self._look()
        if self._resting:
            return np.zeros(len(DRIVEN_JOINTS))
        angle_rad = self._of_motors @ self._angles_rad
        pushing = (angle_rad <= self._low_rad) & self._falling | (angle_rad >= self._high_rad) & self._rising
        return np.asarray(self._push_Nm * pushing)

    def contacts(self) -> tuple[TrueContact, ...]:
        """None: the fingertips touch nothing."""
        return ()

    def world_T_distal(self, finger: str) -> Pose3:
        """Pose of a finger's distal frame; the palm's frame is the world."""
        return palm_T_distal(self.joints_rad)[finger]

    def drive(self, duty: Array) -> None:
        """Set the duty cycles, -1 to 1, shape (20,), order of ``DRIVEN_JOINTS``."""
        self._move(self._clock.now_ns())
        self._driven_ns, self._resting = self._moved_ns, not duty.any()
        self._falling, self._rising = duty < 0, duty > 0
        self._speed_rad_s, self._push_Nm = self._spread @ duty * FULL_SPEED_rad_s, duty * self._stall_Nm

    def _look(self) -> None:
        now_ns = self._clock.now_ns()
        if now_ns - self._moved_ns >= _LOOK_ns:
            self._move(now_ns)

    def _move(self, now_ns: int) -> None:
        turning_ns = min(now_ns, self._driven_ns + DEMAND_TIMEOUT_ns) - self._moved_ns
        if turning_ns > 0 and not self._resting:
            turned_rad = self._speed_rad_s * (turning_ns / NANOSECONDS)
            self._angles_rad = np.minimum(np.maximum(self._angles_rad + turned_rad, _LOWEST_rad), _HIGHEST_rad)
        self._moved_ns = now_ns


def _shares_of_motors() -> Array:
    """Share of each driven joint's motion in the motion of every joint, shape (24, 20); coupled pairs share evenly."""
    shares = np.zeros((len(JOINTS), len(DRIVEN_JOINTS)))
    for column, name in enumerate(DRIVEN_JOINTS):
        joints = angles_of_driven(name)
        for joint in joints:
            shares[JOINT_INDEX[joint], column] = 1.0 / len(joints)
    return shares
