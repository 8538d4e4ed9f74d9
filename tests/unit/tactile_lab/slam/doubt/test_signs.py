"""Signs that a trajectory is wrong, each on a trajectory that is known to be right but for one thing."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from tactile_lab.slam.doubt.signs import signs
from tactile_lab.slam.doubt.status import Doubt, status_of
from tactile_lab.slam.tracking.contacts.contact_map import ContactMap, Moved
from tactile_lab.slam.tracking.contacts.motion import MotionNoise
from tactile_lab.slam.tracking.evidence.motion_cost import MotionCost
from tests.support.simulated_contacts import true_map

NOISE = MotionNoise()


@pytest.fixture(scope="module")
def true() -> ContactMap:
    return true_map("rectangle", seed=4)


def names(contact_map: ContactMap, **given: bool) -> set[str]:
    return {doubt.name for doubt in signs(contact_map, NOISE, **given)}


def turned(contact_map: ContactMap, grasps: slice, by: tuple[float, float, float]) -> ContactMap:
    rows = contact_map.rows
    rows[grasps] = contact_map.space.compose(rows[grasps], np.array(by))
    return contact_map.with_rows(rows)


def leaving_out(contact_map: ContactMap, grasps: range, contacts: int) -> ContactMap:
    for index in grasps:
        worse = replace(contact_map.placed[index], left_out=frozenset(range(contacts)))
        contact_map = contact_map.with_placed(index, worse)
    return contact_map


def test_true_trajectories_have_no_signs() -> None:
    found = [names(true_map(shape, seed)) for shape in ("rectangle", "L") for seed in range(10, 20)]
    assert sum(map(bool, found)) <= 1


def test_a_grasp_turned_the_wrong_way_round_needs_two_slips_that_undo_each_other(true: ContactMap) -> None:
    found = signs(turned(true, slice(6, 7), (0.0, 0.0, 1.5)), NOISE)
    undone = [doubt for doubt in found if doubt.name == "undone-slips"]
    assert [doubt.grasps for doubt in undone] == [(6,)]
    assert "grasp 7" in undone[0].words
    assert undone[0].grave


def test_slips_that_undo_each_other_are_no_proof_against_contacts_that_confirm_the_grasp(true: ContactMap) -> None:
    """Each of them has a probability of about one in a hundred: heavy tails have such pairs too."""
    before, after = MotionCost.of(true, NOISE).scaled_slips(true.rows)[7:9, 2]
    turn_rad = NOISE.rotation_rad * (2.9 - (before - after) / 2)
    other = turned(true, slice(8, 9), (0.0, 0.0, float(turn_rad)))
    fewer = other.without_contact(8, 0).without_contact(8, 1)
    found = [[doubt.grave for doubt in signs(each, NOISE) if doubt.name == "undone-slips"] for each in (other, fewer)]
    assert found == [[False], [True]]


def test_a_slip_beyond_the_motion_model_is_told_once(true: ContactMap) -> None:
    found = signs(turned(true, slice(6, None), (0.06, 0.0, 0.0)), NOISE)
    assert [(doubt.name, doubt.grasps, doubt.grave) for doubt in found] == [("unlikely-slip", (6,), True)]


def test_many_large_slips_are_told_together_and_one_is_not() -> None:
    best = true_map("rectangle", seed=4, count=16)
    drifting = best
    for grasp in range(2, 16, 2):
        drifting = turned(drifting, slice(grasp, None), (0.016, 0.0, 0.45 if grasp % 4 else -0.45))
    (found,) = [doubt for doubt in signs(drifting, NOISE) if doubt.name == "large-slips"]
    assert found.grave
    assert "the setting motion is too small" in found.words
    assert "large-slips" not in names(turned(best, slice(6, None), (0.05, 0.0, 0.5)))


def test_a_jump_of_ten_centimetres_is_told(true: ContactMap) -> None:
    assert names(turned(true, slice(6, None), (0.12, 0.0, 0.0))) >= {"unlikely-slip", "jump"}
    assert names(turned(true, slice(6, None), (0.12, 0.0, 0.0)), poses_given=True) == set()


def test_a_step_in_which_the_object_did_not_follow_the_hand_is_a_jump_however_short(true: ContactMap) -> None:
    freely = true.with_placed(6, replace(true.placed[6], moved=Moved.FREELY))
    (found,) = signs(freely, NOISE)
    assert (found.name, found.grasps, found.grave) == ("jump", (6,), True)


def test_a_short_jump_between_grasps_that_confirm_their_places_is_only_told(true: ContactMap) -> None:
    freely = true.with_placed(4, replace(true.placed[4], moved=Moved.FREELY))
    far = turned(freely, slice(4, None), (0.12, 0.0, 0.0))
    for moved, grave in ((freely, False), (leaving_out(freely, range(4, 5), 2), True), (far, True)):
        (found,) = [doubt for doubt in signs(moved, NOISE) if doubt.name == "jump"]
        assert (found.grasps, found.grave) == ((4,), grave)


def test_contacts_that_fit_up_to_some_grasp_only_are_of_another_object(true: ContactMap) -> None:
    (found,) = signs(leaving_out(true, range(7, 12), 3), NOISE)
    assert (found.name, found.grasps) == ("other-object", (7, 8, 9, 10, 11))
    assert names(leaving_out(true, range(1, 12, 3), 2)) == set()


def test_more_contacts_that_fit_nothing_than_sensors_get_wrong_are_told(true: ContactMap) -> None:
    (found,) = [doubt for doubt in signs(leaving_out(true, range(1, 12, 2), 2), NOISE) if doubt.name != "first-grasp"]
    assert (found.name, found.grave) == ("stray-contacts", True)
    assert "12 of 56 contacts" in found.words
    assert names(leaving_out(true, range(1, 12, 2), 1)) == set()


def test_an_unlikely_slip_between_grasps_that_confirm_their_places_is_only_told(true: ContactMap) -> None:
    slipped = turned(true, slice(4, None), (0.04, 0.0, 0.0))
    (slip,) = signs(slipped, NOISE)
    (unconfirmed,) = signs(leaving_out(slipped, range(4, 5), 2), NOISE)
    assert (slip.name, slip.grave) == ("unlikely-slip", False)
    assert (unconfirmed.name, unconfirmed.grave) == ("unlikely-slip", True)


def test_wrong_contacts_of_the_first_grasp_are_told_and_three_are_grave(true: ContactMap) -> None:
    for wrong in (1, 2, 3):
        (found,) = signs(leaving_out(true, range(1), wrong), NOISE)
        assert (found.name, found.grave) == ("first-grasp", wrong == 3)


@pytest.mark.parametrize(
    ("share", "doubt", "status"),
    [
        (0.95, None, "complete"),
        (0.95, Doubt("symmetry", "the object is round", grave=False), "complete"),
        (0.62, None, "partial"),
        (None, None, "partial"),
        (0.95, Doubt("refused-grasps", "4 of 8 grasps could not be placed", grave=False), "partial"),
        (0.95, Doubt("few-grasps", "only 1 grasp could be placed", grave=False), "partial"),
        (0.62, Doubt("jump", "the object jumps"), "ambiguous"),
    ],
)
def test_the_worst_status_that_applies(share: float | None, doubt: Doubt | None, status: str) -> None:
    doubts = [] if doubt is None else [doubt]
    assert status_of(lost=False, known_share=share, doubts=doubts) == status
    assert status_of(lost=True, known_share=share, doubts=doubts) == "lost"
