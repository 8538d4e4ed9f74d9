"""Solids chosen by evidence: flat faces, upright walls, or the field, standing on the table."""

from __future__ import annotations

import numpy as np
import pytest
import trimesh

from drivers.core.contacts import Array
from drivers.core.errors import ShapeError
from drivers.core.poses import rotate, transform_points
from tactile_lab.experiments.data.spatial_data import simulate
from tactile_lab.slam.shape.fields.drawn_field import DrawnField
from tactile_lab.slam.shape.fields.gpis import Gpis
from tactile_lab.slam.shape.fields.standing_field import StandingField
from tactile_lab.slam.shape.metrics.metrics import mesh_errors
from tactile_lab.slam.shape.selection.held_out import predicts_better
from tactile_lab.slam.shape.selection.planar_choice import best_shape
from tactile_lab.slam.shape.selection.unexplained import are_inside
from tactile_lab.slam.shape.solids.hollow import Hollow
from tactile_lab.slam.shape.solids.polyhedron import Polyhedron
from tactile_lab.slam.shape.solids.prism import Prism, ear_triangles
from tactile_lab.slam.shape.surfaces.sampling import distances_to_mesh, nearest_on_mesh, polygon_area
from tactile_lab.slam.shape.surfaces.surface import SurfaceMesh, extract_mesh
from tests.support.shape_examples import NORMAL_SIGMA_rad, POINT_SIGMA_m, l_block
from tests.support.solid_examples import (
    box_mesh,
    contacts_on,
    cushion_mesh,
    cylinder_mesh,
    ellipsoid_mesh,
    field_on,
    l_block_mesh,
)


def closed(mesh: SurfaceMesh) -> bool:
    body = trimesh.Trimesh(mesh.vertices, mesh.faces, process=False)
    return bool(body.is_watertight and body.is_winding_consistent and body.volume > 0)


@pytest.mark.parametrize("mesh", [box_mesh(), l_block_mesh()])
def test_flat_faces_are_chosen_for_blocks(mesh: trimesh.Trimesh) -> None:
    shape = best_shape(field_on(mesh, 70, seed=3), floor_m=0.0)
    assert shape.name in ("polyhedron", "prism")
    surface = shape.mesh(floor_m=0.0)
    assert closed(surface)
    assert mesh_errors(surface, mesh).hausdorff_m < 0.003


def test_a_prism_with_a_round_outline_is_chosen_for_a_cylinder() -> None:
    shape = best_shape(field_on(cylinder_mesh(), 55, seed=0), floor_m=0.0)
    assert shape.name == "prism"
    surface = shape.mesh(floor_m=0.0)
    assert closed(surface)
    assert mesh_errors(surface, cylinder_mesh()).hausdorff_m < 0.0015
    assert surface.sigma_m.max() < 0.003


def test_the_field_is_chosen_for_an_ellipsoid_and_is_not_widened_at_the_table() -> None:
    field = field_on(ellipsoid_mesh(), 70, seed=0)
    shape = best_shape(field, floor_m=0.0)
    assert shape.name == "standing gpis"
    alone = mesh_errors(extract_mesh(field, floor_m=0.0), ellipsoid_mesh())
    assert mesh_errors(shape.mesh(), ellipsoid_mesh()).hausdorff_m < alone.hausdorff_m + 0.0005


@pytest.mark.long  # quicker: the other choices
def test_a_field_of_what_is_alike_along_edges_is_chosen_for_a_carton_with_bulging_sides() -> None:
    carton = cushion_mesh()
    field = field_on(carton, 70, seed=2)
    shape = best_shape(field, floor_m=0.0)
    assert isinstance(shape, StandingField)
    assert isinstance(shape.field, DrawnField)
    alone = StandingField.fit(field, 0.0)
    found, before = (mesh_errors(each.mesh(0.005), carton).hausdorff_m for each in (shape, alone))
    assert found < 0.005 < before


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


def test_a_solid_that_fills_places_where_fingers_were_is_hollow() -> None:
    free = np.random.default_rng(0).uniform([-0.05, -0.02, 0.01], [0.05, 0.02, 0.05], (200, 3))
    shape = best_shape(field_on(box_mesh(), 50, seed=0), free, floor_m=0.0)
    assert shape.name == "hollow polyhedron"
    assert are_inside(free, shape.mesh(floor_m=0.0)).mean() < 0.1


