"""Numbers of fields that stand on a table and of fields that are alike along edges, on fixed problems."""

from __future__ import annotations

import numpy as np

from drivers.core.contacts import Array
from tactile_lab.slam.shape.fields.drawn_field import DrawnField, Section
from tactile_lab.slam.shape.fields.gpis import Gpis
from tactile_lab.slam.shape.fields.kernels import Matern52
from tactile_lab.slam.shape.fields.standing_field import StandingField
from tests.support.baseline import assert_baseline
from tests.support.digest import digest
from tests.support.shape_examples import contacts_on_box, noisy


def field_of(points_m: Array, normals: Array) -> Gpis:
    count = len(points_m)
    sigmas = np.linspace(0.0008, 0.0015, count), np.linspace(0.1, 0.06, count)
    return Gpis.fit(points_m, normals, *sigmas).with_log_parameters(np.log([0.0009, 0.05]))


WALLS = 16


def around_tin(
    lowest_m: float = 0.02, lean: float = 0.0, edge_m: float = 0.0, tops: int = 4, waves_m: float = 0.0
) -> tuple[Array, Array]:
    """Contacts on walls 25 mm from the axis, on a round edge of a given radius at 60 mm, and on the top."""
    k = np.arange(WALLS)
    angles, heights_m = 2.4 * k, lowest_m + (0.05 - lowest_m) * ((0.37 * k) % 1.0)
    out = np.column_stack([np.cos(angles), np.sin(angles), 0 * angles])
    up = np.array([0.0, 0.0, 1.0])
    walls_m, walls = 0.025 * out + heights_m[:, None] * up, np.cos(lean) * out + np.sin(lean) * up
    tilts = np.linspace(0.5, 1.1, 6)[:, None]
    rims = np.cos(tilts) * out[:6] + np.sin(tilts) * up
    rims_m = (0.025 - edge_m) * out[:6] + (0.06 - edge_m) * up + edge_m * rims
    lids_m = 0.012 * out[:tops] + (0.06 + waves_m * np.sin(3.0 * k[:tops, None])) * up
    points_m = np.vstack([walls_m, rims_m[: 6 if edge_m else 0], lids_m])
    normals = np.vstack([walls, rims[: 6 if edge_m else 0], np.tile(up, (tops, 1))])
    return points_m, normals


def told(shape: StandingField) -> list[object]:
    field = shape.field
    columns = field.contacts_m, field.normals, 1e3 * field.observations.value_sigma_m, field.observations.gradient_sigma
    return [shape.ceiling_m, shape.log_evidence, shape.mirrored, *(digest(each) for each in columns)]


def test_standing_fields() -> None:
    """Sharp and round edges, walls touched from high up only, leaning walls, tops of few contacts and wavy tops."""
    cases = {
        "sharp": around_tin(),
        "round": around_tin(edge_m=0.008),
        "high": around_tin(lowest_m=0.045),
        "few": around_tin(tops=2),
        "three": around_tin(tops=3),
        "no top": around_tin(tops=0),
        "no top, low": around_tin(tops=0, lowest_m=0.004),
        "wavy": around_tin(waves_m=0.003),
        "uneven": around_tin(waves_m=0.02, tops=6),
    }
    values = {name: told(StandingField.fit(field_of(*given), 0.0)) for name, given in cases.items()}
    assert_baseline("shape/fields/standing", values, rtol=1e-4, atol=1e-6)


def test_when_walls_are_mirrored_at_the_table() -> None:
    """Walls that lean ever more, that are touched from ever higher, and of which ever more contacts lean."""
    values: dict[str, list[object]] = {"lean": [], "lowest": [], "some": []}
    for step in range(10):
        lean = StandingField.fit(field_of(*around_tin(lean=np.deg2rad(11.0 + 2 * step), tops=2)), 0.0)
        lowest = StandingField.fit(field_of(*around_tin(lowest_m=0.002 + 0.0052 * step, tops=2)), 0.0)
        points_m, normals = around_tin(tops=2)
        leaning = np.arange(len(normals)) % 10 < step
        tilted = np.where(leaning[:, None] & (normals[:, 2:] < 0.5), [0.0, 0.6, -0.8], normals)
        some = StandingField.fit(field_of(points_m, tilted), 0.0)
        for name, shape in (("lean", lean), ("lowest", lowest), ("some", some)):
            values[name].append([len(shape.field.contacts_m), shape.mirrored])
    assert_baseline("shape/fields/mirrored", values)


