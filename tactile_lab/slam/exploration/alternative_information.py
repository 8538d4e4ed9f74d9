"""The expected information of a grasp about which of several trajectories is right.

An estimate may have alternatives: other placings of some grasps, and so another shape or another present pose. A grasp
that fingers would end differently under an alternative tells which is right, one with the same contacts under both does
not. The information about a question with two answers is at most its entropy H(p); how much of it a grasp gives is
taken from the Bhattacharyya coefficient of its contacts under both answers: 1 - exp(-D), where a contact displaced by
d adds d^2 / (8 s^2) to D, and a finger that meets something under one of them only as much as an unexplained contact.

The answer affects every contact that the alternative places elsewhere: each of them is informative about the
shape only where it belongs.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from gtsam import Pose2

from drivers.core.contacts import Array
from tactile_lab.slam.exploration.candidates import Candidate
from tactile_lab.slam.exploration.policy import Belief, RivalObject, Surface
from tactile_lab.slam.exploration.prediction import ExpectedTouches, expected_touches, most_fingers, nominal_world

_MOST_PER_FINGER = 3.0
"""Of D: a contact that is explained by nothing, or is missing, may be a wrong one."""

CONTACT_nats = 1.0
"""What a contact in its right place tells about the shape, in the order of what the information policy promises."""


def told_apart(
    candidates: Sequence[Candidate], belief: Belief, surface: Surface, point_sigma_m: float, finger_m: float
) -> Array:
    """The worth of each candidate's answer to which trajectory is right, nats, shape (c,).

    Args:
        candidates: all with a chance.
        belief: with its rivals.
        surface: the estimated one.
        point_sigma_m: of a contact's measurement.
        finger_m: standard deviation of a finger's path.
    """
    worth = np.zeros(len(candidates))
    if not belief.rivals:
        return worth
    expected = _touches(candidates, belief, surface)
    variance_m2 = point_sigma_m**2 + finger_m**2 + float(np.trace(belief.pose_covariance[:2, :2])) / 2
    for rival in belief.rivals:
        theirs = replace(belief, world_T_object=rival.world_T_object)
        other = _touches(candidates, theirs, rival.surface)
        apart_m = _in_world(expected, belief.world_T_object) - _in_world(other, rival.world_T_object)
        away_m = np.linalg.norm(apart_m, axis=2)
        both, one = expected.touching[:, 0] & other.touching[:, 0], expected.touching[:, 0] ^ other.touching[:, 0]
        each = np.where(both, np.minimum(np.nan_to_num(away_m) ** 2 / (8 * variance_m2), _MOST_PER_FINGER), 0.0)
        answered = 1 - np.exp(-np.sum(np.where(one, _MOST_PER_FINGER, each), axis=1))
        worth += CONTACT_nats * rival.displaced * _share_open(rival) * answered
    return worth


def _touches(candidates: Sequence[Candidate], belief: Belief, surface: Surface) -> ExpectedTouches:
    return expected_touches(candidates, belief, nominal_world(belief, surface, most_fingers(candidates)))


def _in_world(touches: ExpectedTouches, world_T_object: Pose2) -> Array:
    """The touched places seen from above, world frame, shape (c, fingers, 2); NaN for none."""
    turn = world_T_object.rotation().matrix()
    places = touches.points_m[:, 0, :, :2] @ turn.T + world_T_object.translation()
    return np.asarray(places)


def _share_open(rival: RivalObject) -> float:
    """Entropy of whether an alternative is right, as a share of the most that it can be."""
    p = float(np.clip(rival.probability, 1e-9, 1 - 1e-9))
    return float(-(p * np.log(p) + (1 - p) * np.log1p(-p)) / np.log(2.0))
