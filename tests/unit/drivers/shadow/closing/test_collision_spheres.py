"""The links above the fingertips along a closing: rigid rows of balls that end where the fingertips begin."""

from __future__ import annotations

import numpy as np
import pytest

from drivers.core.contacts import FINGERS
from drivers.shadow.closing.closing import closing
from drivers.shadow.closing.collision_spheres import link_balls
from drivers.shadow.closing.posture import NODES, HandShape, finger_joints
from drivers.shadow.model.kinematics import joint_vector, palm_T_distal

TIP = HandShape()
KINDS = pytest.mark.parametrize(("name", "height_m"), [("pinch", 0.018), ("radial", 0.034), ("aside", 0.026)])
DISTAL_END_m = np.array([0.0, 0.0, 0.005])
"""Of the distal link's own shape, where the fingertip's begins; distal frame."""


@KINDS
@pytest.mark.parametrize("node", [0, 7, NODES - 1])
def test_a_fingers_last_ball_is_at_its_fingertip(name: str, height_m: float, node: int) -> None:
    table, balls = closing(name, height_m, TIP), link_balls(name, height_m, TIP)
    for index, finger in enumerate(FINGERS):
        angles = dict(zip(finger_joints(finger), table.tables[finger][node].tolist(), strict=True))
        distal = table.grasp_T_palm * palm_T_distal(joint_vector(angles))[finger]
        last = np.flatnonzero(balls.fingers == index)[-1]
        assert balls.centres_m[node, last] == pytest.approx(distal.transformFrom(DISTAL_END_m), abs=1e-9)


@KINDS
def test_no_finger_has_a_gap_at_any_posture(name: str, height_m: float) -> None:
    balls = link_balls(name, height_m, TIP)
    for index in range(len(FINGERS)):
        own = balls.fingers == index
        gaps_m = np.linalg.norm(np.diff(balls.centres_m[:, own], axis=1), axis=2)
        radii_m = balls.radii_m[own]
        assert np.all(gaps_m < radii_m[1:] + radii_m[:-1] + 0.006)


@KINDS
def test_knuckles_stand_still_above_the_table_and_links_move(name: str, height_m: float) -> None:
    balls = link_balls(name, height_m, TIP)
    first = np.flatnonzero(balls.fingers == 0)
    assert balls.centres_m[:, first[0]] == pytest.approx(np.tile(balls.centres_m[0, first[0]], (NODES, 1)))
    assert np.ptp(balls.centres_m[:, first[-1], 0]) > 0.03
    assert np.all(balls.centres_m[..., 2] > balls.radii_m)


def test_a_ball_meets_only_on_the_way_of_its_finger() -> None:
    balls = link_balls("pinch", 0.018, TIP)
    distances_m = np.full((NODES, len(balls.radii_m)), 0.1)
    thumb = np.flatnonzero(balls.fingers == 4)[0]
    distances_m[9, thumb] = balls.radii_m[thumb] - 1e-4
    free = np.ones((NODES, 5), dtype=bool)
    free[9:, 4] = False
    assert not balls.collides(distances_m, free)  # it has stopped before
    free[9, 4] = True
    assert balls.collides(distances_m, free)
    assert not balls.collides(distances_m[::2], free[::2], slice(None, None, 2))  # not looked at


def test_an_open_hand_meets_with_fingers_that_are_not_free() -> None:
    balls = link_balls("pinch", 0.018, TIP)
    little = np.flatnonzero(balls.fingers == 3)[0]
    assert not balls.usable[0, 3]  # it opens less far than the others
    distances_m = np.full((NODES, len(balls.radii_m)), 0.1)
    distances_m[1, little] = 0.0
    assert balls.collides(distances_m, np.zeros((NODES, 5), dtype=bool))
