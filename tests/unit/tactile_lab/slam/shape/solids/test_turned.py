"""Solids of revolution, and what is known of places without contacts."""

from __future__ import annotations

import numpy as np
import pytest
import trimesh

from drivers.core.contacts import Array
from drivers.core.errors import ShapeError
from tactile_lab.experiments.data.household import turned
from tactile_lab.slam.shape.fields.gpis import Gpis
from tactile_lab.slam.shape.fields.known_places import in_one_piece, outside_at
from tactile_lab.slam.shape.metrics.metrics import mesh_errors
from tactile_lab.slam.shape.selection.planar_choice import best_shape
from tactile_lab.slam.shape.solids.revolving import beside_foot, generatrix, revolve
from tactile_lab.slam.shape.solids.turned import Turned
from tactile_lab.slam.shape.surfaces.surface import Contour
from tests.support.shape_examples import NORMAL_SIGMA_rad, POINT_SIGMA_m
from tests.support.solid_examples import box_mesh, contacts_on, field_on


def vase() -> trimesh.Trimesh:
    """Hollow, with a wall of 5 mm and a foot of 8 mm, 70 mm high, its axis beside the origin."""
    mesh = turned([0, 24, 34, 30, 33, 30, 25, 28, 20, 0], [0, 0, 25, 50, 70, 70, 50, 25, 8, 8])
    mesh.apply_translation([0.012, -0.007, 0.0])
    return mesh


def body(line_m: list[list[float]], step_m: float = 0.004) -> trimesh.Trimesh:
    faceted, rings = revolve(np.array(line_m), step_m)
    assert len(rings) == len(faceted.vertices_m)
    return trimesh.Trimesh(faceted.vertices_m, faceted.triangles, process=False)


@pytest.mark.long
def test_a_hollow_vase_is_told_by_its_profile() -> None:
    mesh = vase()
    field = field_on(mesh, 140, seed=1)
    shape = best_shape(field, floor_m=0.0)
    assert shape.name == "turned"
    assert isinstance(shape, Turned)
    assert np.abs(shape.axis_m - [0.012, -0.007]).max() < 4 * shape.axis_sigma_m
    surface = shape.mesh()
    found = trimesh.Trimesh(surface.vertices, surface.faces, process=False)
    assert found.is_watertight
    assert found.is_winding_consistent
    assert found.volume > 0
    assert mesh_errors(surface, mesh).hausdorff_m < 0.006
    assert abs(found.volume / mesh.volume - 1) < 0.15
    with pytest.raises(ShapeError, match="outline"):
        shape.contour()


def test_its_part_of_the_choice_can_be_left_out() -> None:
    field = field_on(vase(), 90, seed=1)
    left_out = field.settings.model_copy(update={"without": frozenset({"turned"})})
    seen = field.observations
    same = Gpis.fit(field.contacts_m, field.normals, seen.value_sigma_m, seen.gradient_sigma, left_out)
    shape = best_shape(same.with_log_parameters(field.kernel.log_parameters), floor_m=0.0)
    assert shape.name != "turned"


def test_a_cup_that_was_touched_high_up_only_still_stands_on_the_table() -> None:
    cup = turned([0, 30, 42, 38, 27, 0], [0, 0, 95, 95, 5, 5])
    points_m, normals = contacts_on(cup, 400, seed=2)
    felt = (points_m[:, 2] > 0.036) & (np.einsum("ij,ij->i", points_m[:, :2], normals[:, :2]) > -0.01)
    kept = np.flatnonzero(felt)[:40]
    field = Gpis.fit(points_m[kept], normals[kept], POINT_SIGMA_m, NORMAL_SIGMA_rad).optimise(max_iterations=10)
    surface = Turned.fit(field, 0.0).mesh()
    assert surface.vertices[:, 2].min() == pytest.approx(0.0, abs=1e-6)
    foot = surface.vertices[surface.vertices[:, 2] < 0.004]
    assert np.linalg.norm(foot[:, :2], axis=1).max() == pytest.approx(0.030, abs=0.012)


def test_a_tapered_wall_goes_on_to_the_table_as_it_is_inclined() -> None:
    beaker = turned([0, 20, 36, 0], [0, 0, 80, 80])
    points_m, normals = contacts_on(beaker, 220, seed=4)
    felt = points_m[:, 2] > 0.02
    field = Gpis.fit(points_m[felt], normals[felt], POINT_SIGMA_m, NORMAL_SIGMA_rad).optimise(max_iterations=10)
    surface = Turned.fit(field, 0.0).mesh()
    foot = surface.vertices[surface.vertices[:, 2] < 0.004]
    assert np.linalg.norm(foot[:, :2], axis=1).max() < 0.0225


