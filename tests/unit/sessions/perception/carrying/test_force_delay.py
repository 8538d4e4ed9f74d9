"""How late forces arrive, by the onsets of touches."""

from __future__ import annotations

import numpy as np
import pytest

from drivers.core.contacts import FINGERS
from drivers.shadow.model.kinematics import JOINTS, forearm_T_palm_matrix, palm_T_distal_matrices
from sessions.perception.carrying.carry_record import CarrySamples
from sessions.perception.carrying.force_delay import ForceDelay
from tests.support.wrench_tip import WrenchTip

COUNT, STEP_s, STIFFNESS_N_m = 120, 0.01, 900.0


TIPS = {finger: WrenchTip() for finger in FINGERS}


def touching(late_s: float, chance: np.random.Generator) -> CarrySamples:
    """A hand that moves forward until each of its tips has pressed a little into something, and stops."""
    met_s = 0.5 + 0.01 * chance.random(len(FINGERS))
    times_s = STEP_s * np.arange(COUNT)
    joints_rad = np.full((COUNT, len(JOINTS)), 0.3)
    forearm = np.tile(np.eye(4), (COUNT, 1, 1))
    way_m = 0.03 * np.minimum(times_s, 0.53 + 0.01 * chance.random())
    forearm[:, 1, 3] = way_m + 2e-5 * chance.standard_normal(COUNT)
    frames = (forearm @ forearm_T_palm_matrix(joints_rad, "right"))[:, None] @ palm_T_distal_matrices(
        joints_rad, "right"
    )
    readings = np.zeros((COUNT, len(FINGERS), 6))
    for at, seconds in enumerate(met_s):
        deep_m = np.interp(times_s - late_s, times_s, np.maximum(forearm[:, 1, 3] - 0.03 * seconds, 0.0))
        force_N = STIFFNESS_N_m * deep_m + 0.01 * chance.standard_normal(COUNT)
        readings[:, at, :3] = np.einsum("nji,j->ni", frames[:, at, :3, :3], [0.0, -1.0, 0.0]) * force_N[:, None]
    return CarrySamples(1e9 * times_s, joints_rad, forearm, readings)


@pytest.mark.parametrize("late_ms", [0.0, 20.0, 50.0, -20.0])
def test_the_delay_is_found(late_ms: float) -> None:
    chance, delay = np.random.default_rng(1), ForceDelay(TIPS, "right")
    for _ in range(6):
        delay.on_closing(touching(1e-3 * late_ms, chance))
    assert delay.delay_s is not None
    assert 1e3 * delay.delay_s[0] == pytest.approx(late_ms, abs=10.0)
    assert delay.delay_s[1] < 0.01
    assert ("ms later" in delay.problem) == (late_ms > 40.0)


def test_a_few_touches_tell_nothing() -> None:
    delay = ForceDelay(TIPS, "right")
    delay.on_closing(touching(0.08, np.random.default_rng(2)))
    assert delay.delay_s is None
    assert delay.problem == ""


def test_a_closing_that_touches_nothing_or_begins_in_touch_counts_for_nothing() -> None:
    delay, chance = ForceDelay(TIPS, "right"), np.random.default_rng(3)
    for _ in range(30):
        taken = touching(0.08, chance)
        taken.readings[:] = 0.0
        delay.on_closing(taken)
        taken.readings[..., 1] = 0.5
        delay.on_closing(taken)
    assert delay.delay_s is None
