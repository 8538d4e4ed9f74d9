"""Poses and straight and round sides smoothed together."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from drivers.core.contacts import Contact
from tactile_lab.experiments.data import planar_data, second_family, spatial_data
from tactile_lab.slam.shape.fields.settings import GpisSettings
from tactile_lab.slam.shape.planar.rounded_outline import RoundedOutline
from tactile_lab.slam.shape.selection.planar_choice import best_shape
from tactile_lab.slam.shape.solids.prism import Prism
from tactile_lab.slam.tracking.contacts.contact_map import ContactMap
from tactile_lab.slam.tracking.contacts.motion import MotionNoise
from tactile_lab.slam.tracking.evidence.motion_cost import MotionCost
from tactile_lab.slam.tracking.faces.facet_certainty import FacetCertainty
from tactile_lab.slam.tracking.faces.side_certainty import SideCertainty
from tactile_lab.slam.tracking.faces.side_smoothing import SideSmoother, rounded_outline, smoothed_with_sides
from tactile_lab.slam.tracking.joint.pose_covariance import PoseCovariances
from tactile_lab.slam.tracking.joint.pose_uncertainty import propagate_pose_uncertainty
from tests.support.shape_examples import half_disc
from tests.support.simulated_contacts import placed_truly, true_map

NOISE = MotionNoise()


def half_discs(count: int, settings: GpisSettings | None = None) -> ContactMap:
    return placed_truly(planar_data.simulate_outline("half disc", half_disc(), 3, 1.0, count), 2, settings)


def shaken(contact_map: ContactMap) -> ContactMap:
    shake = np.random.default_rng(0).normal(size=contact_map.rows.shape) * [0.002, 0.002, 0.03]
    shake[0] = 0.0
    return contact_map.with_rows(np.asarray(contact_map.rows + shake))


def on_top(contact: Contact) -> Contact:
    return replace(contact, normal_world=np.array([0.0, 0.0, 1.0]))


def value(contact_map: ContactMap) -> float:
    return rounded_outline(contact_map).log_evidence - MotionCost.of(contact_map, NOISE).value(contact_map.rows)


def test_shaken_poses_settle_on_the_sides() -> None:
    contact_map = shaken(half_discs(12))
    found = smoothed_with_sides(contact_map, NOISE)
    assert found is not None
    assert value(found) > value(contact_map) + 5
    assert np.array_equal(found.rows[0], contact_map.rows[0])
    outline = rounded_outline(found)
    assert any(side.is_round and side.radius_m == pytest.approx(0.035, abs=0.003) for side in outline.sides)


def test_outlines_without_a_round_side_are_left_to_the_faces() -> None:
    assert smoothed_with_sides(true_map("rectangle"), NOISE) is None
    assert smoothed_with_sides(half_discs(12, GpisSettings(without=frozenset({"round sides"}))), NOISE) is None


def test_the_derivatives_are_those_of_the_residuals() -> None:
    contact_map = shaken(half_discs(5))
    outline = rounded_outline(contact_map)
    smoother = SideSmoother(contact_map, NOISE, outline)
    at = smoother.start
    jacobian, step = smoother.jacobian(at), 1e-7
    for unknown in range(jacobian.shape[1]):
        change = np.zeros(jacobian.shape[1])
        change[unknown] = step
        moved = smoother.moved(at, change)
        numeric = (smoother.residuals(moved) - smoother.residuals(at)) / step
        assert np.allclose(jacobian[:, unknown], numeric, rtol=1e-4, atol=1e-4 * np.abs(numeric).max())


def test_a_grasp_that_touches_the_round_side_alone_may_be_turned_about_its_centre() -> None:
    contact_map = half_discs(14)
    outline = rounded_outline(contact_map)
    certainty = SideCertainty.of(contact_map, NOISE)
    turns_rad = np.sqrt(np.diag(np.linalg.inv(certainty.information_of_poses)))[2::3]
    is_round = [side.is_round for side in outline.sides]
    owner = np.empty(len(contact_map.contacts), dtype=int)
    for index, side in enumerate(outline.sides):
        owner[side.members] = index
    touched = [owner[contact_map.grasp_indices == grasp] for grasp in range(1, 14)]
    alone = np.array([all(is_round[side] for side in sides) for sides in touched])
    assert alone.any()
    assert (~alone).any()
    assert turns_rad[alone].min() > 2 * np.median(turns_rad[~alone])


def test_round_walls_are_smoothed_as_such_in_space_too() -> None:
    true = placed_truly(second_family.simulate("half-cylinder", 4, dimension=3, count=12), 3)
    start = shaken(true)
    found = smoothed_with_sides(start, NOISE)
    assert found is not None
    assert found.dimension == 3
    off_m = [np.linalg.norm(each.rows[1:, :2] - true.rows[1:, :2], axis=1) for each in (found, start)]
    assert np.median(off_m[0]) < 0.7 * np.median(off_m[1])
    assert smoothed_with_sides(placed_truly(spatial_data.simulate("box-12x6x6", 0, count=8), 3), NOISE) is None


def test_an_object_that_was_touched_on_its_top_alone_has_no_sides() -> None:
    flat = spatial_data.simulate("box-12x6x6", 0, count=3)
    up = [replace(grasp, contacts=tuple(map(on_top, grasp.contacts))) for grasp in flat.grasps]
    assert smoothed_with_sides(placed_truly(replace(flat, grasps=up), 3), NOISE) is None


def test_a_grasp_on_a_round_wall_alone_may_be_turned_about_its_axis() -> None:
    """Flat faces would hold it: they stand in for the wall, and each has one normal."""
    true = placed_truly(second_family.simulate("half-cylinder", 4, dimension=3, count=12), 3)
    turns_rad = np.sqrt(PoseCovariances.of(true, NOISE).birth[1:, 2, 2])
    flat = FacetCertainty.of(true, NOISE)
    of_flat_rad = np.sqrt(np.diag(np.linalg.inv(flat.information_of_poses))[2::3])
    assert turns_rad.max() > 1.3 * of_flat_rad.max()


def test_a_prism_over_a_half_disc_states_what_poses_and_sides_leave_open() -> None:
    data = second_family.simulate("half-cylinder", 4, dimension=3, count=12)
    contact_map = placed_truly(data, 3)
    fewer = contact_map.without_contact(0, 0)  # a shape may leave out contacts that fit nothing
    shape = best_shape(fewer.fit(), floor_m=0.0)
    assert isinstance(shape, Prism)
    assert isinstance(shape.outline, RoundedOutline)
    mesh = shape.mesh(0.006, 0.0)
    stated = propagate_pose_uncertainty(mesh, shape, contact_map, NOISE)
    assert np.isfinite(stated.sigma_m).all()
    assert np.median(stated.sigma_m) > 0
