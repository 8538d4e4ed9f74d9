"""Objects that the hand does not carry between grasps, followed by the whole method."""

from __future__ import annotations

import numpy as np
import pytest
from gtsam import Pose2

from tactile_lab.experiments.outlines import OUTLINES_m
from tactile_lab.experiments.planar_hand import PlanarHand
from tactile_lab.geometry.poses import planar
from tactile_lab.slam import SlamSettings, TactileSlam
from tactile_lab.tracking import branching

PALMS = [Pose2(0.0, 0.0, float(yaw)) for yaw in np.deg2rad([0, 60, -60, 30, -30, 90, 15, 75])]
MOTION = {"translation_m": 0.007, "rotation_rad": 0.21, "left_lying": 0.15}
PUSHED_AT = 3


@pytest.mark.parametrize("turn_deg", [0.0, 13.0, -18.0])
def test_an_object_that_a_closing_hand_turned_is_followed(turn_deg: float) -> None:
    """Nothing carries it; it lies still but for one grasp, in which the fingers turn it."""
    hand = PlanarHand(OUTLINES_m["rectangle"], np.random.default_rng(4))
    slam = TactileSlam(SlamSettings.model_validate({"method": "joint", "dimension": 2, "motion": MOTION}), seed=4)
    where, errors_deg = Pose2(0.004, -0.003, 0.2), []
    for index, palm in enumerate(PALMS):
        if index == PUSHED_AT:
            where = where.compose(Pose2(0.006, 0.002, float(np.deg2rad(turn_deg))))
        step = slam.step(hand.grasp(index, palm, where))
        assert step.verdict in ("first", "tracked"), (index, step.reason)
        assert slam.world_T_object is not None
        errors_deg.append(np.rad2deg(planar(slam.world_T_object).rotation().theta() - where.rotation().theta()))
    assert not slam.is_lost
    assert np.ptp(np.unwrap(errors_deg, period=360)) < 6


@pytest.mark.parametrize(("left_lying", "times"), [(0.15, 2), (1.0, 1)])
def test_a_push_is_looked_for_apart_only_where_it_is_another_motion(
    monkeypatch: pytest.MonkeyPatch, left_lying: float, times: int
) -> None:
    hand = PlanarHand(OUTLINES_m["rectangle"], np.random.default_rng(4))
    motion = MOTION | {"left_lying": left_lying}
    slam = TactileSlam(SlamSettings.model_validate({"method": "joint", "dimension": 2, "motion": motion}), seed=4)
    slam.step(hand.grasp(0, PALMS[0], Pose2()))
    asked, propose = [], branching.propose
    monkeypatch.setattr(branching, "propose", lambda *given: asked.append(given) or propose(*given))
    slam.step(hand.grasp(1, PALMS[1], Pose2()))
    assert len(asked) == times
