"""Numbers of solids of revolution on fixed problems: axes, profiles, what they sweep, and parts beside them."""

from __future__ import annotations

import numpy as np
import pytest
import trimesh

from drivers.core.contacts import Array
from drivers.core.errors import ShapeError
from tactile_lab.slam.shape.fields.gpis import Gpis
from tactile_lab.slam.shape.solids.axis import find_axis, misfit_around, split, squares_around, to_profile
from tactile_lab.slam.shape.solids.planes import WeightedContacts, weighted_contacts
from tactile_lab.slam.shape.solids.revolving import generatrix, revolve
from tactile_lab.slam.shape.solids.turned import Turned
from tactile_lab.slam.shape.solids.turned_with_part import Division
from tactile_lab.slam.shape.solids.with_parts import WithParts
from tactile_lab.slam.shape.surfaces.surface import Contour, SurfaceMesh
from tests.support.baseline import assert_baseline
from tests.support.digest import digest

AXIS_m = np.array([0.006, -0.004])


def around_cone(
    count: int, *, within_rad: float = 2 * np.pi, slope: float = 0.1, lowest_m: float = 0.0
) -> tuple[Array, Array]:
    """Exact contacts on a cone about :data:`AXIS_m`, 34 mm at its foot, and every sixth on its top at 70 mm."""
    k = np.arange(count)
    angles, heights_m = within_rad * (k / count), lowest_m + (0.07 - lowest_m) * ((0.37 * k) % 1.0)
    out = np.column_stack([np.cos(angles), np.sin(angles)])
    reach_m = 0.034 - slope * heights_m
    walls = np.column_stack([AXIS_m + reach_m[:, None] * out, heights_m])
    normals = np.column_stack([out, np.full(count, slope)]) / np.hypot(1.0, slope)
    top = k % 6 == 5
    walls[top] = np.column_stack([AXIS_m + 0.5 * reach_m[top, None] * out[top], np.full(top.sum(), 0.07)])
    normals[top] = [0.0, 0.0, 1.0]
    return walls, normals


def weighted(points_m: Array, normals: Array) -> WeightedContacts:
    count = len(points_m)
    return weighted_contacts(points_m, normals, np.linspace(0.0008, 0.0015, count), np.linspace(0.1, 0.06, count))


def field_of(points_m: Array, normals: Array) -> Gpis:
    count = len(points_m)
    sigmas = np.linspace(0.0008, 0.0015, count), np.linspace(0.1, 0.06, count)
    return Gpis.fit(points_m, normals, *sigmas).with_log_parameters(np.log([0.0009, 0.05]))


def shaken(points_m: Array, normals: Array) -> tuple[Array, Array]:
    """With errors that are the same everywhere."""
    waves = np.sin(np.arange(normals.size) ** 1.3).reshape(normals.shape)
    turned = normals + 0.08 * waves
    return points_m + 0.0008 * waves[::-1], turned / np.linalg.norm(turned, axis=1, keepdims=True)


def surface(mesh: SurfaceMesh) -> list[object]:
    return [digest(each) for each in (mesh.vertices, 1e3 * mesh.sigma_m, mesh.normals)] + [len(mesh.faces)]


def test_axes() -> None:
    """With errors and an outlier; around ever less of the axis; with ever fewer contacts; with normals that pass by."""
    points_m, normals = shaken(*around_cone(40))
    points_m[4] += [0.03, 0.02, 0.0]
    contacts = weighted(points_m, normals)
    axis_m, sigma_m = find_axis(contacts)
    values: dict[str, object] = {
        "axis": [*axis_m, sigma_m],
        "profile": digest(to_profile(points_m, axis_m)),
        "split": [digest(each) for each in split(contacts, axis_m)],
        "misfit": [misfit_around(contacts, axis_m), misfit_around(contacts, axis_m + 0.01)],
        "squares": [digest(each) for each in squares_around(contacts, axis_m + 0.003)],
        "on it": split(weighted(np.array([[0.0, 0.0, 0.1]]), np.array([[0.6, 0.0, 0.8]])), np.zeros(2)),
    }
    around = []
    for within_deg in range(190, 360, 10):
        for count in (36, 14, 13):
            try:
                around.append(find_axis(weighted(*around_cone(count, within_rad=np.deg2rad(within_deg))))[1])
            except ShapeError as error:
                around.append(str(error)[:20])
    values["around"] = around
    leaning = [around_cone(40, slope=slope) for slope in (1.6, 1.7, 1.8)]
    values["leaning"] = [find_axis(weighted(*each))[1] if k < 2 else 0.0 for k, each in enumerate(leaning)]
    with pytest.raises(ShapeError, match="0 contacts on walls"):
        find_axis(weighted(*leaning[2]))
    assert_baseline("shape/solids/axes", values)