@pytest.mark.long  # quicker: a foot that was not touched
def test_walls_of_a_standing_field_reach_the_table_and_a_level_top_has_a_sharp_rim() -> None:
    field = field_on(cylinder_mesh(), 80, seed=1)
    standing = StandingField.fit(field, 0.0)
    assert standing.ceiling_m == pytest.approx(0.09, abs=0.001)
    assert standing.log_evidence > field.log_marginal_likelihood()
    surface = standing.mesh()
    assert closed(surface)
    alone = mesh_errors(extract_mesh(field, floor_m=0.0), cylinder_mesh())
    assert mesh_errors(surface, cylinder_mesh()).mean_distance_m < alone.mean_distance_m


def tin(radius_m: float = 0.034, height_m: float = 0.1, edge_m: float = 0.009) -> trimesh.Trimesh:
    """A tin on the table whose edges are round above and below."""
    turn = np.linspace(0.0, np.pi / 2, 12)
    reach, lift = radius_m - edge_m + edge_m * np.sin(turn), edge_m * (1 - np.cos(turn))
    outline = np.column_stack([np.append(reach, reach[::-1]), np.append(lift, height_m - lift[::-1])])
    mesh: trimesh.Trimesh = trimesh.creation.revolve(np.vstack([[0.0, 0.0], outline, [0.0, height_m]]), sections=72)
    return mesh


def field_above_foot(mesh: trimesh.Trimesh, seed: int) -> Gpis:
    """Fitted to contacts on all but the lowest fifth."""
    points, normals = contacts_on(mesh, 150, seed)
    felt = points[:, 2] > 0.2 * mesh.extents[2]
    return Gpis.fit(points[felt], normals[felt], POINT_SIGMA_m, NORMAL_SIGMA_rad).optimise(max_iterations=10)


def test_a_foot_that_was_not_touched_is_as_round_as_the_top() -> None:
    surface = StandingField.fit(field_above_foot(tin(), seed=3), 0.0).mesh()
    assert closed(surface)
    foot = surface.vertices[surface.vertices[:, 2] < 0.02]
    away, _ = nearest_on_mesh(foot, tin())
    assert away.max() < 0.0025  # 3.0 mm with walls down to the table


def test_the_neck_of_a_bottle_is_not_its_foot() -> None:
    body, neck = tin(), tin(radius_m=0.015, height_m=0.04)
    corners = np.vstack([body.vertices, neck.vertices + np.array([0.0, 0.0, 0.1])])
    bottle = trimesh.Trimesh(corners, np.vstack([body.faces, neck.faces + len(body.vertices)]))
    foot = StandingField.fit(field_above_foot(bottle, seed=2), 0.0).mesh()
    low = foot.vertices[(foot.vertices[:, 2] > 0.005) & (foot.vertices[:, 2] < 0.02)]
    assert np.hypot(low[:, 0], low[:, 1]).min() > 0.022


def test_a_prism_needs_walls() -> None:
    points, normals = contacts_on(box_mesh(), 100, seed=0)
    top = normals[:, 2] > 0.8
    field = Gpis.fit(points[top], normals[top], POINT_SIGMA_m, NORMAL_SIGMA_rad)
    with pytest.raises(ShapeError, match="too few"):
        Prism.fit(field, best_shape)


def test_ears_fill_a_polygon_that_is_not_convex() -> None:
    outline = l_block()
    triangles = ear_triangles(outline)
    assert len(triangles) == len(outline) - 2
    areas = [polygon_area(outline[triangle]) for triangle in triangles]
    assert min(areas) > 0
    assert sum(areas) == pytest.approx(polygon_area(outline))


@pytest.mark.parametrize("turn_rad", [0.0, 0.3, 1.2, 2.8])
def test_ears_leave_no_slivers_on_straight_sides_that_many_points_lie_on(turn_rad: float) -> None:
    corners = np.array([[0.04, -0.03], [0.0, 0.05], [-0.045, -0.028]])
    shares = np.linspace(0.0, 1.0, 28)[:-1, None]
    ring = np.vstack(
        [(1 - shares) * a + shares * b for a, b in zip(corners, np.roll(corners, -1, axis=0), strict=True)]
    )
    cosine, sine = np.cos(turn_rad), np.sin(turn_rad)
    ring = ring @ np.array([[cosine, sine], [-sine, cosine]])
    triangles = ear_triangles(ring)
    assert min(polygon_area(ring[triangle]) for triangle in triangles) > 1e-8
    assert len(triangles) == len(ring) - 2


def test_an_outline_that_crosses_itself_can_not_be_filled() -> None:
    with pytest.raises(ShapeError, match="crosses itself"):
        ear_triangles(np.array([[0.0, 0.0], [2.0, 2.0], [2.0, 0.0], [0.0, 2.0], [-1.0, 1.0], [3.0, 1.5]]))


