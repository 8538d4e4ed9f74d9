"""Cups of which fingers felt the outside and the rim, and came down inside."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import pytest
import trimesh

from drivers.core.contacts import Array
from tactile_lab.experiments.data.household import turned
from tactile_lab.slam.shape.fields.gpis import Gpis
from tactile_lab.slam.shape.fields.gpis_shape import GpisShape
from tactile_lab.slam.shape.fields.standing_field import StandingField
from tactile_lab.slam.shape.solids.hollow import Hollow, are_entered, felt_inside, hollowed
from tactile_lab.slam.shape.solids.turned import Turned
from tactile_lab.slam.shape.surfaces.sampling import distances_to_mesh
from tactile_lab.slam.shape.surfaces.surface import SurfaceMesh
from tests.support.shape_examples import NORMAL_SIGMA_rad, POINT_SIGMA_m

WALL_m, RADIUS_m, HIGH_m = 0.005, 0.036, 0.080
IN_CUP_m = np.array([[0.0, 0.0, 0.070], [0.008, 0.0, 0.066], [-0.005, 0.008, 0.072]])
CUP = turned([0, 36, 36, 31, 31, 0], [0, 0, 80, 80, 5, 5])


def felt(rim_m: float, on_top: int = 10, more_m: Array | None = None) -> Gpis:
    """Contacts on the outer wall at three heights, and so many of ten on the top, so far from the axis, and more there,
    shape (n, 2).
    """
    more_m = np.empty((0, 2)) if more_m is None else more_m
    around = np.linspace(0, 2 * np.pi, 10, endpoint=False)
    out = np.column_stack([np.cos(around), np.sin(around), np.zeros(10)])
    walls = [RADIUS_m * out + [0, 0, z] for z in (0.02, 0.045, 0.07)]
    beside_m = np.column_stack([more_m, np.full(len(more_m), HIGH_m)])
    points_m = np.vstack([*walls, rim_m * out[:on_top] + [0, 0, HIGH_m], beside_m])
    normals = np.vstack([out, out, out, np.tile([0.0, 0.0, 1.0], (on_top + len(more_m), 1))])
    return Gpis.fit(points_m, normals, POINT_SIGMA_m, NORMAL_SIGMA_rad).optimise(max_iterations=10)


def shape_of(field: Gpis, free_m: Array | None) -> object:
    return hollowed(StandingField.fit(field, 0.0), field, free_m, 0.0)


def test_a_cup_is_hollow_where_fingers_went_down_inside_its_rim() -> None:
    hollow = shape_of(felt(RADIUS_m - WALL_m / 2), IN_CUP_m)
    assert isinstance(hollow, Hollow)
    assert hollow.wall_m == pytest.approx(WALL_m, abs=0.002)
    mesh = hollow.mesh()
    assert trimesh.Trimesh(mesh.vertices, mesh.faces, process=False).is_watertight
    assert distances_to_mesh(CUP.vertices, mesh).max() < 0.006
    assert np.mean(distances_to_mesh(mesh.vertices, CUP)) < 0.0015


def test_the_lining_is_the_inside_of_the_wall_as_deep_as_a_finger_was() -> None:
    hollow = shape_of(felt(RADIUS_m - WALL_m / 2), IN_CUP_m)
    assert isinstance(hollow, Hollow)
    mesh = hollow.mesh()
    assert mesh.lining is not None
    lining_m = mesh.vertices[mesh.lining]
    assert np.ptp(np.arctan2(lining_m[:, 1], lining_m[:, 0])) > np.radians(350.0)
    assert IN_CUP_m[:, 2].min() < lining_m[:, 2].min() < IN_CUP_m[:, 2].min() + 0.004
    np.testing.assert_allclose(np.hypot(*lining_m[:, :2].T), RADIUS_m - WALL_m, atol=0.003)
    assert (np.einsum("nk,nk->n", mesh.normals[mesh.lining], lining_m * [1.0, 1.0, 0.0]) < 0).all()


def test_a_cup_is_hollow_though_its_rim_was_touched_on_one_side_only() -> None:
    hollow = shape_of(felt(RADIUS_m - WALL_m / 2, on_top=4), IN_CUP_m)
    assert isinstance(hollow, Hollow)
    assert np.mean(distances_to_mesh(hollow.mesh().vertices, CUP)) < 0.0025


@pytest.mark.parametrize("on_top", [1, 2])
def test_a_cup_is_hollow_though_its_rim_was_touched_at_one_place_or_two(on_top: int) -> None:
    hollow = shape_of(felt(RADIUS_m - WALL_m / 2, on_top), IN_CUP_m)
    assert isinstance(hollow, Hollow)


def test_a_contact_on_the_rim_that_is_placed_wrongly_makes_no_lid() -> None:
    misplaced_m = np.array([[RADIUS_m - 0.0135, 0.002]])
    hollow = shape_of(felt(RADIUS_m - WALL_m / 2, more_m=misplaced_m), IN_CUP_m)
    assert isinstance(hollow, Hollow)
    assert hollow.wall_m == pytest.approx(WALL_m, abs=0.002)


def test_what_more_fingers_came_down_into_than_met_a_lid_is_open() -> None:
    met_m = np.array([[0.004, 0.006], [-0.010, 0.002], [0.0, -0.012]])
    for met in (1, 2):
        assert isinstance(shape_of(felt(RADIUS_m - WALL_m / 2, more_m=met_m[:met]), IN_CUP_m), Hollow)
    assert not isinstance(shape_of(felt(RADIUS_m - WALL_m / 2, more_m=met_m), IN_CUP_m), Hollow)


def test_a_model_that_was_told_of_the_fingers_is_hollow_as_well() -> None:
    field = felt(RADIUS_m - WALL_m / 2)
    dented = Turned.fit(field, 0.0, IN_CUP_m)
    hollow = hollowed(dented, field, IN_CUP_m, 0.0)
    assert isinstance(hollow, Hollow)
    assert np.mean(distances_to_mesh(hollow.mesh().vertices, CUP)) < 0.0015


def test_a_dent_of_a_model_that_was_told_of_the_fingers_is_no_wall_though_the_rim_was_touched_on_one_side() -> None:
    field = felt(RADIUS_m - WALL_m / 2, on_top=4)
    hollow = hollowed(Turned.fit(field, 0.0, IN_CUP_m), field, IN_CUP_m, 0.0)
    assert isinstance(hollow, Hollow)
    assert hollow.wall_m == pytest.approx(WALL_m, abs=0.002)
    assert distances_to_mesh(hollow.mesh().vertices, CUP).max() < 0.006


def test_contacts_on_the_inside_of_the_wall_are_known_from_those_behind_a_handle() -> None:
    around = np.radians([20.0, 110.0, 230.0])
    out = np.column_stack([np.cos(around), np.sin(around), np.zeros(3)])
    within_m = (RADIUS_m - 0.009) * out + [0.0, 0.0, 0.055]
    behind_handle_m = np.array([[RADIUS_m + 0.02, 0.0, 0.055]])
    cup = felt(RADIUS_m - WALL_m / 2)
    points_m = np.vstack([cup.contacts_m, within_m, behind_handle_m])
    normals = np.vstack([cup.normals, -out, [[-1.0, 0.0, 0.0]]])
    inside = felt_inside(Gpis.fit(points_m, normals, POINT_SIGMA_m, NORMAL_SIGMA_rad), IN_CUP_m)
    assert np.flatnonzero(inside).tolist() == [len(cup.contacts_m) + at for at in range(3)]
    assert not felt_inside(cup, IN_CUP_m).any()


def test_a_contact_on_the_inside_is_known_by_the_outside_at_its_height_where_the_rim_was_not_felt() -> None:
    cup = felt(RADIUS_m - WALL_m / 2, on_top=1)
    out = np.array([-1.0, 0.0, 0.0])
    near_m = (RADIUS_m - WALL_m) * out + [0.0, 0.0, 0.055]
    shoulder_m, up = 0.02 * out + [0.0, 0.0, 0.055], np.array([-0.6, 0.0, 0.8])
    points_m, normals = np.vstack([cup.contacts_m, near_m, shoulder_m]), np.vstack([cup.normals, -out, up])
    inside = felt_inside(Gpis.fit(points_m, normals, POINT_SIGMA_m, NORMAL_SIGMA_rad), IN_CUP_m)
    assert np.flatnonzero(inside).tolist() == [len(cup.contacts_m)]


def test_a_contact_on_the_inside_is_known_beyond_the_chords_between_contacts_on_the_rim() -> None:
    cup, between = felt(RADIUS_m - WALL_m / 2), np.radians(18.0)
    out = np.array([np.cos(between), np.sin(between), 0.0])
    near_m = (RADIUS_m - WALL_m + 0.0014) * out + [0.0, 0.0, 0.06]
    points_m, normals = np.vstack([cup.contacts_m, near_m]), np.vstack([cup.normals, -out])
    inside = felt_inside(Gpis.fit(points_m, normals, POINT_SIGMA_m, NORMAL_SIGMA_rad), IN_CUP_m)
    assert np.flatnonzero(inside).tolist() == [len(cup.contacts_m)]


def test_a_bowl_whose_rim_leans_inward_is_hollow_though_its_model_has_a_dent() -> None:
    """Contacts on a round rim face inward, and the profile goes on down to half of the height."""
    around = np.linspace(0, 2 * np.pi, 12, endpoint=False)
    out = np.column_stack([np.cos(around), np.sin(around), np.zeros(12)])
    points_m = np.vstack(
        [r * out + [0, 0, z] for r, z in ((0.050, 0.02), (0.055, 0.035), (0.058, 0.047), (0.055, 0.05))]
    )
    up = np.array([0.0, 0.0, 1.0])
    normals = np.vstack([0.92 * out - 0.39 * up, 0.95 * out - 0.31 * up, out, 0.66 * up - 0.75 * out])
    normals[-12::2] = 0.75 * up - 0.66 * out[::2]
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    field = Gpis.fit(points_m, normals, POINT_SIGMA_m, NORMAL_SIGMA_rad).optimise(max_iterations=10)
    free_m = np.array([[0.0, 0.0, 0.04], [0.01, 0.0, 0.035], [-0.01, 0.01, 0.04]])
    dented = replace(Turned.fit(field, 0.0), sides=None)
    middle = dented.mesh().vertices
    assert middle[np.hypot(*middle[:, :2].T) < 0.01, 2].max() < 0.035
    assert isinstance(hollowed(dented, field, free_m, 0.0), Hollow)


@pytest.mark.parametrize(("on_top", "is_inside"), [(10, True), (2, True), (0, False)])
def test_fingers_were_inside_where_contacts_on_the_rim_and_close_below_are_around_them(
    on_top: int, is_inside: bool
) -> None:
    beside_m = np.array([[0.05, 0.0, 0.05], [0.0, 0.0, 0.078], [0.0, 0.0, 0.09]])
    entered = are_entered(felt(RADIUS_m - WALL_m / 2, on_top), np.vstack([IN_CUP_m, beside_m]))
    assert entered.tolist() == [is_inside] * 3 + [False] * 3


def test_walls_far_below_the_top_are_around_no_finger_beside_a_neck() -> None:
    field = felt(RADIUS_m - WALL_m / 2, 0)
    neck_m, up = np.array([[0.0, 0.0, HIGH_m + 0.03], [0.004, 0.0, HIGH_m + 0.03]]), np.tile([0.0, 0.0, 1.0], (2, 1))
    points_m, normals = np.vstack([field.contacts_m, neck_m]), np.vstack([field.normals, up])
    bottle = Gpis.fit(points_m, normals, POINT_SIGMA_m, NORMAL_SIGMA_rad)
    assert not are_entered(bottle, np.array([[0.02, 0.0, HIGH_m + 0.01]])).any()


@dataclass(frozen=True)
class Reached:
    """A cup that one finger reached into: the hollow model, and its surface."""

    hollow: Hollow
    mesh: SurfaceMesh


def reached(*, on_floor: bool) -> Reached:
    """Two contacts on the inside of its wall, and perhaps one on its floor."""
    field = felt(RADIUS_m - WALL_m / 2)
    within_m = np.array([[RADIUS_m - WALL_m, 0.0, 0.02], [WALL_m - RADIUS_m, 0.0, 0.045], [0.004, 0.002, 0.012]])
    facing = np.array([[-1.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
    count = 3 if on_floor else 2
    points_m, normals = np.vstack([field.contacts_m, within_m[:count]]), np.vstack([field.normals, facing[:count]])
    everything = Gpis.fit(points_m, normals, POINT_SIGMA_m, NORMAL_SIGMA_rad)
    free_m = np.column_stack([np.zeros((12, 2)), np.linspace(0.014, 0.072, 12)])
    inside = felt_inside(everything, free_m[are_entered(everything, free_m)])
    assert np.flatnonzero(inside).tolist() == [len(field.contacts_m) + at for at in range(count)]
    hollow = hollowed(StandingField.fit(field, 0.0), everything, free_m, 0.0, inside)
    assert isinstance(hollow, Hollow)
    return Reached(hollow, hollow.mesh())


def test_the_cavity_ends_where_a_fingertip_met_its_floor() -> None:
    cup = reached(on_floor=True)
    assert cup.hollow.bottom_m == pytest.approx(0.012)
    assert cup.hollow.wall_m == pytest.approx(WALL_m, abs=0.001)
    floor = (np.linalg.norm(cup.mesh.vertices[:, :2], axis=1) < 0.02) & (cup.mesh.vertices[:, 2] > 0.002)
    np.testing.assert_allclose(cup.mesh.vertices[floor, 2], 0.012, atol=0.001)
    assert cup.mesh.sigma_m[floor].max() < 0.002


def test_a_wall_is_as_certain_as_at_its_rim_down_to_where_its_inside_was_felt() -> None:
    cup = reached(on_floor=False)
    lining, heights_m = cup.mesh.lining, cup.mesh.vertices[:, 2]
    assert lining is not None
    assert cup.mesh.sigma_m[lining & (heights_m > 0.022)].max() < 0.002
    assert heights_m[lining].min() < 0.018


def test_a_bump_on_a_lid_is_no_wall() -> None:
    field = felt(RADIUS_m - WALL_m / 2)
    fitted = StandingField.fit(field, 0.0)
    lid = turned([0, 36, 36, 28, 28, 24, 24, 0], [0, 0, 80, 80, 76, 76, 79, 79])
    vertices, normals = np.asarray(lid.vertices), np.asarray(lid.vertex_normals)
    mesh = SurfaceMesh(vertices, np.asarray(lid.faces), np.full(len(vertices), 0.001), normals, True)
    bumped = replace(fitted)
    object.__setattr__(bumped, "mesh", lambda *_: mesh)
    hollow = hollowed(bumped, field, IN_CUP_m, 0.0)
    assert isinstance(hollow, Hollow)
    assert np.hypot(*hollow.walls.middles_m[:, :2].T).min() > RADIUS_m - 0.002


def test_nothing_of_a_hollow_body_is_higher_than_what_was_touched() -> None:
    field = felt(RADIUS_m - WALL_m / 2, on_top=3)
    assert GpisShape(field).mesh().vertices[:, 2].max() > HIGH_m + 0.003
    hollow = hollowed(GpisShape(field), field, IN_CUP_m, 0.0)
    assert isinstance(hollow, Hollow)
    assert hollow.mesh().vertices[:, 2].max() < HIGH_m + 0.002


def test_a_cavity_is_the_less_certain_the_deeper_it_is() -> None:
    hollow = shape_of(felt(RADIUS_m - WALL_m / 2), IN_CUP_m)
    assert isinstance(hollow, Hollow)
    mesh = hollow.mesh()
    reach_m, heights_m = np.linalg.norm(mesh.vertices[:, :2], axis=1), mesh.vertices[:, 2]
    inside = reach_m < RADIUS_m - WALL_m / 2
    near_rim, floor = inside & (np.abs(heights_m - 0.07) < 0.003), (reach_m < 0.02) & (heights_m > 0.002)
    assert 0.001 < mesh.sigma_m[near_rim].mean() < 0.003
    assert mesh.sigma_m[floor].min() > 0.02


def test_a_lid_that_was_touched_stays_closed() -> None:
    field = felt(0.015)
    assert not isinstance(shape_of(field, IN_CUP_m), Hollow)


def test_a_top_that_no_finger_went_through_stays_closed() -> None:
    field = felt(RADIUS_m - WALL_m / 2)
    assert not isinstance(shape_of(field, None), Hollow)
    assert not isinstance(shape_of(field, np.array([[0.0, 0.0, 0.1], [0.05, 0.0, 0.04]])), Hollow)
