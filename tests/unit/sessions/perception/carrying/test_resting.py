from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from gtsam import Pose2

from sessions.perception.carrying.carry import CarryOdometry
from sessions.perception.carrying.friction_balance import Friction
from sessions.perception.carrying.resting import at_rest
from tests.support.held_objects import BOX, carried

SHIFT = Pose2(0.02, 0.0, 0.0)
FIRM_N, LIGHT_N = 1.0, 0.2
FRICTION = Friction(table_N=1.0)


def dragged(*, pushed_N=1.0, later_N, squeeze_N=LIGHT_N, moment_Nm=0.0):
    """A carry whose second half is pressed and pushed otherwise; the fingertips go on as if it moved with them."""
    steps = carried(BOX, object_motion=SHIFT, palm_motion=SHIFT)
    half = len(steps) // 2
    steps.net_forces_N[:half, 0], steps.net_forces_N[half:, 0] = pushed_N, later_N
    steps.forces_N[:half], steps.forces_N[half:] = FIRM_N, squeeze_N
    steps.moments_Nm[half:] = moment_Nm
    return steps


def resting(steps, friction=FRICTION):
    """Of the two halves."""
    found = at_rest(steps, friction)
    half = len(steps) // 2
    assert len(set(found[:half])) == len(set(found[half:])) == 1
    return bool(found[0]), bool(found[-1])


def test_what_is_pressed_lightly_and_pushed_less_than_the_table_resists_stays():
    assert resting(dragged(later_N=0.5)) == (False, True)


@pytest.mark.parametrize(
    ("why", "steps"),
    [
        ("it is pushed as hard as the table resists", dragged(later_N=0.9)),
        ("it is turned as hard", dragged(later_N=0.1, moment_Nm=0.9 * FRICTION.foot_m)),
        ("it is squeezed firmly: links push as well", dragged(later_N=0.1, squeeze_N=0.8)),
        ("it is so light that it was never pushed harder", dragged(pushed_N=0.2, later_N=0.2)),
    ],
)
def test_what_is_moved(why, steps):
    assert resting(steps) == (False, False), why


def test_a_table_that_was_measured_counts():
    """The carry pushed with 1.4 N, and 0.6 N are less than three quarters of that, but the table resists with 0.7 N."""
    steps = dragged(pushed_N=1.4, later_N=0.6)
    assert resting(steps) == (False, True)
    assert resting(steps, replace(FRICTION, table_N=0.7)) == (False, False)


def test_a_carry_ends_where_the_table_takes_hold():
    odometry = CarryOdometry(dict.fromkeys(BOX), "right")
    moved, held = (odometry.carry(dragged(later_N=later_N)) for later_N in (1.0, 0.3))
    assert held.motion.x() == pytest.approx(SHIFT.x() / 2, abs=2e-3)
    assert moved.motion.x() > held.motion.x() + 2e-3
    assert held.slip_m > moved.slip_m + 2e-3


def test_no_push_at_all_tells_nothing():
    """Fingertips that report no forces along the table do not make everything stay."""
    assert not np.any(at_rest(dragged(pushed_N=0.0, later_N=0.0), FRICTION))