@pytest.mark.parametrize(("lean", "widens"), [(0.0, 0.6), (1.5, 1.5)])
def test_a_foot_is_no_wider_than_its_lowest_contacts_and_their_lean_allow(lean: float, widens: float) -> None:
    heights_m = np.linspace(0.02, 0.08, 12)
    walls_m = np.column_stack([0.05 - lean * (heights_m - 0.02), heights_m])
    normals = np.tile([1.0, lean] / np.hypot(1.0, lean), (12, 1))
    half = Gpis.fit(walls_m, normals, POINT_SIGMA_m, NORMAL_SIGMA_rad)
    beside_m = beside_foot(half, 0.0)
    assert beside_m[:, 1].min() == pytest.approx(0.0, abs=1e-9)
    assert beside_m[:, 1].max() < 0.021
    assert np.all(beside_m[:, 0] > 0.05 + widens * (0.02 - beside_m[:, 1]))


def test_a_box_has_no_axis() -> None:
    with pytest.raises(ShapeError, match="do not meet one vertical axis"):
        Turned.fit(field_on(box_mesh(), 100, seed=3), 0.0)


def test_contacts_on_one_side_have_no_axis() -> None:
    field = field_on(vase(), 200, seed=2)
    one_side = np.flatnonzero(field.contacts_m[:, 0] > 0.025)
    with pytest.raises(ShapeError, match=r"surround|too few"):
        Turned.fit(field.of_some(one_side), 0.0)


def test_a_line_that_ends_on_the_axis_sweeps_a_closed_solid() -> None:
    cone = body([[0.0, 0.0], [0.03, 0.0], [0.0, 0.09]], 0.001)
    assert cone.is_watertight
    assert cone.is_winding_consistent
    assert cone.volume == pytest.approx(np.pi * 0.03**2 * 0.09 / 3, rel=0.01)


def test_a_closed_line_sweeps_a_ring() -> None:
    ring = body([[0.03, 0.0], [0.05, 0.0], [0.05, 0.02], [0.03, 0.02], [0.03, 0.0]], 0.001)
    assert ring.is_watertight
    assert ring.is_winding_consistent
    assert ring.euler_number == 0
    assert ring.volume == pytest.approx(np.pi * (0.05**2 - 0.03**2) * 0.02, rel=0.01)


def square(left_m: float, right_m: float) -> Contour:
    points_m = np.array([[left_m, -0.02], [right_m, -0.02], [right_m, 0.03], [left_m, 0.03]])
    return Contour(points_m, np.full(4, 0.001), is_closed=True)


def test_a_section_is_cut_at_the_table_and_at_the_axis() -> None:
    line_m, sigma_m = generatrix(square(-0.04, 0.04), 0.0, 0.005)
    assert line_m[:, 1].min() == pytest.approx(0.0)
    assert line_m[[0, -1], 0] == pytest.approx(0.0)
    assert line_m[[0, -1], 1] == pytest.approx([0.0, 0.03])
    assert sigma_m == pytest.approx(0.001)


@pytest.mark.parametrize("section", [square(0.02, 0.04), square(-0.04, -0.02)])
def test_one_of_two_parts_of_a_section_is_a_ring(section: Contour) -> None:
    line_m, _ = generatrix(section, 0.0, 0.005)
    assert line_m[0] == pytest.approx(line_m[-1])
    assert line_m[:, 0].min() == pytest.approx(0.02)


def test_nothing_above_the_table_is_told() -> None:
    with pytest.raises(ShapeError, match="above the table"):
        generatrix(square(-0.04, 0.04), 0.05, 0.005)


def two_walls(gap_m: float) -> tuple[Array, Array]:
    """Contacts on the long sides of two bars in one line with a gap between, which nobody touched."""
    along_m = np.append(np.arange(-0.06, -gap_m / 2, 0.006), np.arange(gap_m / 2, 0.061, 0.006))
    sides = [np.column_stack([along_m, np.full(len(along_m), side * 0.002)]) for side in (-1, 1)]
    ways = np.repeat([[0.0, -1.0], [0.0, 1.0]], len(along_m), axis=0)
    return np.vstack(sides), ways


def test_a_place_where_a_finger_was_is_outside() -> None:
    points_m, normals = two_walls(0.0)
    field = Gpis.fit(points_m, normals)
    free_m = np.array([[0.070, 0.0], [0.0, 0.05]])
    inside_m = np.array([[0.03, 0.0]])
    found = outside_at(field, np.vstack([free_m, field.contacts_m[:1] + 0.0]))
    assert (found.mean(free_m) > -0.0005).all()
    assert found.mean(inside_m) < 0
    assert found.log_marginal_likelihood() != pytest.approx(0.0)
    assert outside_at(field, free_m[1:]) is field, "nothing is told that the field knows"


def test_pieces_of_one_object_are_joined_where_they_are_nearest() -> None:
    points_m, normals = two_walls(0.030)
    kernel_m = np.log([0.010**2, 0.012])
    parted = Gpis.fit(points_m, normals).with_log_parameters(kernel_m)
    assert parted.mean(np.array([[0.0, 0.0]])) > 0
    joined = in_one_piece(parted, 0.001)
    between = np.column_stack([np.linspace(-0.03, 0.03, 31), np.zeros(31)])
    assert (joined.mean(between) < 0).all()
    assert in_one_piece(joined, 0.001) is joined
