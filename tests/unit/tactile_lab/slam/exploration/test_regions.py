"""Variance and entropy of the field, IGEF, ways along the surface, and regions of what is not known."""

from __future__ import annotations

import numpy as np
import pytest

from tactile_lab.slam.exploration.information.igef import IgefSettings, igef, nearest_vertices, path_lengths
from tactile_lab.slam.exploration.information.surface_uncertainty import (
    contact_entropy,
    log_determinant,
)
from tactile_lab.slam.exploration.policy import Surface
from tactile_lab.slam.exploration.regions import (
    WEIGHTINGS,
    RegionSettings,
    dissimilarity,
    nearest_first,
    organise,
    unexplored_regions,
)
from tactile_lab.slam.shape.fields.gpis import Gpis
from tactile_lab.slam.shape.surfaces.surface import Contour, SurfaceMesh
from tests.support.rectangle_world import belief_of, belief_of_right_end_unknown, contacts_every


def circle(count: int = 120, sigma_m: float = 0.001) -> Surface:
    angles = np.linspace(0, 2 * np.pi, count, endpoint=False)
    return Surface.of(Contour(0.03 * np.column_stack([np.cos(angles), np.sin(angles)]), np.full(count, sigma_m), True))


def plate() -> Surface:
    """A flat square of 40 mm in space, two triangles a cell."""
    ticks = np.linspace(-0.02, 0.02, 9)
    x, y = np.meshgrid(ticks, ticks, indexing="ij")
    points = np.column_stack([x.ravel(), y.ravel(), np.zeros(81)])
    corner = (np.arange(8)[:, None] * 9 + np.arange(8)).ravel()
    faces = np.vstack(
        [np.column_stack([corner, corner + 9, corner + 1]), np.column_stack([corner + 1, corner + 9, corner + 10])]
    )
    return Surface.of(SurfaceMesh(points, faces, np.full(81, 0.01), np.tile([0.0, 0.0, 1.0], (81, 1)), False))


def test_a_contours_normals_point_outwards_and_its_sizes_make_its_length() -> None:
    surface = circle()
    assert surface.normals == pytest.approx(surface.points_m / 0.03, abs=1e-9)
    assert surface.sizes.sum() == pytest.approx(2 * np.pi * 0.03, rel=1e-3)
    assert plate().sizes.sum() == pytest.approx(0.04**2)


def test_joint_covariance_has_the_variances_on_its_diagonal_and_shrinks_to_the_touched() -> None:
    field = belief_of_right_end_unknown().field
    assert isinstance(field, Gpis)
    points = np.array([[0.045, 0.03], [0.046, 0.03], [-0.02, 0.03]])
    joint = field.joint_covariance(points)
    assert np.diag(joint) == pytest.approx(field.variance(points))
    assert joint[0, 1] / np.sqrt(joint[0, 0] * joint[1, 1]) > 0.9
    assert abs(joint[0, 2]) < 0.2 * np.sqrt(joint[0, 0] * joint[2, 2]) + 1e-9


def test_joint_covariance_of_a_field_that_grew_is_that_of_a_fresh_one() -> None:
    points, normals = contacts_every(0.02)
    fresh = Gpis.fit(points, normals)
    grown = Gpis.fit(points[:8], normals[:8]).extend(points[8:], normals[8:])
    queries = np.array([[0.0, 0.04], [0.05, 0.0]])
    same = Gpis(fresh.contacts_m, fresh.normals, fresh.settings, fresh.observations, grown.kernel, grown.prior)
    assert grown.joint_covariance(queries) == pytest.approx(same.joint_covariance(queries), rel=1e-6, abs=1e-12)


def test_the_entropy_of_independent_contacts_is_the_sum_of_theirs() -> None:
    covariance = np.diag([1e-6, 4e-6])
    single = [contact_entropy(covariance[i : i + 1, i : i + 1]) for i in (0, 1)]
    assert contact_entropy(covariance) == pytest.approx(sum(single), abs=1e-6)
    assert log_determinant(np.ones((3, 3))) < -20.0


def test_contacts_side_by_side_have_less_entropy_than_apart() -> None:
    field = belief_of_right_end_unknown().field
    assert isinstance(field, Gpis)
    together = field.joint_covariance(np.array([[0.04, 0.03], [0.041, 0.03]]))
    apart = field.joint_covariance(np.array([[0.04, 0.03], [0.04, -0.03]]))
    assert contact_entropy(together) < contact_entropy(apart)
    assert contact_entropy(np.empty((0, 0))) == 0.0


def test_ways_go_along_the_surface_and_not_through_it() -> None:
    surface = circle()
    start, goal = nearest_vertices(surface, np.array([[0.03, 0.0], [-0.03, 0.0]]))
    assert path_lengths(surface, np.array([start]))[0, goal] == pytest.approx(np.pi * 0.03, rel=1e-3)
    assert path_lengths(plate(), np.array([0]))[0].max() <= 0.08 + 1e-9


