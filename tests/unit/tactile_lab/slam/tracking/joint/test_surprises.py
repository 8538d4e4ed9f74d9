"""Touches of an object that was left in place, where nobody touched it before and the model expects something else."""

from __future__ import annotations

from dataclasses import replace
from typing import Any, TypeAlias

import numpy as np
import pytest
from gtsam import Pose3

from drivers.core.contacts import FINGERS, Grasp
from tactile_lab.experiments.data.sensing import measured_contact
from tactile_lab.slam.result import SlamStep
from tactile_lab.slam.slam_settings import SlamSettings
from tactile_lab.slam.tactile_slam import TactileSlam

Touch: TypeAlias = tuple[tuple[float, float, float], tuple[float, float, float]]
"""Where a fingertip touches, in millimetres, and the outward normal there."""

LEFT = {"translation_m": 0.007, "rotation_rad": 0.21, "unheld": 0.15}
SLOPE = (0.41, 0.0, 0.912)
AROUND: list[Touch] = [
    ((16, -4, 30), SLOPE),
    ((14, 9, 31), SLOPE),
    ((7, 30, 30), (0, 1, 0)),
    ((-30, 30, 36), (0, 1, 0)),
    ((-50, -11, 33), (-1, 0, 0)),
    ((-33, -30, 36), (0, -1, 0)),
    ((-2, -30, 34), (0, -1, 0)),
]
MIDDLE: list[Touch] = [((4, -5, 36), SLOPE), ((-6, -3, 40), SLOPE), ((2, -7, 37), SLOPE)]
TALL_END: list[Touch] = [((-39, 19, 55), SLOPE), ((-36, -22, 54), SLOPE)]
"""A wedge of 100 x 60 mm, 60 mm high at one end and 15 mm at the other."""


WALLS: list[Touch] = [
    *(((x, 30, z), (0, 1, 0)) for x, z in ((-40, 44), (-25, 38), (-10, 30), (5, 24), (20, 15))),
    *(((x, -30, z), (0, -1, 0)) for x, z in ((-40, 44), (-25, 38), (-10, 30), (5, 24), (20, 15))),
    *(((-50, y, 48), (-1, 0, 0)) for y in (-20, 0, 20)),
]
NEAR_THE_EDGE: list[Touch] = [((-30, 22, 51), SLOPE), ((-26, 25, 49.2), SLOPE)]


def touched(places: list[Touch], index: int, rng: np.random.Generator) -> Grasp:
    """A grasp of noisy contacts of the wedge where it stands."""
    contacts = tuple(
        measured_contact(FINGERS[i % 5], np.array(point) / 1e3, np.array(normal), Pose3(), rng)
        for i, (point, normal) in enumerate(places)
    )
    return Grasp(index, index * 10**9, contacts)


def then_touched(places: list[Touch], seed: int, motion: dict[str, float], **joint: Any) -> SlamStep:
    """What becomes of a second touch of the wedge, after one of its sides and of the middle of its slope."""
    rng = np.random.default_rng(seed)
    given = {"method": "joint", "dimension": 3, "motion": motion, "joint": joint}
    slam = TactileSlam(SlamSettings.model_validate(given), seed)
    slam.add_grasp(touched(AROUND + MIDDLE, 0, rng))
    return slam.add_grasp(touched(places, 1, rng))


@pytest.mark.parametrize("seed", [1, 4, 6])
def test_a_touch_that_nobody_expected_is_kept_if_the_object_was_left_in_place(seed: int) -> None:
    """The model rounds the wedge off where nobody touched it, a centimetre below the true slope."""
    step = then_touched(TALL_END, seed, LEFT)
    assert (step.verdict, step.contacts_used) == ("tracked", len(TALL_END)), step.reason


def test_without_asking_the_kernel_again_such_a_touch_is_put_aside() -> None:
    assert then_touched(TALL_END, 4, LEFT, without=["surprises"]).contacts_used < len(TALL_END)


def test_a_touch_that_no_kernel_explains_is_left_out_all_the_same() -> None:
    """A contact deep inside of the wedge, below others on its slope and far from all of them."""
    wrong: Touch = ((0, 0, 8), SLOPE)
    assert then_touched([*MIDDLE, wrong], 1, LEFT).contacts_used == len(MIDDLE)


@pytest.mark.parametrize("seed", [1, 3])
def test_fingers_that_only_touched_are_believed_beside_an_edge_too(seed: int) -> None:
    """The slope 11 mm from contacts on a wall: the field rounds the edge and is sure of it."""
    used = []
    for probed in (False, True):
        rng = np.random.default_rng(seed)
        slam = TactileSlam(SlamSettings.model_validate({"method": "joint", "dimension": 3, "motion": LEFT}), seed)
        slam.add_grasp(touched(WALLS, 0, rng))
        tap = touched(NEAR_THE_EDGE, 1, rng)
        step = slam.add_grasp(replace(tap, contacts=tuple(replace(each, probed=probed) for each in tap.contacts)))
        used.append(step.contacts_used)
    assert used == [0, len(NEAR_THE_EDGE)]