def ring(middle_m: float, high_m: float, reach_m: Array) -> Contour:
    angles = np.linspace(0, 2 * np.pi, 48, endpoint=False)
    points_m = np.column_stack([middle_m + reach_m * np.cos(angles), high_m + 0.02 * np.sin(angles)])
    return Contour(points_m, np.linspace(0.001, 0.002, 48), is_closed=True)


def test_lines_that_sweep_a_surface() -> None:
    """A section across the axis, above the table and cut by it; one beside the axis on either side; with corners."""
    box_m = 0.001 * np.array([[-30.0, 0], [30, 0], [24, 60], [8, 60], [8, 10], [-8, 10], [-8, 60], [-24, 60]])
    sections = {
        "ball": (ring(0.0, 0.03, np.full(48, 0.02)), 0.0),
        "cut": (ring(0.0, 0.03, np.full(48, 0.02)), 0.022),
        "ring": (ring(0.05, 0.03, np.full(48, 0.02)), 0.0),
        "left ring": (ring(-0.05, 0.03, np.full(48, 0.015)), 0.02),
        "cup": (Contour(box_m, np.linspace(0.001, 0.002, 8), is_closed=True), 0.002),
    }
    values = {}
    for name, (section, floor_m) in sections.items():
        for step_m in (0.004, 0.015, 0.2):
            line_m, sigma_m = generatrix(section, floor_m, step_m)
            mesh, rings = revolve(line_m, step_m)
            found = trimesh.Trimesh(mesh.vertices_m, mesh.triangles, process=False)
            told = [digest(each) for each in (line_m, 1e3 * sigma_m, mesh.vertices_m, rings)]
            values[f"{name}, {step_m}"] = [*told, len(mesh.triangles), 1e6 * float(found.volume)]
            assert found.is_watertight
    assert_baseline("shape/solids/swept", values)
    with pytest.raises(ShapeError, match="nothing above the table"):
        generatrix(sections["ball"][0], 0.06, 0.004)


def profiles() -> dict[str, Turned]:
    """Axis and kernel given: walls that narrow, that are upright, touched from high up only, and that widen upward."""
    found = {}
    for name, slope in (("narrow", 0.15), ("upright", 0.0), ("high", 0.0), ("wide", -0.25)):
        points_m, normals = around_cone(30, slope=slope, lowest_m=0.045 if name == "high" else 0.0)
        if name == "high":  # as a cup that was touched low down only inside
            points_m[:3], normals[:3] = points_m[:3] * [0.6, 0.6, 0.2], -normals[:3]
        field = field_of(*shaken(points_m, normals))
        contacts = weighted(field.contacts_m, field.normals)
        within, _ = split(contacts, AXIS_m)
        within /= np.linalg.norm(within, axis=1, keepdims=True)
        sigmas = contacts.point_weights**-0.5, contacts.normal_weights**-0.5
        half = Gpis.fit(to_profile(contacts.points_m, AXIS_m), within, *sigmas)
        free_m = (
            np.column_stack([np.linspace(0.0, 0.05, 12), np.full(12, 0.03)]) if name == "upright" else np.empty((0, 2))
        )
        found[name] = Turned(AXIS_m, 0.0007, half.with_log_parameters(np.log([0.0009, 0.04])), free_m, -0.002, 0.0)
    return found


def test_profiles_with_given_axes() -> None:
    """Fields around them, their foot below the table, and their surfaces down to two tables."""
    places_m = np.append(AXIS_m, 0.03) + 0.05 * np.sin(np.arange(24.0).reshape(8, 3))
    places_m[0, :2] = AXIS_m
    values = {}
    for name, shape in profiles().items():
        found, section = shape.predict(places_m), shape.profile
        some = shape.half_of(weighted(*around_cone(30)), np.arange(30) < 12)
        values[name] = {
            "mean": found.mean_m,
            "gradient": found.gradient,
            "section": [digest(section.contacts_m), digest(section.normals)],
            "sigma": [digest(1e3 * section.observations.value_sigma_m), digest(section.observations.gradient_sigma)],
            "some": some.log_marginal_likelihood(),
            "surface": surface(shape.mesh(0.012)),
        }
    values["low"] = {"surface": surface(shape.mesh(0.02, floor_m=0.01))}
    assert_baseline("shape/solids/profiles", values, rtol=1e-5)


