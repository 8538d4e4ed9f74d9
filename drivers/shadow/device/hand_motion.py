"""The demands to the hand's motors in each cycle: none, a nudge of one, or control within limits that rise gently."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from drivers.core.clock import NANOSECONDS
from drivers.core.contacts import Array
from drivers.core.errors import DeviceError
from drivers.shadow.device.position_control import PositionControl
from drivers.shadow.model.gains import GainTable
from drivers.shadow.model.motors import MotorMap
from drivers.shadow.protocol.palm_codec import MOTORS

LARGEST_NUDGE = 250
"""Largest duty cycle of a nudge, counts: a quarter of full duty cannot hurt a joint in a moment."""

NO_DEMAND = np.zeros(MOTORS, dtype=np.int16)
NO_DEMAND.flags.writeable = False  # shared by all who have none


class HandMotion:
    """Targets, demands and nudges of a hand.

    Args:
        motors: which motor pulls which joint.
        gains: of the position control.
        soft_start_s: after a pause the demands' limits rise from zero in this time.
        range_rad: see :class:`PositionControl`.
        where: the hand's name, for messages.
    """

    def __init__(
        self, motors: MotorMap, gains: GainTable, soft_start_s: float, where: str, range_rad: Array | None = None
    ) -> None:
        self._motors, self._where = motors, where
        self._control = PositionControl(motors, gains, range_rad)
        self._rise_ns = soft_start_s * NANOSECONDS
        self._nudge: NDArray[np.int16] | None = None
        self._since_ns: int | None = None

    @property
    def active(self) -> bool:
        """Whether anything is to be driven."""
        return self._nudge is not None or self._control.active

    @property
    def is_nudge(self) -> bool:
        """Whether a single motor is nudged."""
        return self._nudge is not None

    @property
    def driven(self) -> NDArray[np.bool_]:
        """Motors that are to be driven, shape (20,)."""
        return self._control.driven if self._nudge is None else self._nudge != 0

    @property
    def drivable(self) -> tuple[str, ...]:
        """Driven joints whose largest demand is not zero."""
        return self._control.drivable

    @property
    def targets_rad(self) -> dict[str, float]:
        """The targets that are set, by driven joint, radians."""
        return self._control.targets_rad

    def set_targets(self, targets_rad: Mapping[str, float]) -> None:
        """Set targets; see :meth:`PositionControl.set_targets`. Ends a nudge."""
        self._control.set_targets(targets_rad)
        self._nudge = None

    def set_demands(self, counts: Mapping[str, float]) -> None:
        """Set demands; see :meth:`PositionControl.set_demands`. Ends a nudge."""
        self._control.set_demands(counts)
        self._nudge = None

    def nudge(self, joint: str, pwm: float) -> None:
        """Drive one motor alone with a small duty cycle, in place of everything else; 0 ends it and nothing moves.

        Raises:
            DeviceError: not a driven joint, one that is not to be driven, or too large.
        """
        if joint not in self._motors.numbers or not abs(pwm) <= LARGEST_NUDGE:
            what = f"cannot nudge {joint} with {pwm} counts"
            raise DeviceError(what, where=self._where, hint=f"Use at most {LARGEST_NUDGE}, and a driven joint")
        if joint not in self.drivable:
            what = f"{joint} is not to be driven: its largest demand is 0"
            raise DeviceError(what, where=self._where, hint="Find out why its gains say so before you change them")
        self._control.clear()
        motor = self._motors.numbers[joint]
        self._nudge = np.zeros(MOTORS, dtype=np.int16) if pwm else None
        if self._nudge is not None:
            self._nudge[motor] = round(pwm) * self._motors.sign[motor]

    def clear(self) -> None:
        """Forget everything that was set."""
        self._control.clear()
        self._nudge = None
        self.pause()

    def pause(self) -> None:
        """Demands are away for now; when they come back their limits rise from zero again."""
        self._since_ns = None

    def words(self, joints_rad: Array, limit_share: Array, now_ns: int) -> NDArray[np.int16]:
        """The motors' words, shape (20,), by motor number.

        Args:
            joints_rad: measured joint angles, shape (24,), radians.
            limit_share: share of the largest demand that each motor may use, shape (20,).
            now_ns: present time.
        """
        if self._nudge is not None:
            return self._nudge
        if not self._control.active:
            return NO_DEMAND
        if self._since_ns is None:
            self._since_ns = now_ns
        return self._control.demand(joints_rad, np.minimum(self._soft_start(now_ns), limit_share), now_ns)

    def _soft_start(self, now_ns: int) -> float:
        if self._since_ns is None or not self._rise_ns:
            return 1.0
        return min((now_ns - self._since_ns) / self._rise_ns, 1.0)
