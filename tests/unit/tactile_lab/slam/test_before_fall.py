"""An object that falls over during a session: the model is that of the part that knows more of it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from tactile_lab.experiments.data.planar_data import simulate
from tactile_lab.slam.result import SlamResult
from tactile_lab.slam.slam_settings import SlamSettings
from tactile_lab.slam.tactile_slam import TactileSlam

GRASPS = 8


def run(fall: int | None, contacts_since: int | None = None) -> SlamResult:
    """Grasps of a rectangle, which falls over before one of them; of those from then on some contacts are left."""
    data = simulate("rectangle", 2, count=GRASPS)
    slam = TactileSlam(SlamSettings(dimension=2))
    for index, grasp in enumerate(data.grasps):
        left = grasp.contacts if fall is None or index < fall else grasp.contacts[:contacts_since]
        slam.add_grasp(replace(grasp, contacts=left, begins_anew=index == fall))
    return slam.finish()


def placed(result: SlamResult) -> list[bool]:
    return [pose is not None for pose in result.world_T_object]


def test_what_was_known_before_a_fall_stays_where_little_was_felt_since() -> None:
    whole, result = run(None), run(GRASPS - 1, contacts_since=1)
    assert placed(result) == [True] * (GRASPS - 1) + [False]
    assert len(result.covariances) == len(result.common_covariances) == len(result.steps) == GRASPS
    assert result.contour is not None
    assert whole.contour is not None
    assert result.known_share == pytest.approx(whole.known_share, abs=0.05)
    assert result.status == "partial"
    fell = next(doubt for doubt in result.doubts if doubt.name == "fell")
    assert fell.words == "the object fell over before grasp 8: the model is what was known of it until then"
    assert (fell.grasps, fell.grave) == ((GRASPS - 1,), False)


def test_what_is_better_known_since_a_fall_is_the_result() -> None:
    result = run(2)
    assert placed(result) == [False] * 2 + [True] * (GRASPS - 2)
    assert "fell" not in {doubt.name for doubt in result.doubts}
    assert np.isfinite([step.seconds for step in result.steps]).all()
