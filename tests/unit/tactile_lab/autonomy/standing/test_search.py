"""What has become of an object that was looked for."""

from __future__ import annotations

import numpy as np
import pytest
from gtsam import Pose2

from sessions.conductor.estimator import Change
from sessions.motion.probing.bounding_box import SIDES, BoundingBox
from tactile_lab.autonomy.standing.felt_object import FeltObject
from tactile_lab.autonomy.standing.search import Whereabouts

RIM_m, TOP_m = 0.05, 0.052


def bowl() -> FeltObject:
    """Touched on its outer wall, its rim, and low down on its inside."""
    angles = np.linspace(0.0, 2 * np.pi, 8, endpoint=False)
    out = np.column_stack([np.cos(angles), np.sin(angles), np.zeros(8)])
    up = np.array([0.0, 0.0, 1.0])
    points_m = np.vstack([RIM_m * out + 0.03 * up, (RIM_m - 0.002) * out + TOP_m * up, 0.04 * out + 0.038 * up])
    return FeltObject.around(np.zeros(2), TOP_m, points_m, np.vstack([out, np.tile(up, (8, 1)), -out]))


def met(place_m: tuple[float, float], top_m: float, *, has_sides: bool = False) -> BoundingBox:
    reach_m, missing = np.full(2, 0.03), {} if has_sides else dict.fromkeys(SIDES, "left to the grasps")
    return BoundingBox(Pose2(*place_m, 0.0), -reach_m, reach_m, 0.008, top_m, missing, has_sides)


@pytest.mark.parametrize(
    ("box", "change"),
    [
        (met((RIM_m, 0.0), TOP_m - 0.004), Change.STANDS),
        (met((0.041, 0.003), 0.040), Change.STANDS),
        (met((0.0, 0.10), 0.030), Change.FELL),
        (met((0.0, 0.0), 0.030, has_sides=True), Change.FELL),
        (met((0.03, 0.0), TOP_m, has_sides=True), Change.MOVED),
        (met((0.002, 0.0), TOP_m, has_sides=True), Change.STANDS),
    ],
    ids=["on its rim", "on its inside", "beside it", "lower all over", "aside", "as before"],
)
def test_what_was_touched_before_stands_where_it_stood(box: BoundingBox, change: Change) -> None:
    assert Whereabouts(bowl()).judge(box) is change