def rounded_box_mesh(edge_m: float = 0.012) -> trimesh.Trimesh:
    """100 x 70 x 80 mm with all edges round: the convex hull of balls at its corners."""
    half = np.array([0.05, 0.035, 0.04]) - edge_m
    ball = trimesh.creation.icosphere(subdivisions=3, radius=edge_m).vertices
    signs = np.array(np.meshgrid([-1, 1], [-1, 1], [-1, 1])).reshape(3, 8).T
    mesh = trimesh.convex.convex_hull(np.vstack([ball + sign * half for sign in signs]))
    mesh.apply_translation([0.0, 0.0, 0.04])
    return mesh


@pytest.mark.long  # quicker: a sharp solid that fills free places
def test_faces_that_only_follow_their_own_contacts_are_not_taken() -> None:
    field = field_on(rounded_box_mesh(), 110, seed=1)
    faces = Polyhedron.fit(field)
    assert faces.log_evidence > field.log_marginal_likelihood()
    shape = best_shape(field, floor_m=0.0)
    assert shape.name == "standing gpis"
    surface = shape.mesh()
    within = distances_to_mesh(surface.vertices, rounded_box_mesh()) < 2 * surface.sigma_m
    assert within[surface.vertices[:, 2] > 0.01].mean() > 0.85
    assert not predicts_better(Polyhedron.fit, field, 0.006, 0.0)
    assert predicts_better(Polyhedron.fit, field_on(box_mesh(), 100, seed=3), 0.006, 0.0)


def test_a_solid_of_revolution_that_predicts_contacts_better_stands_before_many_small_faces() -> None:
    """The faces have 200 nats more: they follow a flat tin's round wall."""
    data = simulate("tin", 7, heights="all")
    points, normals = [], []
    for grasp, pose in zip(data.grasps, data.world_T_body, strict=True):
        points.append(transform_points(pose.inverse(), grasp.points_world_m))
        normals.append(rotate(pose.inverse(), grasp.normals_world))
    field = Gpis.fit(np.vstack(points), np.vstack(normals), POINT_SIGMA_m, NORMAL_SIGMA_rad).optimise(max_iterations=10)
    shape = best_shape(field, floor_m=0.0)
    assert shape.name == "turned"
    assert Polyhedron.fit(field).log_evidence > shape.log_evidence + 100
    assert mesh_errors(shape.mesh(floor_m=0.0), data.mesh).hausdorff_m < 0.004


def test_a_pot_has_flat_walls_as_thick_as_fingers_inside_found_them_though_its_rim_was_touched_near_the_edge() -> None:
    half_m, wall_m, high_m = np.array([0.045, 0.035]), 0.008, 0.07
    points_m, normals, up = list[Array](), list[Array](), np.array([0.0, 0.0, 1.0])
    for out in np.array([[1.0, 0, 0], [-1, 0, 0], [0, 1, 0], [0, -1, 0]]):
        along, reach_m = np.array([-out[1], out[0], 0.0]), float(np.abs(out[:2]) @ half_m)
        points_m += [reach_m * out + u * along + z * up for u in (-0.02, 0.0, 0.02) for z in (0.02, 0.05)]
        points_m += [(reach_m - 0.002) * out + u * along + high_m * up for u in (-0.02, 0.015)]
        points_m += [(reach_m - wall_m) * out + u * along + 0.045 * up for u in (-0.01, 0.0, 0.01)]
        normals += [out] * 6 + [up] * 2 + [-out] * 3
    noise_m = np.random.default_rng(1).normal(0, 0.0003, (len(points_m), 3))
    field = Gpis.fit(np.array(points_m) + noise_m, np.array(normals), POINT_SIGMA_m, NORMAL_SIGMA_rad)
    free_m = np.array([[0.0, 0.0, 0.04], [0.02, 0.01, 0.04], [-0.02, -0.01, 0.045]])
    pot = best_shape(field.optimise(max_iterations=10), free_m, 0.0)
    assert pot.name == "hollow polyhedron"
    assert isinstance(pot, Hollow)
    assert pot.wall_m == pytest.approx(wall_m, abs=0.0007)


def test_what_is_between_the_arms_of_an_l_is_no_cavity() -> None:
    """Its top is all around the notch, seen from above, and fingers came down there to touch the inner sides."""
    x, y, z = (each.ravel() for each in np.meshgrid([0.015, 0.025, 0.035], [0.02, 0.03, 0.04], [0.02, 0.035]))
    shape = best_shape(field_on(l_block_mesh(), 70, seed=3), np.column_stack([x, y, z]), floor_m=0.0)
    assert shape.name in ("polyhedron", "prism")
    assert mesh_errors(shape.mesh(floor_m=0.0), l_block_mesh()).hausdorff_m < 0.003
