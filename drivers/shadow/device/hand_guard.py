"""What stops the hand: motor flags, heat, load and lost cycles, watched over one connection."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from drivers.core.contacts import Array
from drivers.shadow.device.hand_samples import HandSample, StatusCounts
from drivers.shadow.device.hand_settings import HandSettings
from drivers.shadow.device.motor_load import LoadWatch
from drivers.shadow.device.motor_watch import Fault, MotorWatch
from drivers.shadow.model.motors import MotorMap
from drivers.shadow.protocol.motor_data import MAX_PWM
from drivers.shadow.protocol.palm_codec import MOTORS, PalmStatus


@dataclass
class HandCounters:
    """Cycles since connecting.

    Attributes:
        cycles: exchanges.
        lost: exchanges without a valid status.
        lost_in_a_row: the present run of them.
        malformed: messages that were no status of this palm.
    """

    cycles: int = 0
    lost: int = 0
    lost_in_a_row: int = 0
    malformed: int = 0


class HandGuard:
    """Looks at every status and every lost cycle; the first fault stays until :meth:`resume`.

    Args:
        settings: of the hand, with all limits.
        motors: which motor pulls which joint.
        where: name of the hand's transport, for messages.
    """

    def __init__(self, settings: HandSettings, motors: MotorMap, where: str) -> None:
        self._settings, self._where = settings, where
        self._watch = MotorWatch(motors, settings.heat, where)
        self._load = LoadWatch(motors, settings.load, _largest_pwm(settings, motors), where)
        self.counters = HandCounters()
        self.fault: Fault | None = None

    def restart(self) -> None:
        """Count from zero, for a new connection."""
        self.counters = HandCounters()

    def resume(self) -> None:
        """Forget the fault and what led to it."""
        self.fault = None
        self.counters.lost_in_a_row = 0
        self._load.restart()

    @property
    def forbids_demands(self) -> bool:
        """There is a fault, or nothing has been heard of the hand for several cycles."""
        return self.fault is not None or self.counters.lost_in_a_row >= self._settings.blind_after

    def blame(self, fault: Fault | None) -> None:
        """Keep a fault unless there is an earlier one."""
        self.fault = self.fault or fault

    def look(self, status: PalmStatus, *, settling: bool) -> None:
        """Look at a status; while ``settling`` motors may report that they had halted."""
        self.fault = self.fault or self._watch.fault(status, settling=settling)
        self.fault = self.fault or self._load.fault(status)

    def look_at_demand(self, words: NDArray[np.int16], now_ns: int) -> None:
        """Look at the demands that go out, shape (20,): a motor told its most for too long has stalled."""
        self.blame(self._load.stall(words, now_ns))

    def pwm_share(self, temperature_C: Array) -> Array:
        """Share of the duty cycle each motor may have, shape (20,)."""
        return self._watch.pwm_share(temperature_C)

    def on_status(self) -> None:
        """A cycle brought a status."""
        self.counters.lost_in_a_row = 0

    def on_lost_cycle(self) -> None:
        """A cycle brought none."""
        counters = self.counters
        counters.lost += 1
        counters.lost_in_a_row += 1
        if counters.lost_in_a_row >= self._settings.lost_limit and self.fault is None:
            self.fault = Fault(
                f"stopped after {counters.lost_in_a_row} cycles in a row without a valid status",
                self._where,
                "Check the cable and the hand's power, then connect again",
            )

    def problems(self, newest: HandSample | None, statuses: StatusCounts, connected_ns: int) -> tuple[str, ...]:
        """What is wrong with the hand, in words; empty when all is well."""
        problems = []
        if self.fault is not None:
            problems.append(str(self.fault.error()))
        if self.counters.lost:
            problems.append(f"{self.counters.lost} of {self.counters.cycles} cycles lost")
        if self.counters.malformed:
            problems.append(f"{self.counters.malformed} messages were not a status of a {self._settings.palm} palm")
        if statuses.stale:
            problems.append(f"{statuses.stale} statuses repeated old ones")
        if newest is not None:
            problems += self._watch.problems(newest, connected_ns)
        return tuple(problems)


def _largest_pwm(settings: HandSettings, motors: MotorMap) -> NDArray[np.float64]:
    """Largest duty cycle each motor is told, shape (20,); any where motors are told torques."""
    if settings.demand == "torque":
        return np.full(MOTORS, float(MAX_PWM))
    return np.array([settings.gains.of(name).max_pwm for name in motors.names])