def test_fitted_solids_of_revolution() -> None:
    """The likeliest axis and kernel of a cone and its evidence; normals that do not meet one axis."""
    shape = Turned.fit(field_of(*shaken(*around_cone(24))), 0.0, np.array([[0.06, 0.0, 0.03]]))
    values = {
        "axis": [*shape.axis_m, shape.axis_sigma_m],
        "evidence": shape.log_evidence,
        "kernel": shape.half.log_parameters,
        "free": shape.free_m,
    }
    assert_baseline("shape/solids/turned", values, rtol=1e-4, atol=1e-6)
    misses = []
    for turn in (0.2, 0.23, 0.3):
        points_m, normals = around_cone(24)
        turned = normals @ np.array([[np.cos(turn), np.sin(turn), 0], [-np.sin(turn), np.cos(turn), 0], [0, 0, 1.0]])
        swirled = np.where(np.arange(24)[:, None] % 2, normals, turned)
        try:
            Turned.fit(field_of(points_m, swirled), 0.0)
            misses.append("met")
        except ShapeError as error:
            misses.append(str(error)[:20])
    assert_baseline("shape/solids/misses", {"misses": misses})


class Block:
    """A body as a shape: a box of 60 x 40 x 50 mm on the table."""

    name, log_evidence = "block", 12.0

    def contour(self, resolution_m: float = 0.001) -> Contour:
        raise NotImplementedError

    def mesh(self, resolution_m: float = 0.003, floor_m: float | None = None) -> SurfaceMesh:
        box = trimesh.creation.box((0.06, 0.04, 0.05)).subdivide().subdivide()
        vertices_m = np.add(np.asarray(box.vertices), [0.0, 0.0, 0.025])
        sigma_m = np.linspace(0.001, 0.003, len(vertices_m))
        return SurfaceMesh(vertices_m, np.asarray(box.faces), sigma_m, np.asarray(box.vertex_normals), True)


def test_parts_beside_a_solid() -> None:
    """Two knobs beside a block, one of which has to be joined to it, as one field; contacts ever farther apart."""
    k = np.arange(10)
    directions = np.column_stack([np.cos(2.4 * k), np.sin(2.4 * k), np.linspace(-0.9, 0.9, 10)])
    directions[:, :2] *= np.sqrt(1 - directions[:, 2:] ** 2)
    near_m, far_m = [0.033, 0.0, 0.03] + 0.009 * directions, [-0.058, 0.01, 0.02] + 0.01 * directions
    field = field_of(np.vstack([near_m, far_m, [[0.0, 0.0, 0.05]]]), np.vstack([directions, directions, [[0, 0, 1.0]]]))
    beside = np.arange(21) < 20
    shape = WithParts.of(Block(), field, beside, 0.0, np.array([[0.05, 0.0, 0.03], [-0.04, 0.0, 0.045]]))
    places_m = np.vstack([0.05 * np.sin(np.arange(15.0).reshape(5, 3)), [[0.05, 0, 0.03], [-0.058, 0.01, 0.02]]])
    found = shape.union.predict(places_m, gradient=True, variance=True)
    values = {
        "evidence": shape.log_evidence,
        "parts": [digest(part.contacts_m) for part in shape.parts],
        "rows": [len(part.observations.points_m) for part in shape.union.parts],
        "places": digest(shape.union.contacts_m),
        "field": [found.mean_m, found.gradient, 1e3 * np.sqrt(found.variance_m2)],
    }
    groups = []
    for step in range(8):
        apart_m = np.array([[0.0, 0.1, 0.02], [0.0, 0.1 + 0.01 * (step + 1), 0.02], [0.0, 0.0, 0.1], [0.0, 0.0, 0.11]])
        some = field_of(apart_m, np.tile([0.0, 1.0, 0.0], (4, 1)))
        groups.append([len(WithParts.of(Block(), some, np.arange(4) < count, None).parts) for count in (1, 2, 4)])
    values["groups"] = groups
    assert_baseline("shape/solids/with_parts", values, rtol=1e-4, atol=1e-6)
    assert shape.name == "block with a part"


def test_contacts_beside_a_body_that_turns() -> None:
    """A cone with a bar near it and far out."""
    values = []
    points_m, normals = shaken(*around_cone(24))
    for step in range(2):
        reach_m = 0.035 + 0.012 * step
        places_m = [[reach_m, 0.004, 0.03], [reach_m, -0.004, 0.036], [reach_m + 0.003, 0, 0.04]]
        bar_m = np.add(places_m, [*AXIS_m, 0.0])
        sides = np.array([[0.0, 1.0, 0.0], [0.0, -1.0, 0.0], [1.0, 0.0, 0.0]])
        field = field_of(np.vstack([points_m, bar_m]), np.vstack([normals, sides]))
        try:
            shape = Division.of(field, 0.0).with_parts(0.0)
            values.append([len(shape.parts), sum(len(part.contacts_m) for part in shape.parts)])
        except ShapeError as error:
            values.append([str(error)[:2], 0])
    assert_baseline("shape/solids/beside", {"parts": values})
