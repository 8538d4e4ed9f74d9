"""Numbers of whole solids on fixed problems: polyhedra, prisms, and what is told of a solid as a field."""

from __future__ import annotations

import numpy as np
import pytest
import trimesh

from drivers.core.contacts import Array
from drivers.core.errors import ShapeError
from tactile_lab.slam.shape.fields.gpis import Gpis
from tactile_lab.slam.shape.fields.gpis_shape import GpisShape
from tactile_lab.slam.shape.fields.observations import fibonacci_sphere
from tactile_lab.slam.shape.fields.settings import GpisSettings
from tactile_lab.slam.shape.model import FittedShape
from tactile_lab.slam.shape.selection.planar_choice import polygon_of
from tactile_lab.slam.shape.solids.polyhedron import Polyhedron, contacts_of
from tactile_lab.slam.shape.solids.prism import Prism, ear_triangles, on_walls
from tactile_lab.slam.shape.solids.solid_field import SolidField, TabulatedSolid
from tactile_lab.slam.shape.surfaces.surface import Contour, SurfaceMesh, extract_contour
from tests.support.baseline import assert_baseline
from tests.support.digest import digest
from tests.support.shape_examples import contacts_on_box, l_block
from tests.support.solid_examples import box_mesh, contacts_on, l_block_mesh


def field_of(points_m: Array, normals: Array, settings: GpisSettings | None = None) -> Gpis:
    """No two contacts have the same standard deviations, and the kernel is given."""
    count = len(points_m)
    sigmas = np.linspace(0.0008, 0.0015, count), np.linspace(0.1, 0.06, count)
    return Gpis.fit(points_m, normals, *sigmas, settings).with_log_parameters(np.log([0.0009, 0.07]))


def on_l_block(count: int, seed: int) -> tuple[Array, Array]:
    points_m, normals = contacts_on(l_block_mesh(), count, seed)
    return points_m, normals


def surface(mesh: SurfaceMesh) -> list[object]:
    return [digest(each) for each in (mesh.vertices, 1e3 * mesh.sigma_m, mesh.normals)] + [len(mesh.faces)]


def test_polyhedra() -> None:
    """An L on a table and without one, with places that are free, and a box with more scatter than stated.

    Resolutions are so coarse that no edge is divided: which of two equal diagonals is drawn is a matter of chance.
    """
    field = field_of(*on_l_block(50, seed=4))
    free_m = np.array([0.03, 0.03, 0.0]) + 0.012 * np.sin(np.arange(30.0).reshape(10, 3))
    standing, free = Polyhedron.fit(field), Polyhedron.fit(field, free_m, upright=False)
    points_m, normals = contacts_on(box_mesh(), 30, seed=2)
    rough = Polyhedron.fit(field_of(points_m + 0.004 * np.sin(37 * points_m * 1e3), normals))
    plain = Polyhedron.fit(field_of(points_m, normals, GpisSettings(without=frozenset({"right angles"}))))
    values = {
        "evidence": [each.log_evidence for each in (standing, free, rough, plain)],
        "standing": surface(standing.mesh(0.2, floor_m=0.0)),
        "hanging": surface(standing.mesh(0.2)),
        "ends": [digest(each) for each in standing.ends()],
        "free": surface(free.mesh(0.2, floor_m=0.0)),
        "rough": surface(rough.mesh(0.2, floor_m=0.0)),
        "plain": surface(plain.mesh(0.2, floor_m=0.0)),
        "caps": surface(Polyhedron.fit(field.of_some(np.flatnonzero(field.normals[:, 2] < 0.5))).mesh(0.2)),
    }
    assert_baseline("shape/solids/polyhedra", values)
    assert len(plain.mesh(0.055, 0.0).faces) > len(plain.mesh(0.08, 0.0).faces) == len(plain.mesh(0.2, 0.0).faces)
    with pytest.raises(ShapeError, match="below the table"):
        standing.mesh(0.2, floor_m=0.2)


