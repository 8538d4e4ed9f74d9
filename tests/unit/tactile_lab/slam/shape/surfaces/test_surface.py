"""Contours and meshes: on the zero level, closed, turned outward, the right body, with stated errors."""

from __future__ import annotations

import numpy as np
import pytest
import trimesh

from drivers.core.contacts import Array
from drivers.core.errors import ShapeError
from tactile_lab.slam.shape.fields.gpis import Gpis
from tactile_lab.slam.shape.fields.settings import GpisSettings
from tactile_lab.slam.shape.metrics.metrics import contour_errors, mesh_errors
from tactile_lab.slam.shape.surfaces.sampling import distances_to_polygon, polygon_area
from tactile_lab.slam.shape.surfaces.surface import Contour, SurfaceMesh, extract_contour, extract_mesh
from tests.support.shape_examples import (
    contacts_on_box,
    contacts_on_polygon,
    contacts_on_sphere,
    ellipse,
    l_block,
    noisy,
    rectangle,
    triangle,
)

THESIS = GpisSettings(observations="offsurface", kernel="thin_plate", prior_mean="zero")


def as_trimesh(mesh: SurfaceMesh) -> trimesh.Trimesh:
    return trimesh.Trimesh(mesh.vertices, mesh.faces, process=False)


def reconstruct(outline: Array, count: int, seed: int, settings: GpisSettings | None = None) -> Contour:
    points, normals = contacts_on_polygon(outline, count, seed)
    return extract_contour(Gpis.fit(points, normals, settings=settings).optimise())


def test_circle_from_exact_contacts_is_found_to_a_tenth_of_a_millimetre() -> None:
    points, normals = contacts_on_sphere(0.04, 40, 2, seed=0)
    contour = extract_contour(Gpis.fit(points, normals, 1e-4, 1e-2))
    np.testing.assert_allclose(np.linalg.norm(contour.points_m, axis=1), 0.04, atol=1e-4)
    assert polygon_area(contour.points_m) == pytest.approx(np.pi * 0.04**2, rel=0.01)
    assert contour.is_closed


@pytest.mark.parametrize(
    ("outline", "largest_median_mm"), [(rectangle(), 3.5), (triangle(), 6.5), (ellipse(), 1.2), (l_block(), 5.0)]
)
def test_planar_shapes_from_eighty_noisy_contacts(outline: Array, largest_median_mm: float) -> None:
    errors = [contour_errors(reconstruct(outline, 80, seed).points_m, outline) for seed in range(3)]
    assert np.median([e.hausdorff_m for e in errors]) * 1e3 < largest_median_mm
    assert np.median([e.mean_distance_m for e in errors]) * 1e3 < 0.8


def test_rectangle_from_forty_noisy_contacts() -> None:
    errors = [contour_errors(reconstruct(rectangle(), 40, seed).points_m, rectangle()) for seed in range(5)]
    assert np.median([e.hausdorff_m for e in errors]) < 0.010
    assert np.median([e.mean_distance_m for e in errors]) < 0.0012
    assert min(e.iou for e in errors) > 0.93


def test_rectangle_with_the_thesis_points_and_thin_plate() -> None:
    errors = [contour_errors(reconstruct(rectangle(), 80, seed, THESIS).points_m, rectangle()) for seed in range(3)]
    assert np.median([e.hausdorff_m for e in errors]) < 0.006


def test_outline_lies_on_the_zero_level_and_turns_counter_clockwise() -> None:
    points, normals = contacts_on_polygon(l_block(), 60, seed=1)
    field = Gpis.fit(points, normals)
    contour = extract_contour(field, resolution_m=0.002)
    assert np.abs(field.mean(contour.points_m)).max() < 1e-5
    assert polygon_area(contour.points_m) > 0
    assert np.linalg.norm(np.diff(contour.points_m, axis=0), axis=1).max() < 2 * 0.002


def test_sigma_is_small_at_contacts_and_large_where_none_were_made() -> None:
    points, normals = contacts_on_polygon(rectangle(), 60, seed=0)
    left = points[:, 0] < 0
    contour = extract_contour(Gpis.fit(points[left], normals[left]))
    near = distances_to_polygon(contour.points_m, points[left]) < 0.003
    assert contour.sigma_m[contour.points_m[:, 0] < -0.01].max() < 0.003
    assert contour.sigma_m[contour.points_m[:, 0] > 0.02].max() > 0.006
    assert contour.sigma_m[near].mean() < contour.sigma_m[~near].mean()


