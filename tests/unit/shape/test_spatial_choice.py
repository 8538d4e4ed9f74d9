"""Solids chosen by evidence: flat faces, upright walls, or the field, standing on the table."""

from __future__ import annotations

import numpy as np
import pytest
import trimesh
from shape_examples import NORMAL_SIGMA_rad, POINT_SIGMA_m, l_block
from solid_examples import box_mesh, contacts_on, cylinder_mesh, ellipsoid_mesh, field_on, l_block_mesh

from tactile_lab.errors import ShapeError
from tactile_lab.shape.choice import best_shape
from tactile_lab.shape.gpis import Gpis
from tactile_lab.shape.metrics import mesh_errors
from tactile_lab.shape.prism import Prism, ear_triangles
from tactile_lab.shape.sampling import polygon_area
from tactile_lab.shape.standing_field import StandingField
from tactile_lab.shape.surface import SurfaceMesh, extract_mesh, supported


def closed(mesh: SurfaceMesh) -> bool:
    body = trimesh.Trimesh(mesh.vertices, mesh.faces, process=False)
    return bool(body.is_watertight and body.is_winding_consistent and body.volume > 0)


@pytest.mark.parametrize("mesh", [box_mesh(), l_block_mesh()])
def test_flat_faces_are_chosen_for_blocks(mesh: trimesh.Trimesh) -> None:
    shape = best_shape(field_on(mesh, 100, seed=3), floor_m=0.0)
    assert shape.name in ("polyhedron", "prism")
    surface = shape.mesh(floor_m=0.0)
    assert closed(surface)
    assert mesh_errors(surface, mesh).hausdorff_m < 0.003


def test_a_prism_with_a_round_outline_is_chosen_for_a_cylinder() -> None:
    shape = best_shape(field_on(cylinder_mesh(), 100, seed=0), floor_m=0.0)
    assert shape.name == "prism"
    surface = shape.mesh(floor_m=0.0)
    assert closed(surface)
    assert mesh_errors(surface, cylinder_mesh()).hausdorff_m < 0.0015
    assert surface.sigma_m.max() < 0.003


def test_the_field_is_chosen_for_an_ellipsoid_and_is_not_widened_at_the_table() -> None:
    field = field_on(ellipsoid_mesh(), 100, seed=0)
    shape = best_shape(field, floor_m=0.0)
    assert shape.name == "standing gpis"
    alone = mesh_errors(extract_mesh(field, floor_m=0.0), ellipsoid_mesh())
    assert mesh_errors(shape.mesh(), ellipsoid_mesh()).hausdorff_m < alone.hausdorff_m + 0.0005


def test_wild_contacts_do_not_spoil_a_box() -> None:
    points, normals = contacts_on(box_mesh(), 110, seed=5)
    rng = np.random.default_rng(5)
    wild = rng.choice(len(points), 10, replace=False)
    points[wild] += rng.normal(0, 0.01, (10, 3))
    turned = rng.normal(size=(10, 3))
    normals[wild] = turned / np.linalg.norm(turned, axis=1, keepdims=True)
    shape = best_shape(
        Gpis.fit(points, normals, POINT_SIGMA_m, NORMAL_SIGMA_rad).optimise(max_iterations=10), floor_m=0.0
    )
    assert shape.name in ("polyhedron", "prism")
    assert mesh_errors(shape.mesh(floor_m=0.0), box_mesh()).hausdorff_m < 0.005


def test_without_a_table_the_choice_is_between_field_and_flat_faces() -> None:
    assert best_shape(field_on(cylinder_mesh(), 60, seed=1)).name in ("gpis", "polyhedron")


def test_a_sharp_solid_that_fills_free_places_is_not_taken() -> None:
    free = np.random.default_rng(0).uniform([-0.05, -0.02, 0.01], [0.05, 0.02, 0.05], (200, 3))
    assert best_shape(field_on(box_mesh(), 80, seed=0), free, floor_m=0.0).name == "standing gpis"


def test_walls_of_a_standing_field_reach_the_table_and_a_level_top_has_a_sharp_rim() -> None:
    field = field_on(cylinder_mesh(), 120, seed=1)
    standing = StandingField.fit(field, 0.0)
    assert standing.ceiling_m == pytest.approx(0.09, abs=0.001)
    assert standing.log_evidence > field.log_marginal_likelihood()
    surface = standing.mesh()
    assert closed(surface)
    alone = mesh_errors(extract_mesh(field, floor_m=0.0), cylinder_mesh())
    assert mesh_errors(surface, cylinder_mesh()).mean_distance_m < alone.mean_distance_m


def test_a_prism_needs_walls() -> None:
    points, normals = contacts_on(box_mesh(), 100, seed=0)
    top = normals[:, 2] > 0.8
    field = Gpis.fit(points[top], normals[top], POINT_SIGMA_m, NORMAL_SIGMA_rad)
    with pytest.raises(ShapeError, match="too few"):
        Prism.fit(field, best_shape)


def test_a_surface_can_be_cut_down_to_what_the_data_support() -> None:
    points, normals = contacts_on(box_mesh(), 100, seed=0)
    seen = points[:, 0] > 0
    whole = extract_mesh(Gpis.fit(points[seen], normals[seen], POINT_SIGMA_m, NORMAL_SIGMA_rad), floor_m=0.0)
    part = supported(whole, 0.002)
    assert 0 < len(part.faces) < len(whole.faces)
    assert part.sigma_m.max() <= 0.002
    assert not part.is_closed
    assert supported(whole, 1.0).is_closed
    with pytest.raises(ShapeError, match="no part"):
        supported(whole, 1e-9)


def test_ears_fill_a_polygon_that_is_not_convex() -> None:
    outline = l_block()
    triangles = ear_triangles(outline)
    assert len(triangles) == len(outline) - 2
    areas = [polygon_area(outline[triangle]) for triangle in triangles]
    assert min(areas) > 0
    assert sum(areas) == pytest.approx(polygon_area(outline))


def test_an_outline_that_crosses_itself_can_not_be_filled() -> None:
    with pytest.raises(ShapeError, match="crosses itself"):
        ear_triangles(np.array([[0.0, 0.0], [2.0, 2.0], [2.0, 0.0], [0.0, 2.0], [-1.0, 1.0], [3.0, 1.5]]))