def test_igef_has_the_printed_values() -> None:
    surface, settings = circle(), IgefSettings(far_m=0.01, beside_m=0.02, beside_sigma_m=0.01, turn_sigma=0.5)
    contact, normal = np.array([[0.03, 0.0]]), np.array([[1.0, 0.0]])
    targets = np.array([[0.03, 0.0], [0.0, 0.03], [-0.03, 0.0]])
    found = igef(surface, contact, normal, targets, settings)
    apart = np.array([0.0, 0.03 * np.sqrt(2), 0.06])
    assert found.novelty == pytest.approx(1 - np.exp(-((apart / 0.01) ** 2)))
    assert found.nearness[1:] == pytest.approx(1 / (np.array([0.5, 1.0]) * np.pi * 0.03), rel=1e-3)
    assert found.continuity == pytest.approx(np.exp(-(((apart - 0.02) / 0.01) ** 2)))
    assert found.alignment == pytest.approx(np.exp(-2 * np.sin(np.array([0.0, 0.25, 0.5]) * np.pi) ** 2 / 0.25))
    assert found.product == pytest.approx(found.novelty * found.nearness * found.continuity * found.alignment)
    assert found.product[0] == 0.0


def test_both_weightings_are_the_printed_ones() -> None:
    assert WEIGHTINGS == {"text": (0.5, 0.4, 0.1), "appendix": (0.55, 0.3, 0.15)}
    points = np.array([[0.0, 0.0, 0.0], [0.03, 0.0, 0.04]])
    normals = np.array([[1.0, 0.0, 0.0], [0.0, 1.0, 0.0]])
    settings = RegionSettings(weighting="appendix", scale_m=0.05)
    assert dissimilarity(points, normals, settings) == pytest.approx([0.55 * 1.0 + 0.3 * 1.0 + 0.15 * 0.8])


def test_the_unknown_end_is_the_only_region_and_a_known_contour_has_none() -> None:
    belief = belief_of_right_end_unknown()
    assert belief.surface is not None
    regions = unexplored_regions(belief.surface, RegionSettings(unknown_sigma_m=0.002))
    assert regions
    assert all(belief.surface.points_m[region.members, 0].min() > 0.015 for region in regions)
    assert sum(region.size for region in regions) == np.sum(belief.surface.sigma_m > 0.002)
    everything = belief_of(*contacts_every(0.006)).surface
    assert everything is not None
    assert unexplored_regions(everything, RegionSettings(unknown_sigma_m=0.01)) == ()


def test_opposite_sides_of_a_wall_are_different_regions() -> None:
    points = np.vstack([plate().points_m, plate().points_m - [0.0, 0.0, 0.004]])
    normals = np.vstack([plate().normals, -plate().normals])
    wall = Surface(points, normals, np.full(162, 0.01), np.vstack([plate().cells, plate().cells + 81]))
    for region in unexplored_regions(wall, RegionSettings(cut=10.0, parts=2, reach_m=0.02)):
        assert len(np.unique(normals[region.members, 2])) == 1


def test_a_long_strip_is_divided_and_what_one_grasp_reaches_is_not() -> None:
    ticks = np.linspace(0.0, 0.2, 101)
    edges = np.column_stack([np.arange(100), np.arange(1, 101)])
    upwards = np.tile([0.0, 1.0], (101, 1))
    strip = Surface(np.column_stack([ticks, np.zeros(101)]), upwards, np.full(101, 0.01), edges)
    divided = unexplored_regions(strip, RegionSettings(cut=10.0, reach_m=0.06))
    whole = unexplored_regions(strip, RegionSettings(cut=10.0, reach_m=0.3))
    assert len(whole) == 1
    assert len(divided) >= 3
    assert sum(region.size for region in divided) == 101


def test_crumbs_join_the_nearest_large_region() -> None:
    points = np.concatenate([np.linspace(0.0, 0.1, 50), np.linspace(0.2, 0.3, 50), [0.19]])[:, None] * [1.0, 0.0]
    clusters = [np.arange(50), np.arange(50, 100), np.array([100])]
    found = organise(points, clusters, RegionSettings())
    assert sorted(map(len, found)) == [50, 51]
    assert 100 in next(members for members in found if 60 in members)


def test_the_nearest_region_comes_first() -> None:
    belief = belief_of_right_end_unknown()
    assert belief.surface is not None
    regions = unexplored_regions(belief.surface, RegionSettings(unknown_sigma_m=0.002, cut=0.2))
    ordered = nearest_first(regions, np.array([0.05, 0.03]))
    distances = [np.linalg.norm(region.centre_m - [0.05, 0.03]) for region in ordered]
    assert distances == sorted(distances)
