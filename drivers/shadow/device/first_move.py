"""Does each motor move the joint its map says? A small nudge of one motor after the other, and a look at the sensors.

A wrong map can damage a hand: control would push one joint on the word of another's sensor. So each motor first turns
its joint by about two degrees, with a small duty cycle, and back; whatever moves instead is named.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass

import numpy as np
from pydantic import Field

from drivers.core.clock import NANOSECONDS, Clock
from drivers.core.configuration import StrictModel
from drivers.core.contacts import Array
from drivers.core.errors import DeviceError
from drivers.shadow.device.hand import ShadowHand
from drivers.shadow.device.hand_motion import LARGEST_NUDGE
from drivers.shadow.device.hand_samples import HandSample
from drivers.shadow.model.motors import MotorMap


class FirstMoveSettings(StrictModel):
    """How the check moves.

    Attributes:
        pwm: duty cycle of the nudges, counts of 1023.
        move_rad: a joint that has turned so far has moved.
        patience_s: a motor that moves nothing in this time is tried the other way, then given up.
        rest_s: without demand after each nudge.
    """

    pwm: float = Field(default=150.0, gt=0.0, le=LARGEST_NUDGE)
    move_rad: float = Field(default=0.035, gt=0.0, le=0.2)
    patience_s: float = Field(default=0.6, gt=0.0, le=2.0)
    rest_s: float = Field(default=0.05, ge=0.0, le=2.0)


@dataclass(frozen=True)
class MoveFinding:
    """What one motor did.

    Attributes:
        joint: the joint its map names.
        motor: its number.
        moved: the driven joint that moved most; None when nothing did.
        backwards: it moved its own joint, but the wrong way.
    """

    joint: str
    motor: int
    moved: str | None
    backwards: bool = False

    @property
    def ok(self) -> bool:
        """Whether the map is right about this motor."""
        return self.moved == self.joint and not self.backwards

    def __str__(self) -> str:
        """In words: ``motor 5 is said to pull THJ2, but moves FFJ3``."""
        if self.moved is None:
            return f"motor {self.motor} moves nothing; the motor map says {self.joint}"
        if self.moved != self.joint:
            return f"motor {self.motor} moves {self.moved}, but the motor map says {self.joint}"
        if self.backwards:
            return f"motor {self.motor} turns {self.joint} the wrong way: list it under reversed in the motor map"
        return f"motor {self.motor} moves {self.joint}"


def check_motor_map(
    hand: ShadowHand,
    motors: MotorMap,
    cycle: Callable[[], HandSample],
    clock: Clock,
    joints: Sequence[str] | None = None,
    settings: FirstMoveSettings | None = None,
) -> list[MoveFinding]:
    """Nudge motor after motor; the first that moves another joint than its own, or the wrong way, ends the check.

    Args:
        hand: connected, clear of everything.
        motors: the map to check; the hand's own.
        cycle: one cycle of the hand: exchange, and wait for the next.
        clock: the hand's.
        joints: driven joints to check; all that may be driven unless given.
        settings: how far.

    Returns:
        Findings in the order of the joints, up to the first contradiction. The hand is still, without targets.

    Raises:
        DeviceError: the hand stopped itself.
    """
    findings = []
    check = _MotorCheck(hand, motors, cycle, clock, settings or FirstMoveSettings())
    for finding in map(check.find, hand.drivable if joints is None else joints):
        findings.append(finding)
        if finding.moved is not None and not finding.ok:
            break
    return findings


def require_motor_map(findings: Sequence[MoveFinding], where: str) -> None:
    """Refuse to continue with a wrong map.

    Raises:
        DeviceError: the first finding that is not as it should be, in words.
    """
    for finding in findings:
        if not finding.ok:
            raise DeviceError(str(finding), where=where, hint="Use the map that belongs to this hand's serial number")


class _MotorCheck:
    """Nudges one motor after the other; see :func:`check_motor_map`."""

    def __init__(
        self,
        hand: ShadowHand,
        motors: MotorMap,
        cycle: Callable[[], HandSample],
        clock: Clock,
        settings: FirstMoveSettings,
    ) -> None:
        self._hand, self._motors, self._cycle, self._clock = hand, motors, cycle, clock
        self._settings = settings

    def find(self, joint: str) -> MoveFinding:
        """What the motor of a joint moves, one way or else the other; the joint is brought back."""
        for direction in (1.0, -1.0):
            pwm = direction * self._settings.pwm
            turned_rad, took_s = self._nudge_until_it_moves(joint, pwm)
            most = int(np.abs(turned_rad).argmax())
            if abs(turned_rad[most]) >= self._settings.move_rad:
                self._nudge_for(joint, -pwm, took_s)
                backwards = bool(turned_rad[most] * direction < 0)
                return MoveFinding(joint, self._motors.numbers[joint], self._motors.names[most], backwards)
        return MoveFinding(joint, self._motors.numbers[joint], None)

    def _nudge_until_it_moves(self, joint: str, pwm: float) -> tuple[Array, float]:
        """Angles by which the driven joints turned, shape (20,) by motor number, and the seconds it took."""
        start_rad = self._motors.from_joints @ self._cycle().joints_rad
        turned_rad = np.zeros_like(start_rad)
        with self._nudge(joint, pwm) as elapsed_s:
            while elapsed_s() < self._settings.patience_s and np.abs(turned_rad).max() < self._settings.move_rad:
                turned_rad = self._motors.from_joints @ self._cycle().joints_rad - start_rad
            took_s = elapsed_s()
        return turned_rad, took_s

    def _nudge_for(self, joint: str, pwm: float, duration_s: float) -> None:
        with self._nudge(joint, pwm) as elapsed_s:
            while elapsed_s() < duration_s:
                self._cycle()

    @contextmanager
    def _nudge(self, joint: str, pwm: float) -> Iterator[Callable[[], float]]:
        """Within the block the motor is driven; gives the time since its beginning, and a rest in the end."""
        began_ns = self._clock.now_ns()
        self._hand.nudge(joint, pwm)
        try:
            yield lambda: (self._clock.now_ns() - began_ns) / NANOSECONDS
        finally:
            self._hand.nudge(joint, 0.0)
        rest_ns = self._clock.now_ns() + round(self._settings.rest_s * NANOSECONDS)
        self._cycle()
        while self._clock.now_ns() < rest_ns:
            self._cycle()
