"""Two objects in one session: the grasps of one foretell nothing of the other."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from tactile_lab.slam.doubt.halves import Step, exchanged, loose
from tactile_lab.slam.tracking.contacts.contact_map import ContactMap
from tests.support.simulated_contacts import true_map


def kernel_of(contact_map: ContactMap) -> ContactMap:
    return contact_map.with_best_kernel(max_iterations=10, longest_m=0.3)


def one_after_the_other(beside_m: float) -> ContactMap:
    """Seven grasps of a rectangle, then seven of a triangle that is taken for a part of it, so far beside."""
    first, second = true_map("rectangle", 1, 7), true_map("triangle", 2, 7)
    moved = second.space.compose(second.rows, np.array([beside_m, 0.0, 0.0]))
    return kernel_of(replace(first, placed=(*first.placed, *second.with_rows(moved).placed)))


@pytest.mark.parametrize("shape", ["rectangle", "ellipse", "L"])
def test_grasps_of_one_object_foretell_each_other(shape: str) -> None:
    assert exchanged(kernel_of(true_map(shape, 31, 12))) == []


@pytest.mark.parametrize(
    ("beside_m", "words"), [(0.15, "nothing that was touched before was touched again"), (0.0, "do not fit each other")]
)
def test_another_object_is_told_with_its_first_grasp(beside_m: float, words: str) -> None:
    (told,) = exchanged(one_after_the_other(beside_m))
    assert (told.name, told.grasps, told.grave) == ("other-object", tuple(range(7, 14)), True)
    assert words in told.words
    assert "grasp 8" in told.words


def test_two_wrong_contacts_that_contradict_each_other_are_not_another_object() -> None:
    best = true_map("rectangle", 31, 12)
    for grasp, inwards_m in ((2, 0.02), (9, 0.02)):
        world = best.placed[grasp].contacts_world
        points = world.points_m.copy()
        points[0] -= inwards_m * world.normals[0] * (1 if grasp == 2 else -1)
        best = best.with_placed(grasp, replace(best.placed[grasp], contacts_world=replace(world, points_m=points)))
    assert exchanged(kernel_of(best)) == []


def test_a_trajectory_that_never_comes_back_is_told_to_hang_on_the_hands_motion() -> None:
    steps = [Step(4, 0.9, 0.8, 4), Step(6, 0.8, 0.2, 6), Step(9, 0.8, 0.1, 3)]
    (told,) = loose(steps)
    assert (told.name, told.grasps, told.grave) == ("loose-parts", (6,), True)
    assert "from grasp 7 on" in told.words
    assert loose(steps[::2]) == []


def test_too_few_grasps_on_one_side_tell_nothing() -> None:
    few = one_after_the_other(0.15)
    assert exchanged(replace(few, placed=few.placed[4:9])) == []
