"""Does each motor move the joint its map says? A small nudge of one motor after the other, and a look at the sensors.

A wrong map can damage a hand: control would push one joint on the word of another's sensor. So each motor first turns
its joint by about two degrees, with a small duty cycle, and back; whatever moves instead is named.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from pydantic import Field

from drivers.core.configuration import StrictModel
from drivers.core.contacts import Array
from drivers.core.errors import DeviceError
from drivers.shadow.device.hand import ShadowHand
from drivers.shadow.device.hand_motion import LARGEST_NUDGE
from drivers.shadow.device.hand_samples import HandSample
from drivers.shadow.model.motors import DRIVEN_JOINTS, MotorMap


class FirstMoveSettings(StrictModel):
    """How the check moves.

    Attributes:
        pwm: duty cycle of the nudges, counts of 1023.
        move_rad: a joint that has turned so far has moved.
        patience_cycles: a motor that moves nothing in so many cycles is tried the other way, then given up.
        rest_cycles: cycles without demand after each nudge.
    """

    pwm: float = Field(default=150.0, gt=0.0, le=LARGEST_NUDGE)
    move_rad: float = Field(default=0.035, gt=0.0, le=0.2)
    patience_cycles: int = Field(default=300, ge=1)
    rest_cycles: int = Field(default=5, ge=1)


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
    joints: Sequence[str] = DRIVEN_JOINTS,
    settings: FirstMoveSettings | None = None,
) -> list[MoveFinding]:
    """Nudge motor after motor; the first that moves another joint than its own, or the wrong way, ends the check.

    Args:
        hand: connected, clear of everything.
        motors: the map to check; the hand's own.
        cycle: one cycle of the hand: exchange, and wait for the next.
        joints: driven joints to check.
        settings: how far.

    Returns:
        Findings in the order of the joints, up to the first contradiction. The hand is still, without targets.

    Raises:
        DeviceError: the hand stopped itself.
    """
    findings = []
    for finding in _findings(hand, motors, cycle, joints, settings or FirstMoveSettings()):
        findings.append(finding)
        if finding.moved is not None and not finding.ok:
            break
    return findings


def require_motor_map(findings: Sequence[MoveFinding], where: str) -> None:
    """Refuse to go on with a map that is wrong.

    Raises:
        DeviceError: the first finding that is not as it should be, in words.
    """
    for finding in findings:
        if not finding.ok:
            raise DeviceError(str(finding), where=where, hint="Use the map that belongs to this hand's serial number")


def _findings(
    hand: ShadowHand,
    motors: MotorMap,
    cycle: Callable[[], HandSample],
    joints: Sequence[str],
    settings: FirstMoveSettings,
) -> Iterator[MoveFinding]:
    for joint in joints:
        finding = MoveFinding(joint, motors.numbers[joint], None)
        for direction in (1.0, -1.0):
            turned_rad, cycles = _nudge(hand, motors, cycle, joint, direction * settings.pwm, settings)
            most = int(np.abs(turned_rad).argmax())
            if abs(turned_rad[most]) >= settings.move_rad:
                backwards = turned_rad[most] * direction < 0
                finding = MoveFinding(joint, finding.motor, motors.names[most], bool(backwards))
                _back(hand, cycle, joint, -direction * settings.pwm, cycles, settings)
                break
        yield finding


def _nudge(
    hand: ShadowHand,
    motors: MotorMap,
    cycle: Callable[[], HandSample],
    joint: str,
    pwm: float,
    settings: FirstMoveSettings,
) -> tuple[Array, int]:
    """Angles of the driven joints turned, shape (20,) by motor number, and the cycles it took."""
    start_rad = motors.from_joints @ cycle().joints_rad
    hand.nudge(joint, pwm)
    cycles, turned_rad = 0, np.zeros_like(start_rad)
    try:
        while cycles < settings.patience_cycles and np.abs(turned_rad).max() < settings.move_rad:
            turned_rad = motors.from_joints @ cycle().joints_rad - start_rad
            cycles += 1
    finally:
        hand.nudge(joint, 0.0)
    _rest(cycle, settings)
    return turned_rad, cycles


def _back(
    hand: ShadowHand,
    cycle: Callable[[], HandSample],
    joint: str,
    pwm: float,
    cycles: int,
    settings: FirstMoveSettings,
) -> None:
    hand.nudge(joint, pwm)
    try:
        for _ in range(cycles):
            cycle()
    finally:
        hand.nudge(joint, 0.0)
    _rest(cycle, settings)


def _rest(cycle: Callable[[], HandSample], settings: FirstMoveSettings) -> None:
    for _ in range(settings.rest_cycles):
        cycle()