def test_round_edges_are_assumed_at_the_foot_too() -> None:
    """Edges of ever larger radius, with fewer contacts on them, above walls that lean, and inside the walls below."""
    values = []
    for step in range(5):
        points_m, normals = around_tin(edge_m=0.001 + 0.003 * step, tops=2)
        for left_out in (0, 2, 3):
            kept = np.ones(len(points_m), dtype=bool)
            kept[WALLS : WALLS + left_out] = False
            field = StandingField.fit(field_of(points_m[kept], normals[kept]), 0.0).field
            values.append([len(field.contacts_m), float(field.contacts_m[:, 2].min())])
        inside_m = points_m.copy()
        inside_m[WALLS : WALLS + 6, :2] *= 1 - 0.12 * step
        field = StandingField.fit(field_of(inside_m, normals), 0.0).field
        values.append([len(field.contacts_m), float(field.contacts_m[:, 2].min())])
        leaning = normals.copy()
        leaning[:step] = [0.0, 0.8, -0.6]
        field = StandingField.fit(field_of(points_m, leaning), 0.0).field
        values.append([len(field.contacts_m), float(field.contacts_m[:, 2].min())])
    assert_baseline("shape/fields/round_foot", {"feet": values})


def test_surfaces_of_standing_fields() -> None:
    """Their doubt about walls near the table and the top, down to their own table and to a higher one."""
    shape = StandingField.fit(field_of(*around_tin()), 0.0)
    values = {}
    for name, floor_m in (("own", None), ("higher", 0.012)):
        mesh = shape.mesh(0.009, floor_m)
        values[name] = [digest(mesh.vertices), digest(1e3 * mesh.sigma_m), len(mesh.faces)]
    assert_baseline("shape/fields/standing_surface", values, rtol=1e-5)


def drawn(count: int = 14) -> DrawnField:
    """A box seen by a field in space and two sections, one of them oblique."""
    points_m, normals = noisy(*contacts_on_box(np.array([0.09, 0.06, 0.05]), count, seed=3), seed=3)
    space = field_of(points_m, normals)
    oblique = np.array([[0.8, 0.6, 0.0], [0.0, 0.0, 1.0]])
    sections = Section(np.eye(3)[:2], Matern52(0.0003, 0.04)), Section(oblique, Matern52(0.0005, 0.06))
    given = space.contacts_m, space.normals, space.settings, space.observations, space.kernel, space.prior
    return DrawnField(*given, sections=sections)


def test_fields_with_sections() -> None:
    """All that is asked of them, also with other parameters, of some contacts, and with one more."""
    places_m = 0.06 * np.sin(np.arange(12.0).reshape(4, 3))
    field = drawn()
    more = field.extend(np.array([[0.05, 0.01, 0.0]]), np.array([[0.0, 0.6, 0.8]]))
    fields = {
        "given": field,
        "other": field.with_log_parameters(np.append(field.log_parameters + 0.1, 0.2)),
        "some": field.of_some(np.arange(1, 14, 2)),
        "more": more,
    }
    values = {}
    for name, each in fields.items():
        found = each.predict(places_m, gradient=True, variance=True)
        values[name] = [
            each.log_marginal_likelihood(),
            each.log_marginal_likelihood_gradient(),
            each.log_parameters,
            [found.mean_m, digest(found.gradient), 1e3 * np.sqrt(found.variance_m2)],
            digest(1e4 * each.joint_covariance(places_m)),
            [each.noise_scale, each.sigma_inflation],
        ]
    assert_baseline("shape/fields/sections", values, rtol=1e-5)


def test_sections_along_edges() -> None:
    """The heading of walls, the parameters after the search, and those of a selection of many contacts."""
    turn = np.array([[np.cos(0.3), np.sin(0.3), 0.0], [-np.sin(0.3), np.cos(0.3), 0.0], [0.0, 0.0, 1.0]])
    points_m, normals = noisy(*contacts_on_box(np.array([0.09, 0.06, 0.05]), 16, seed=3), seed=3)
    found = DrawnField.along_edges(field_of(points_m @ turn, normals @ turn))
    values = {"planes": [section.plane for section in found.sections]}
    assert_baseline("shape/fields/edges", values)
    parameters = {"parameters": found.log_parameters, "evidence": found.log_marginal_likelihood()}
    assert_baseline("shape/fields/edges_search", parameters, rtol=1e-3, atol=1e-3)