def test_planes_of_a_single_contact_are_left_out_next_to_others() -> None:
    """One more contact on a box, ever farther from its lid, ever more turned, and several of them."""
    points_m, normals = contacts_on_box(np.array([0.12, 0.06, 0.06]), 26, seed=6)
    values: dict[str, list[object]] = {"away": [], "turned": [], "several": []}
    for step in range(2, 7):
        for name, height_m, turn in (("away", 0.031 + 0.0022 * step, 0.0), ("turned", 0.034, np.deg2rad(5.5 * step))):
            more_m, more = np.array([[0.01, 0.0, height_m]]), np.array([[np.sin(turn), 0.0, np.cos(turn)]])
            found = Polyhedron.fit(field_of(np.vstack([points_m, more_m]), np.vstack([normals, more])))
            values[name].append([int(found.ends()[0][-1]), found.planes.count])
    for count in (1, 2):
        places_m = np.column_stack([np.linspace(-0.1, 0.1, 5), np.full(5, 0.07), np.linspace(-0.01, 0.09, 5)])[:count]
        more = fibonacci_sphere(5)[:count]
        found = Polyhedron.fit(field_of(np.vstack([points_m, places_m]), np.vstack([normals, more])))
        values["several"].append(found.ends()[0][26:].tolist())
    assert_baseline("shape/solids/lone_planes", values)


def test_more_than_24_planes_are_no_polyhedron() -> None:
    """Facets of a cut stone, three exact contacts on each."""
    for count in (24, 25):
        normals = np.repeat(fibonacci_sphere(count), 3, axis=0)
        across = np.tile(0.003 * np.array([[1.0, 0.2, 0.0], [-0.5, 1.0, 0.3], [0.1, -0.7, 1.0]]), (count, 1))
        points_m = 0.04 * normals + across - np.sum(across * normals, axis=1)[:, None] * normals
        field = Gpis.fit(points_m, normals, 0.0005, 0.02)
        if count == 24:
            assert Polyhedron.fit(field).planes.count == 24
        else:
            with pytest.raises(ShapeError, match="25 planes are too many"):
                Polyhedron.fit(field)


def smooth(field: Gpis, free_m: Array | None) -> FittedShape:
    """The outline as a field; it keeps what free places it is given."""
    shape = GpisShape(field)
    shape.free_m = free_m  # type: ignore[attr-defined]
    return shape


def sharp(field: Gpis, _: Array | None) -> FittedShape:
    return polygon_of(field, extract_contour(field))


def test_prisms() -> None:
    """An L with a smooth and with a sharp outline, with contacts on its top and bottom and without, and free places."""
    points_m, normals = on_l_block(30, seed=7)
    below = points_m[:5] * [1, 1, 0] + [0.0, 0.0, 0.0004], np.tile([0.0, 0.0, -1.0], (5, 1))
    both = field_of(np.vstack([points_m, below[0]]), np.vstack([normals, below[1]]))
    walls = field_of(*(each[np.abs(normals[:, 2]) < 0.5] for each in (points_m, normals)))
    free_m = np.column_stack([np.zeros((30, 2)) + 0.06, np.linspace(-0.02, 0.08, 30)])
    values: dict[str, object] = {}
    for name, field, outline in (("both", both, smooth), ("walls", walls, smooth), ("sharp", both, sharp)):
        prism = Prism.fit(field, outline, free_m)
        values[name] = {
            "evidence": prism.log_evidence,
            "ends": [[each.height_m, 1e3 * each.sigma_m, each.log_likelihood] for each in (prism.top, prism.bottom)],
            "standing": surface(prism.mesh(0.05, floor_m=-0.001)),
            "hanging": surface(prism.mesh(0.06)),
        }
        if name != "sharp":
            values[f"{name}, free"] = len(prism.outline.free_m)  # type: ignore[attr-defined]
    assert_baseline("shape/solids/prisms", values, rtol=1e-4)
    assert Prism.fit(both, smooth, free_m[:0]).outline.free_m is None  # type: ignore[attr-defined]
    with pytest.raises(ShapeError, match="below the table"):
        prism.mesh(0.01, floor_m=0.06)


def test_prisms_need_six_contacts_on_walls_and_an_outline_with_evidence() -> None:
    points_m, normals = on_l_block(30, seed=7)
    walls = np.flatnonzero(on_walls(normals))
    top = np.flatnonzero(normals[:, 2] > 0.8)
    with pytest.raises(ShapeError, match="5 contacts on walls"):
        Prism.fit(field_of(points_m[[*walls[:5], *top]], normals[[*walls[:5], *top]]), smooth)
    six = field_of(points_m[[*walls[:6], *top]], normals[[*walls[:6], *top]])
    assert np.isfinite(Prism.fit(six, smooth).log_evidence)
    thesis = GpisSettings(observations="offsurface", prior_mean="zero")
    with pytest.raises(ShapeError, match="no evidence"):
        Prism.fit(six, lambda field, _: GpisShape(Gpis.fit(field.contacts_m, field.normals, settings=thesis)))
    tilts = np.linspace(-1.5, 1.5, 41)
    upright = on_walls(np.column_stack([np.cos(tilts), 0 * tilts, np.sin(tilts)]))
    assert_baseline("shape/solids/on_walls", {"upright": np.flatnonzero(upright)})


