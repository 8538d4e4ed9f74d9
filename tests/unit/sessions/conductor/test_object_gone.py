"""Sentences for people about an object that is not where it should be: numbers, and what to change."""

from __future__ import annotations

import numpy as np
from gtsam import Pose2

from drivers.core.contacts import Contact, Grasp
from sessions.conductor.object_gone import blocked, lost, not_found
from sessions.motion.probing.bounding_box import BoundingBox


def grasp(index: int, *places_m: tuple[float, float, float]) -> Grasp:
    contacts = [
        Contact(
            finger="FF",
            point_world_m=np.array(place_m),
            normal_world=np.array([1.0, 0.0, 0.0]),
            point_covariance_m2=np.eye(3),
            normal_sigma_rad=0.1,
            force_N=0.4,
        )
        for place_m in places_m
    ]
    return Grasp(index=index, stamp_ns=0, contacts=tuple(contacts))


def test_an_empty_table_tells_where_and_how_low_was_searched() -> None:
    nothing = BoundingBox(Pose2(), np.zeros(2), np.zeros(2), 0.0, None, dict.fromkeys("lfrb", "why"), has_sides=False)
    said = not_found(nothing, np.array([0.1, -0.02]), 0.05, 0.012)
    assert "nothing was felt on the table at (100, -20) mm and 50 mm around, down to 12 mm" in said
    assert "conductor.plan.start_m" in said


def test_blocked_approaches_tell_how_wide_and_high_the_hand_landed() -> None:
    said = blocked(6, [np.array([-0.06, 0.0, 0.05]), np.array([0.06, 0.04, 0.07])])
    assert said.startswith("could not reach the table: 6 approaches were blocked; the hand landed over 120 x 40 mm")
    assert "up to 70 mm above the table, while the open hand spans 105 mm" in said


def test_approaches_that_were_blocked_by_nothing_known_only_count() -> None:
    assert blocked(6, []) == "could not reach the table: 6 approaches were blocked"


def test_a_lost_object_was_last_touched_somewhere() -> None:
    grasps = [grasp(0, (0.0, 0.0, 0.14)), grasp(1, (0.02, 0.0, 0.03), (0.04, 0.02, 0.05)), grasp(2)]
    said = lost("no contact in 1 grasps in a row", grasps)
    assert said.startswith(
        "no contact in 1 grasps in a row; grasp 2 last touched it, at (30, 10) mm, up to 140 mm high."
    )
    assert "steady it" in said


def test_an_object_that_was_never_touched_is_to_be_put_where_the_hand_closes() -> None:
    assert "nothing was touched" in lost("no contact in 3 grasps in a row", [grasp(0)])
