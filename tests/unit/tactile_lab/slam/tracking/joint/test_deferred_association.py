"""Grasps that most of their contacts speak against are placed once the object is known."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from drivers.core.contacts import Array
from tactile_lab.slam.tracking.contacts.contact_map import ContactMap
from tactile_lab.slam.tracking.contacts.motion import MotionNoise
from tactile_lab.slam.tracking.joint.deferred_association import associate_deferred, readmit_contacts
from tactile_lab.slam.tracking.joint.hypotheses import Hypothesis, HypothesisScorer
from tactile_lab.slam.tracking.joint.proposals import ProposalSettings
from tests.support.simulated_contacts import true_map

NOISE, SETTINGS = MotionNoise(), ProposalSettings()
JUDGE = HypothesisScorer(NOISE, SETTINGS.unexplained_cost)
LATE = 5
FAR_OFF_m = np.array([[0.012, -0.015], [-0.018, 0.010], [0.014, 0.016], [-0.015, -0.013], [0.020, 0.0]])


@pytest.fixture(scope="module")
def known() -> ContactMap:
    return true_map("pentagon", count=14).with_best_kernel()


def with_wrong_contacts(known: ContactMap, wrong: int) -> ContactMap:
    """One grasp's first contacts far off, the whole of it aside, and its pose where the motion would have led."""
    grasp = known.placed[LATE]
    contacts, off = grasp.contacts_world, np.zeros((len(grasp.contacts_world), 2))
    off[:wrong] = FAR_OFF_m[:wrong]
    normals = np.where(off != 0, contacts.normals[:, ::-1] * [1, -1], contacts.normals)
    spoilt = replace(contacts, points_m=contacts.points_m + off, normals=normals)
    row = known.space.compose(grasp.motion, known.placed[LATE - 1].pose)
    aside = replace(grasp, contacts_world=spoilt, pose=row).put_aside()
    return replace(known, placed=(*known.placed[:LATE], aside, *known.placed[LATE + 1 :]))


def placed(contact_map: ContactMap) -> Hypothesis:
    return associate_deferred(JUDGE.score(contact_map), NOISE, SETTINGS, None, JUDGE)


def gap_m(one: ContactMap, row: Array) -> float:
    return float(np.linalg.norm(one.rows[LATE, :2] - row[:2]))


def test_two_right_contacts_of_a_grasp_place_it_on_a_known_object(known: ContactMap) -> None:
    spoilt = with_wrong_contacts(known, len(known.placed[LATE].contacts_world) - 2)
    found = placed(spoilt).map
    assert gap_m(spoilt, known.rows[LATE]) > 0.010
    assert gap_m(found, known.rows[LATE]) < 0.005
    assert len(found.placed[LATE].kept) == 2


def test_contacts_that_fit_nowhere_leave_a_grasp_aside(known: ContactMap) -> None:
    spoilt = with_wrong_contacts(known, 0)
    seen = spoilt.placed[LATE].contacts_world
    inward = replace(spoilt.placed[LATE], contacts_world=replace(seen, normals=-seen.normals))
    found = placed(replace(spoilt, placed=(*spoilt.placed[:LATE], inward, *spoilt.placed[LATE + 1 :])))
    assert not found.map.placed[LATE].used


def test_a_grasp_that_fits_badly_is_placed_anew(known: ContactMap) -> None:
    spoilt = with_wrong_contacts(known, 1)
    grasps = list(spoilt.placed)
    grasps[LATE] = replace(grasps[LATE], left_out=frozenset({0, 1, 2}))
    found = placed(replace(spoilt, placed=tuple(grasps))).map
    assert found.placed[LATE].left_out == {0}
    assert gap_m(found, known.rows[LATE]) < 0.005


def test_a_side_that_was_left_out_as_a_whole_is_heard_again(known: ContactMap) -> None:
    normals = [known.contacts_of(index).normals for index in range(len(known.placed))]
    side = normals[0][0]
    grasps = [
        replace(grasp, left_out=frozenset(np.flatnonzero(seen @ side > 0.8).tolist()))
        for grasp, seen in zip(known.placed, normals, strict=True)
    ]
    without = replace(known, placed=tuple(grasps)).with_best_kernel()
    assert without.left_out_count > 5
    (found,) = readmit_contacts(JUDGE.score(without), JUDGE)
    assert found.map.left_out_count == 0
    assert found.cost < JUDGE.score(without).cost - 20
    assert np.median(np.linalg.norm(found.map.rows[:, :2] - known.rows[:, :2], axis=1)) < 0.004


def test_nothing_is_heard_where_all_contacts_are_used(known: ContactMap) -> None:
    assert readmit_contacts(JUDGE.score(known.with_all_contacts()), JUDGE) == []
