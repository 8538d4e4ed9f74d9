"""Solids of revolution with a handle or a spout."""

from __future__ import annotations

import numpy as np
import pytest
import trimesh

from drivers.core.contacts import Array
from drivers.core.errors import ShapeError
from tactile_lab.experiments.data.household import HOUSEHOLD, turned
from tactile_lab.slam.shape.fields.gpis import Gpis
from tactile_lab.slam.shape.selection.planar_choice import best_shape
from tactile_lab.slam.shape.solids.turned import Turned
from tactile_lab.slam.shape.solids.turned_with_part import Division
from tactile_lab.slam.shape.solids.with_parts import WithParts
from tactile_lab.slam.shape.surfaces.sampling import distances_to_mesh
from tests.support.shape_examples import NORMAL_SIGMA_rad, POINT_SIGMA_m
from tests.support.solid_examples import box_mesh, contacts_on, field_on

AXIS_m = np.array([0.006, -0.004, 0.0])
BAR_m = np.array([0.030, 0.010, 0.030])


def jug() -> trimesh.Trimesh:
    """A cone of 72 mm diameter at the foot, 60 mm at its top and 90 mm height, with a bar beside it towards +x."""
    body = turned([0, 36, 30, 0], [0, 0, 90, 90])
    bar = trimesh.creation.box(BAR_m)
    bar.apply_translation([0.050, 0.0, 0.050])
    both = trimesh.util.concatenate([body, bar])
    both.apply_translation(AXIS_m)
    return both


def felt(seed: int, count: int = 80) -> tuple[Gpis, Array]:
    """Contacts on it, but for those where one part is inside the other; and which of them are on the bar."""
    points_m, normals = contacts_on(jug(), count, seed)
    places_m = points_m - AXIS_m
    reach_m = np.linalg.norm(places_m[:, :2], axis=1)
    beyond_m = reach_m - (0.036 - 0.006 * places_m[:, 2] / 0.09)
    within_bar = (np.abs(places_m[:, 1]) < BAR_m[1] / 2) & (np.abs(places_m[:, 2] - 0.05) < BAR_m[2] / 2)
    outside = (beyond_m > -0.003) & ~(within_bar & (beyond_m < 0.002) & (places_m[:, 0] > 0)) | (places_m[:, 2] > 0.088)
    given = points_m[outside], normals[outside], POINT_SIGMA_m, NORMAL_SIGMA_rad
    return Gpis.fit(*given).optimise(max_iterations=10), beyond_m[outside] > 0.012


def test_the_part_is_told_from_the_body_and_both_are_one_closed_surface() -> None:
    field, on_bar = felt(seed=3)
    shape = Division.of(field, 0.0).with_parts(0.0)
    assert isinstance(shape.body, Turned)
    assert np.abs(shape.body.axis_m - AXIS_m[:2]).max() < 0.002
    found_m = np.vstack([part.contacts_m for part in shape.parts])
    assert distances_among(field.contacts_m[on_bar], found_m).max() < 1e-9
    surface = shape.mesh()
    solid = trimesh.Trimesh(surface.vertices, surface.faces, process=False)
    assert solid.is_watertight
    assert len(solid.split()) == 1
    assert solid.bounds[1, 0] == pytest.approx(AXIS_m[0] + 0.065, abs=0.005)
    assert distances_to_mesh(field.contacts_m, surface).max() < 0.006


def distances_among(wanted_m: Array, found_m: Array) -> Array:
    """Of each place to the nearest that was found."""
    return np.asarray(np.linalg.norm(wanted_m[:, None] - found_m, axis=-1).min(axis=1))


def test_a_fin_felt_on_its_sides_is_solid() -> None:
    shape = Division.of(felt(seed=3)[0], 0.0).with_parts(0.0)
    middles_m = AXIS_m + np.column_stack([np.linspace(0.040, 0.060, 6), np.zeros(6), np.full(6, 0.05)])
    assert shape.union.predict(middles_m).mean_m.max() < 0.0


def test_a_handle_felt_on_its_outer_side_is_a_bar_with_an_opening_behind() -> None:
    body = contacts_on(turned([0, 36, 36, 0], [0, 0, 90, 90]), 60, 5)
    turns, heights_m = np.tile(np.radians([-50.0, 0.0, 50.0]), 4), np.repeat([0.030, 0.042, 0.054, 0.066], 3)
    normals = np.column_stack([np.cos(turns), np.sin(turns), np.zeros(12)])
    bar_m = np.column_stack([np.full(12, 0.066), np.zeros(12), heights_m]) + 0.006 * normals
    points_m, facing = np.vstack([body[0], bar_m]), np.vstack([body[1], normals])
    field = Gpis.fit(points_m, facing, POINT_SIGMA_m, NORMAL_SIGMA_rad)
    shape = WithParts.of(Turned.fit(field.of_some(np.arange(60)), 0.0), field, np.arange(72) >= 60, 0.0)
    places_m = np.array([[0.066, 0.0, 0.048], [0.052, 0.0, 0.048], [0.066, 0.012, 0.048], [0.066, -0.012, 0.048]])
    assert (shape.union.predict(places_m).mean_m > 0.0).tolist() == [False, True, True, True]


def test_wrong_contacts_do_not_hide_what_turns() -> None:
    points_m, normals = contacts_on(turned([0, 30, 42, 0], [0, 0, 90, 90]), 70, 6)
    wrong = np.flatnonzero(np.abs(normals[:, 2]) < 0.5)[:4]
    points_m[wrong] += np.array([[0.03], [0.02], [0.025], [0.035]]) * normals[wrong]
    normals[wrong] = -normals[wrong]
    field = Gpis.fit(points_m, normals, POINT_SIGMA_m, NORMAL_SIGMA_rad)
    division = Division.of(field, 0.0)
    assert np.flatnonzero(division.beside).tolist() == wrong.tolist()
    body = division.without_strays()
    assert np.ptp(body.mesh().vertices, axis=0) == pytest.approx([0.084, 0.084, 0.090], abs=0.003)
    assert np.isfinite(body.log_evidence)


@pytest.mark.long
def test_it_is_chosen_by_evidence_unless_it_is_left_out() -> None:
    field = field_on(HOUSEHOLD["cup-with-handle"](), 110, seed=4)
    assert best_shape(field, floor_m=0.0).name == "turned with a part"
    settings = field.settings.model_copy(update={"without": frozenset({"parts"})})
    seen = field.observations
    same = Gpis.fit(field.contacts_m, field.normals, seen.value_sigma_m, seen.gradient_sigma, settings)
    assert best_shape(same.with_log_parameters(field.kernel.log_parameters), floor_m=0.0).name != "turned with a part"


def test_nothing_lies_beside_a_cup_and_a_box_has_no_body() -> None:
    with pytest.raises(ShapeError, match="make up no part"):
        Division.of(field_on(HOUSEHOLD["cup"](), 100, seed=3), 0.0).with_parts(0.0)
    with pytest.raises(ShapeError):
        Division.of(field_on(box_mesh(), 100, seed=3), 0.0).with_parts(0.0)
