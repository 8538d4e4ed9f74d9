"""What a set of grasps says about its own conventions."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from drivers.core.contact_checks import OpposingPairs, opposing_pairs, touched_one_side
from drivers.core.contacts import Grasp
from tactile_lab.experiments.data import planar_data, spatial_data


def turned_in(grasp: Grasp) -> Grasp:
    return replace(grasp, contacts=tuple(replace(one, normal_world=-one.normal_world) for one in grasp.contacts))


@pytest.mark.parametrize("shape", ["rectangle", "triangle", "ellipse", "L", "hexagon"])
def test_normals_are_found_to_point_in_or_out(shape: str) -> None:
    grasps = planar_data.simulate(shape, 2, count=8).grasps
    outward, inward = opposing_pairs(grasps), opposing_pairs([turned_in(grasp) for grasp in grasps])
    assert outward.pairs == inward.pairs >= 8
    assert not outward.point_in
    assert inward.point_in


def test_normals_of_a_solid_are_found_to_point_in_or_out() -> None:
    grasps = spatial_data.simulate("box-12x6x6", 1, count=6).grasps
    assert not opposing_pairs(grasps).point_in
    assert opposing_pairs([turned_in(grasp) for grasp in grasps]).point_in


def test_too_few_pairs_say_nothing() -> None:
    assert not OpposingPairs(2, 2).point_in
    assert not opposing_pairs([]).point_in
    first = planar_data.simulate("rectangle", 2, count=1).grasps[0]
    assert opposing_pairs([replace(first, contacts=first.contacts[:1])]).pairs == 0


def test_one_side_is_one_side_in_every_grasp() -> None:
    up, aside = np.array([0.0, 1.0, 0.0]), np.array([1.0, 0.0, 0.0])
    assert touched_one_side([np.array([up, 0.9 * up + 0.4 * aside]), np.zeros((0, 3)), aside[None]])
    assert not touched_one_side([np.array([up, up]), np.array([up, -up])])
    assert not touched_one_side([np.array([up, aside, -aside])])
    assert not touched_one_side([])
    assert not touched_one_side([np.zeros((0, 3))])
