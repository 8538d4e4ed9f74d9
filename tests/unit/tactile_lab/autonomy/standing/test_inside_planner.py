"""Touches inside what is open from above: only with walls all around, and no longer once nothing inside is new."""

from __future__ import annotations

import numpy as np
import pytest
from gtsam import Pose2

from drivers.core.contacts import Array
from drivers.shadow.closing.finger_down import LEANS_rad, finger_down
from drivers.shadow.closing.posture import HandShape
from drivers.shadow.model.hand_form import HandForm
from sessions.motion.probing.bounding_box import BoundingBox
from tactile_lab.autonomy.standing.candidate import SideReach, StandingCandidate
from tactile_lab.autonomy.standing.felt_object import FeltObject
from tactile_lab.autonomy.standing.inside_planner import InsidePlanner

HAND, WINDOW_rad = HandShape(), (-1.31, 1.31)
AT_m, RADIUS_m = np.array([0.02, -0.01]), 0.040


def around(radius_m: float, top_m: float, over_rad: float = 2 * np.pi) -> tuple[Array, Array]:
    """Places and normals of contacts on the outside of a round wall, over a part of it."""
    angles = np.linspace(0.0, over_rad, 9)
    out = np.column_stack([np.cos(angles), np.sin(angles), np.zeros(9)])
    heights_m = (0.03, top_m - 0.01)
    return np.vstack([radius_m * out + [*AT_m, z] for z in heights_m]), np.vstack([out] * len(heights_m))


def cup(top_m: float = 0.095, over_rad: float = 2 * np.pi, *, open_at_m: float | None = 0.0) -> FeltObject:
    """Contacts around a wall, and a tap of which a fingertip met nothing so far from the middle."""
    high_m = np.full(2, RADIUS_m)
    felt = FeltObject(BoundingBox(Pose2(*AT_m, 0.0), -high_m, high_m, 0.0, top_m, {}))
    felt.add(*around(RADIUS_m, top_m, over_rad))
    if open_at_m is not None:
        felt.on_missed_top(np.array([[AT_m[0] + open_at_m, AT_m[1], top_m]]))
    return felt


def planner(felt: FeltObject) -> InsidePlanner:
    return InsidePlanner(felt, HAND, WINDOW_rad, SideReach())


def found(felt: FeltObject) -> StandingCandidate:
    best = planner(felt).best()
    assert best is not None
    return best


@pytest.mark.parametrize("open_at_m", [0.0, 0.015])
def test_a_finger_goes_down_in_the_middle_of_an_opening(open_at_m: float) -> None:
    plan = found(cup(open_at_m=open_at_m)).plan
    assert plan.opening is not None
    assert plan.only_touch
    assert np.hypot(plan.frame.x_m - AT_m[0], plan.frame.y_m - AT_m[1]) < 0.006
    assert plan.opening.half_m == pytest.approx(RADIUS_m, abs=0.006)


def test_no_deeper_than_all_else_of_the_hand_stays_above_the_rim() -> None:
    opening = found(cup(top_m=0.15)).plan.opening
    assert opening is not None
    rooms_m = [finger_down(lean_rad, HAND).room_m(RADIUS_m) for lean_rad in LEANS_rad]
    assert opening.rim_m - opening.deepest_m < min(rooms_m)
    low = found(cup(top_m=0.05)).plan.opening
    assert low is not None
    assert 0.0 < low.deepest_m < 0.01


def test_contacts_are_expected_on_the_floor_and_on_both_walls_facing_inward() -> None:
    best = found(cup())
    assert best.normals is not None
    inward = (AT_m - best.touches_m[:, :2]) / RADIUS_m
    beside = best.normals[:, 2] == 0.0
    assert np.count_nonzero(~beside) == 1
    np.testing.assert_allclose(best.normals[beside, :2], inward[beside], atol=0.2)


@pytest.mark.parametrize(
    "felt", [cup(open_at_m=None), cup(over_rad=np.radians(120.0))], ids=["nothing was missed", "a notch"]
)
def test_what_is_not_open_is_not_entered(felt: FeltObject) -> None:
    assert planner(felt).best() is None


def test_what_is_too_narrow_for_a_finger_is_not_entered() -> None:
    felt = cup()
    felt.add(*around(0.014, 0.095))
    assert planner(felt).best() is None


def test_outsides_say_nothing_of_the_inside_and_it_is_known_after_some_touches() -> None:
    felt = cup()
    felt.add(*around(RADIUS_m + 0.004, 0.095))
    plans, touches = planner(felt), list[StandingCandidate]()
    while (best := plans.best()) is not None and len(touches) < 20:
        assert best.normals is not None
        felt.openings.on_looked(best.touches_m, best.normals)
        touches.append(best)
    assert 2 <= len(touches) <= 5
    assert touches[0].score_m == pytest.approx(0.04 * len(touches[0].touches_m))
    scores_m = [one.score_m for one in touches]
    assert scores_m == sorted(scores_m, reverse=True)
    assert len({one.plan.frame.yaw_rad for one in touches}) == len(touches)


def test_after_two_blocked_tries_no_other_is_made() -> None:
    plans = planner(cup())
    for _ in range(2):
        best = plans.best()
        assert best is not None
        plans.blocked.append(best)
    assert plans.best() is None


def test_a_hand_without_its_first_finger_does_not_reach_in() -> None:
    form = HandForm(driven=tuple(name for name in HAND.form.driven if not name.startswith("FF")))
    assert InsidePlanner(cup(), HandShape(form=form), WINDOW_rad, SideReach()).best() is None