def test_body_that_carries_most_contacts_is_taken_when_the_field_has_several() -> None:
    points, normals = contacts_on_sphere(0.02, 30, 2, seed=0)
    stray = np.array([[0.15, 0.0]])
    field = Gpis.fit(np.vstack([points, stray]), np.vstack([normals, [[1.0, 0.0]]]))
    contour = extract_contour(field)
    assert field.mean(stray - [[0.004, 0.0]])[0] < 0
    assert contour.points_m[:, 0].max() < 0.05


@pytest.mark.parametrize("count", [1, 2, 3])
def test_few_contacts_give_a_closed_outline_with_large_uncertainty(count: int) -> None:
    points = np.array([[0.05, 0.0], [0.0, 0.03], [-0.05, 0.0]])[:count]
    contour = extract_contour(Gpis.fit(points, points / np.linalg.norm(points, axis=1, keepdims=True)))
    assert contour.is_closed
    assert contour.sigma_m.max() > 0.005


def test_a_field_without_end_is_cut_at_the_margin_and_says_so() -> None:
    points = np.column_stack([np.linspace(-0.02, 0.02, 9), np.zeros(9)])
    field = Gpis.fit(points, np.tile([0.0, 1.0], (9, 1)), settings=GpisSettings(prior_mean="zero", length_m=0.3))
    contour = extract_contour(field, largest_margin_m=0.03)
    assert not contour.is_closed
    assert np.ptp(contour.points_m[:, 0]) < 0.11


def test_a_resolution_coarser_than_the_object_is_refused() -> None:
    points, normals = contacts_on_sphere(0.002, 12, 2, seed=0)
    with pytest.raises(ShapeError, match="no inside"):
        extract_contour(Gpis.fit(points, normals, 1e-5), resolution_m=0.05)


def test_extraction_repeats_exactly() -> None:
    points, normals = noisy(*contacts_on_sphere(0.04, 30, 3, seed=2), seed=0)
    first, second = (extract_mesh(Gpis.fit(points, normals), resolution_m=0.006) for _ in range(2))
    np.testing.assert_array_equal(first.vertices, second.vertices)
    np.testing.assert_array_equal(first.faces, second.faces)


def test_sphere_from_eighty_noisy_contacts_is_watertight_and_true_to_a_millimetre() -> None:
    points, normals = noisy(*contacts_on_sphere(0.04, 80, 3, seed=0), seed=1)
    mesh = extract_mesh(Gpis.fit(points, normals).optimise())
    solid = as_trimesh(mesh)
    assert mesh.is_closed
    assert solid.is_watertight
    assert solid.body_count == 1
    assert solid.volume == pytest.approx(4 / 3 * np.pi * 0.04**3, rel=0.03)
    errors = mesh_errors(mesh, trimesh.creation.icosphere(4, 0.04))
    assert errors.hausdorff_m < 0.0015
    assert np.sum(mesh.normals * mesh.vertices, axis=1).min() > 0


def test_box_from_eighty_noisy_contacts_is_watertight_and_covers_the_truth() -> None:
    extents = np.array([0.12, 0.06, 0.06])
    points, normals = noisy(*contacts_on_box(extents, 80, seed=0), seed=1)
    mesh = extract_mesh(Gpis.fit(points, normals).optimise())
    assert as_trimesh(mesh).is_watertight
    errors = mesh_errors(mesh, trimesh.creation.box(extents))
    assert errors.hausdorff_m < 0.016
    assert errors.mean_distance_m < 0.002
    assert errors.iou > 0.85


def test_mesh_vertices_lie_on_the_zero_level() -> None:
    points, normals = contacts_on_sphere(0.03, 40, 3, seed=3)
    field = Gpis.fit(points, normals)
    mesh = extract_mesh(field, resolution_m=0.005)
    assert np.abs(field.mean(mesh.vertices)).max() < 1e-5
    np.testing.assert_allclose(np.linalg.norm(mesh.normals, axis=1), 1.0)


def test_body_on_a_table_ends_in_a_flat_foot() -> None:
    normals = np.random.default_rng(3).normal(size=(80, 3))
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    mesh = extract_mesh(Gpis.fit(0.04 * normals, normals), floor_m=-0.02)
    whole = trimesh.Trimesh(mesh.vertices, mesh.faces, process=False)
    assert whole.is_watertight
    assert mesh.vertices[:, 2].min() == pytest.approx(-0.02, abs=1e-9)
    ball_without_cap = np.pi * 0.06**2 * (0.04 - 0.06 / 3)
    assert whole.volume == pytest.approx(ball_without_cap, rel=0.03)


def test_body_below_the_table_is_refused() -> None:
    normals = np.eye(3)[[0, 1, 2, 0, 1, 2]] * np.repeat([1.0, -1.0], 3)[:, None]
    with pytest.raises(ShapeError, match="below the table"):
        extract_mesh(Gpis.fit(0.02 * normals, normals), floor_m=0.2)
