"""What ends a guarded motion, and who is said to have met something."""

from __future__ import annotations

from types import SimpleNamespace
from typing import cast

import numpy as np
import pytest

from drivers.core.contacts import FINGERS
from drivers.shadow.model.motors import MotorMap
from sessions.motion.guard import LINKS, Guard
from sessions.motion.motion import Motion

MOTORS = MotorMap.load()
CYCLE_ns = 10_000_000


def met(joint: str, tip_N: float, pushed: float = 60.0) -> tuple[str, ...]:
    """What a guard tells of a push on one joint's motor while that finger's tip feels a force."""
    motion = SimpleNamespace(
        form=SimpleNamespace(fingers=FINGERS),
        runtime=SimpleNamespace(perception=SimpleNamespace(motors=MOTORS)),
        bent=lambda least_rad: (),
    )
    guard, rng = Guard(cast(Motion, motion), 0.25, 0.12), np.random.default_rng(0)
    for cycle in range(100):
        is_pushed = cycle >= 80
        torques = 300.0 + 5.0 * rng.standard_normal(20)
        torques[MOTORS.numbers[joint]] += pushed * is_pushed
        motion.motor_torques, motion.hand_stamp_ns = torques, cycle * CYCLE_ns
        motion.loads_N = lambda now=is_pushed: dict.fromkeys(FINGERS, 0.0) | {joint[:2]: tip_N * now}
        guard.is_met()
    return guard.met


@pytest.mark.parametrize("joint", ["MFJ3", "LFJ0", "THJ2"])
def test_a_finger_that_stands_still_and_whose_tip_feels_nothing_tells_a_push_on_a_link(joint: str) -> None:
    assert met(joint, 0.0) == (LINKS,)
    assert met(joint, 0.0, pushed=0.0) == ()


def test_a_fingertip_that_feels_something_is_what_its_motor_works_against() -> None:
    assert met("MFJ3", 0.2) == ()
    assert met("MFJ3", 0.3) == ("MF",)


def test_the_wrist_has_to_show_more() -> None:
    assert met("WRJ1", 0.0, pushed=50.0) == ()
    assert met("WRJ1", 0.0, pushed=100.0) == (LINKS,)
