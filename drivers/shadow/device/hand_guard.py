"""What stops the hand: motor flags, heat, load and lost cycles, watched over one connection."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from drivers.core.clock import NANOSECONDS
from drivers.core.contacts import Array
from drivers.shadow.device.hand_samples import HandSample, StatusCounts
from drivers.shadow.device.hand_settings import HandSettings
from drivers.shadow.device.joint_watch import JointWatch
from drivers.shadow.device.motor_load import LoadWatch
from drivers.shadow.device.motor_watch import Fault, MotorWatch
from drivers.shadow.model.joint_calibration import JointCalibration
from drivers.shadow.model.motors import MotorMap
from drivers.shadow.protocol.motor_data import MAX_PWM
from drivers.shadow.protocol.palm_codec import MOTORS

STALE_s = 0.05
"""No demand rests on a status older than this."""


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
        calibration: of the hand's joints.
        where: name of the hand's transport, for messages.
        link: what the transport knows to be wrong, in words.
    """

    def __init__(
        self,
        settings: HandSettings,
        motors: MotorMap,
        calibration: JointCalibration,
        where: str,
        link: Callable[[], tuple[str, ...]] = tuple,
    ) -> None:
        self._settings, self._where, self._link = settings, where, link
        self._heard_ns: int | None = None
        self._watch = MotorWatch(motors, settings.heat, where, keep_torque=settings.demand == "torque")
        largest = np.array([settings.gains.of(name).max_pwm for name in motors.names])
        self._joints = JointWatch(calibration, motors, largest, settings.sensors, where)
        self._load = LoadWatch(motors, settings.load, _largest_pwm(settings, motors), where)
        self.counters = HandCounters()
        self.fault: Fault | None = None

    def restart(self) -> None:
        """Count from zero, for a new connection."""
        self.counters = HandCounters()
        self._heard_ns = None
        self._watch.restart()

    def resume(self) -> None:
        """Forget the fault and what led to it."""
        self.fault = None
        self._heard_ns = None
        self.counters.lost_in_a_row = 0
        self._load.restart()
        self._joints.restart()

    def forbids_demands(self, now_ns: int) -> bool:
        """There is a fault, or the last status of the hand is too old, by cycles or by time."""
        if self.fault is not None or self.counters.lost_in_a_row >= self._settings.blind_after:
            return True
        return self._silent_s(now_ns) > STALE_s

    def _silent_s(self, now_ns: int) -> float:
        return 0.0 if self._heard_ns is None else (now_ns - self._heard_ns) / NANOSECONDS

    def blame(self, fault: Fault | None) -> None:
        """Keep a fault unless there is an earlier one."""
        self.fault = self.fault or fault

    def look(self, sample: HandSample, now_ns: int, *, settling: bool) -> None:
        """Look at a new status; while ``settling`` motors may report that they had halted."""
        self._heard_ns, status = now_ns, sample.status
        self._watch.hear(status, now_ns)
        self._joints.see(status.sensors, sample.joints_rad, sample.stamp_ns)
        self.blame(self._watch.fault(status, settling=settling))
        self.blame(self._load.fault(status))

    def look_at_driven(self, driven: NDArray[np.bool_], now_ns: int) -> None:
        """Look at sensors and motors on which the demands of driven motors, shape (20,), are to rest."""
        self.blame(self._joints.fault(driven))
        self.blame(self._watch.silence(driven, now_ns))

    def look_at_time(self, now_ns: int, *, driven: bool) -> None:
        """Check how long the hand was silent, before a cycle: the link was gone, or this program stood still.

        Args:
            now_ns: present time.
            driven: there are targets or demands, so that a pause of the program matters.
        """
        patience_s = self._settings.link_patience_s
        if self._silent_s(now_ns) <= patience_s:
            return
        if self.counters.lost_in_a_row:
            what = ": ".join([f"stopped: no valid status for {patience_s:g} s", *self._link()[:1]])
            self.blame(Fault(what, self._where, "Check the cable and the hand's power, then connect again"))
        elif driven:
            what = f"stopped: the program stood still for {self._silent_s(now_ns):.1f} s"
            self.blame(Fault(what, self._where, "Find out what held the computer up, then resume"))

    def look_at_demand(self, words: NDArray[np.int16], last: HandSample, now_ns: int, *, is_nudge: bool) -> None:
        """Look at the demands that are to go out, shape (20,), before they do, with the sample that they rest on.

        A motor at its maximum for too long has stalled; one that pushes against nothing has to move its joint. A nudge
        need not: the caller of the nudge checks what moves, and small duty cycles may not overcome friction.
        """
        self.blame(self._load.stall(words, last.joints_rad, now_ns))
        if not is_nudge:
            self.blame(self._joints.frozen(words, last.motor.torque, now_ns))

    def pwm_share(self, temperature_C: Array) -> Array:
        """Share of the duty cycle each motor may have, shape (20,)."""
        return self._watch.pwm_share(temperature_C)

    def on_status(self) -> None:
        """A cycle brought a status."""
        self.counters.lost_in_a_row = 0

    def on_lost_cycle(self, now_ns: int) -> None:
        """A cycle brought none."""
        if self._heard_ns is None:
            self._heard_ns = now_ns
        self.counters.lost += 1
        self.counters.lost_in_a_row += 1

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
            problems += self._watch.problems(newest, connected_ns) + self._joints.problems()
        return tuple(problems)


def _largest_pwm(settings: HandSettings, motors: MotorMap) -> NDArray[np.float64]:
    """Largest duty cycle commanded to each motor, shape (20,); unlimited if torques are commanded."""
    if settings.demand == "torque":
        return np.full(MOTORS, float(MAX_PWM))
    return np.array([settings.gains.of(name).max_pwm for name in motors.names])