def test_outlines_cut_into_triangles() -> None:
    """An L with points on its sides, almost straight ones too, a star, a triangle; a clockwise outline is refused."""
    share = np.linspace(0.0, 1.0, 5)[:-1, None, None]
    dense_m = (l_block() + share * (np.roll(l_block(), -1, axis=0) - l_block())).transpose(1, 0, 2).reshape(-1, 2)
    angles = np.arange(14) * np.pi / 7
    star = np.where(np.arange(14) % 2, 0.02, 0.05)[:, None] * np.column_stack([np.cos(angles), np.sin(angles)])
    bent_m = dense_m + 3e-10 * np.sin(5.0 * np.arange(len(dense_m)))[:, None]
    nearly_m = dense_m + 2e-6 * np.sin(5.0 * np.arange(len(dense_m)))[:, None]
    values = {
        name: digest(ear_triangles(each))
        for name, each in (("L", dense_m), ("star", star), ("bent", bent_m), ("nearly", nearly_m), ("3", star[:3]))
    }
    assert_baseline("shape/solids/ears", values)
    with pytest.raises(ShapeError, match="crosses itself"):
        ear_triangles(np.array([[0.0, 0.0], [0.0, 1.0], [1.0, 1.0], [1.0, 0.0]]))


def test_a_prism_keeps_corners_and_thins_what_lies_between() -> None:
    """Section with bends of ever larger angles and points 1 mm apart."""

    class Given:
        name, log_evidence = "given", 0.0

        def contour(self, resolution_m: float = 0.001) -> Contour:
            turns = np.concatenate([np.full(12, 0.03 * k) for k in range(1, 8)])
            turns = np.where(np.arange(len(turns)) % 4 == 0, turns, 0.0)
            heading = np.cumsum(turns * (2 * np.pi / turns.sum()))
            steps = 0.001 * np.column_stack([np.cos(heading), np.sin(heading)])
            points_m = np.cumsum(steps - steps.mean(axis=0), axis=0)
            return Contour(points_m, np.linspace(0.001, 0.002, len(points_m)), is_closed=True)

        def mesh(self, resolution_m: float = 0.003, floor_m: float | None = None) -> SurfaceMesh:
            raise NotImplementedError

    prism = Prism.fit(field_of(*on_l_block(30, seed=7)), lambda *_: Given())
    assert_baseline(
        "shape/solids/thinned", {"meshes": [surface(prism.mesh(step, 0.0)) for step in (0.03, 0.035, 0.045)]}
    )


def test_solids_as_fields() -> None:
    """Distances from a box, exact and tabulated, with one sigma and with one for each vertex; from a large one."""
    places_m = 0.07 * np.sin(np.arange(36.0).reshape(12, 3)) + [0.0, 0.0, 0.03]
    values = {}
    for name, mesh, sigma_m in (
        ("box", box_mesh(), 0.002),
        ("varied", box_mesh(), np.linspace(0.001, 0.004, 8)),
        ("large", trimesh.creation.box((0.5, 0.3, 0.2)), 0.003),
    ):
        fields = [SolidField(mesh, sigma_m)] + ([] if name == "varied" else [TabulatedSolid(mesh, float(sigma_m))])
        for kind, field in zip(("exact", "tabulated"), fields, strict=False):
            found = field.predict(places_m, gradient=True, variance=True)
            values[f"{name}, {kind}"] = [found.mean_m, digest(found.gradient), 1e6 * found.variance_m2]
            assert len(field.predict(places_m).variance_m2) == 0
    assert_baseline("shape/solids/solid_fields", values)


def test_contacts_of_fields_with_their_noise() -> None:
    """With a noise scale, and of a field without normals."""
    field = field_of(*on_l_block(12, seed=1))
    noisier = field.with_log_parameters(np.append(field.log_parameters, np.log(1.7)))
    thesis = Gpis.fit(*on_l_block(12, seed=1), settings=GpisSettings(observations="offsurface"))
    values = [[each.point_weights[:3], each.normal_weights[:3]] for each in map(contacts_of, (noisier, thesis))]
    assert_baseline("shape/solids/noise", {"weights": values})
