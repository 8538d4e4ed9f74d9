"""Actions for an uncertain pose: what they promise, and what comes of them."""

from __future__ import annotations

import numpy as np
import pytest

from tactile_lab.experiments.cells import Cell
from tactile_lab.experiments.thesis import pose_actions
from tactile_lab.experiments.thesis.rig_sessions import RIG, by_rule
from tactile_lab.rigs.description import load_rig


@pytest.fixture(scope="module")
def tried() -> dict[str, dict[str, float]]:
    """Every action of one seed."""
    return {
        action: pose_actions.try_action(Cell((("action", action),), 4))
        for action in (pose_actions.NOTHING, *pose_actions.ACTIONS)
    }


def test_every_action_narrows_the_pose(tried: dict[str, dict[str, float]]) -> None:
    before = tried.pop(pose_actions.NOTHING)
    assert before["position_mm"] > 4.0
    for figures in tried.values():
        assert figures["kl"] > 3.0
        assert figures["position_mm"] < before["position_mm"]
        assert figures["rotation_deg"] < before["rotation_deg"]


def test_one_action_has_the_largest_gain_and_one_is_the_best(tried: dict[str, dict[str, float]]) -> None:
    actions = [tried[name] for name in pose_actions.ACTIONS]
    chosen = [figures["kl_chooses"] for figures in actions]
    assert sum(chosen) == sum(figures["is_best"] for figures in actions) == 1
    assert int(np.argmax([figures["kl"] for figures in actions])) == chosen.index(True)


def test_sessions_on_the_rig_follow_the_rule_for_every_grasp() -> None:
    settings = by_rule(load_rig(RIG), 9)
    assert (settings.grasps, settings.fixed_grasps, settings.exploration.policy) == (9, 9, None)
