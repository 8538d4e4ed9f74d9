"""Pinches over the rim of what is wider than the hand opens."""

from __future__ import annotations

import numpy as np
from gtsam import Pose2, Pose3

from drivers.core.contacts import Contact, Grasp
from drivers.shadow.closing.closing import closing
from drivers.shadow.closing.posture import HandShape
from sessions.motion.probing.bounding_box import BoundingBox
from tactile_lab.autonomy.standing.candidate import SideReach
from tactile_lab.autonomy.standing.felt_object import FeltObject
from tactile_lab.autonomy.standing.rim_planner import RimPlanner

HAND = HandShape()


def bowl(wide_m: float = 0.12, top_m: float = 0.052) -> RimPlanner:
    high = np.full(2, wide_m / 2)
    felt = FeltObject(BoundingBox(Pose2(0.01, 0.02, 0.5), -high, high, 0.008, top_m, {}))
    return RimPlanner(felt, HAND, (-1.31, 1.31), SideReach())


def pinched(place: Pose2) -> Grasp:
    """Fingers on the outside, the thumb on the inside of a wall at a place whose x axis points outward."""
    outward = place.rotation().matrix() @ [1.0, 0.0]
    places = [place.transformFrom((0.0, y)) for y in (-0.03, -0.01, 0.01, 0.03)] + [place.transformFrom((-0.008, 0.0))]
    signs = (1, 1, 1, 1, -1)
    contacts = [
        Contact("TH" if sign < 0 else "FF", np.array([*at, 0.03]), sign * np.array([*outward, 0]), np.eye(3), 0.1, 0.4)
        for at, sign in zip(places, signs, strict=True)
    ]
    return Grasp(0, 0, tuple(contacts), Pose3())


def test_the_rim_is_in_the_middle_and_the_thumb_inside() -> None:
    best = bowl().best()
    assert best is not None
    table = closing(best.plan.closing, best.plan.height_m, HAND)
    assert not table.is_sideways
    thumb = table.path("TH").centre_m(table.path("TH").valid[0])
    place = np.asarray(best.plan.frame.pose.transformFrom(thumb))
    assert np.abs(place[:2] - [0.01, 0.02]).max() < 0.045
    assert 0.028 < best.plan.height_m < 0.040


def test_only_what_the_hand_cannot_span_and_can_pass_over_is_pinched() -> None:
    assert bowl(wide_m=0.07).best() is None
    assert bowl(top_m=0.15).best() is None


def test_after_a_pinch_of_one_wall_the_object_is_as_wide_as_before_and_another_wall_comes() -> None:
    planner = bowl()
    first = planner.best()
    assert first is not None
    planner.felt.on_grasp(pinched(Pose2(first.plan.frame.x_m, first.plan.frame.y_m, first.plan.frame.yaw_rad)))
    assert min(planner.felt.standing_box.size_m[:2]) > 0.10
    second = planner.best()
    assert second is not None
    assert abs(second.plan.frame.yaw_rad - first.plan.frame.yaw_rad) > 0.3


def test_after_two_landings_nothing_else_is_pinched() -> None:
    planner = bowl()
    for _ in range(2):
        best = planner.best()
        assert best is not None
        assert not best.plan.may_shift
        planner.blocked.append(best)
    assert planner.best() is None
