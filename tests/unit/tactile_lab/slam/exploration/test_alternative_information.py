"""Grasps that tell which of several trajectories is right."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from gtsam import Pose2

from tactile_lab.slam.exploration.alternative_information import told_apart
from tactile_lab.slam.exploration.expected_information import InformationSettings
from tactile_lab.slam.exploration.information_policy import InformationPolicy
from tactile_lab.slam.exploration.policy import Belief, RivalObject, Surface
from tests.support.rectangle_world import belief_of, contacts_every, ten

SIGMA_m, FINGER_m = 0.001, 0.002


@pytest.fixture(scope="module")
def known() -> Belief:
    return belief_of(*contacts_every(0.008))


def surface_of(belief: Belief) -> Surface:
    assert belief.surface is not None
    return belief.surface


def shortened(belief: Belief, probability: float = 0.3) -> RivalObject:
    """The object 30 mm shorter at its right end: an alternative misplaced the grasps there."""
    surface = surface_of(belief)
    points = surface.points_m.copy()
    points[:, 0] = np.minimum(points[:, 0], 0.02)
    return RivalObject(replace(surface, points_m=points), belief.world_T_object, probability, displaced=12)


def worth(belief: Belief) -> np.ndarray:
    return told_apart(ten(), belief, surface_of(belief), SIGMA_m, FINGER_m)


def test_without_alternatives_or_with_equal_ones_nothing_is_told_apart(known: Belief) -> None:
    assert not worth(known).any()
    same = RivalObject(surface_of(known), known.world_T_object, 0.3, displaced=12)
    assert np.abs(worth(replace(known, rivals=(same,)))).max() < 1e-6


def test_only_grasps_that_end_differently_tell_which_is_right(known: Belief) -> None:
    found = worth(replace(known, rivals=(shortened(known),)))
    assert found.max() > 5.0
    assert found.min() < 0.5 * found.max()


def test_an_unlikely_alternative_or_an_uncertain_pose_tells_less(known: Belief) -> None:
    doubtful = replace(known, rivals=(shortened(known),))
    unlikely = replace(known, rivals=(shortened(known, 0.01),))
    elsewhere = replace(known, rivals=(replace(shortened(known), world_T_object=Pose2(0.004, 0.0, 0.0)),))
    lost = replace(elsewhere, pose_covariance=np.diag([0.03, 0.03, 0.3]) ** 2)
    assert worth(unlikely).max() < 0.2 * worth(doubtful).max()
    assert worth(lost).sum() < worth(elsewhere).sum()


def test_the_policy_chooses_what_tells_them_apart_and_says_so(known: Belief) -> None:
    doubtful, candidates = replace(known, rivals=(shortened(known),)), ten()
    policy = InformationPolicy(InformationSettings())
    decision = policy.choose(candidates, doubtful, np.random.default_rng(0))
    found = worth(doubtful)
    assert decision.chosen is not None
    assert found[decision.chosen] > 0.9 * found.max()
    assert "which placing is right (30% for another)" in decision.reason
    assert "placing" not in policy.choose(candidates, known, np.random.default_rng(0)).reason
