"""Numbers behind the choice of a shape model on fixed problems: evidence of free places, strays, held-out contacts."""

from __future__ import annotations

import numpy as np
import trimesh

from drivers.core.contacts import Array
from drivers.core.errors import ShapeError
from tactile_lab.slam.shape.fields.gpis import Gpis
from tactile_lab.slam.shape.fields.gpis_shape import GpisShape
from tactile_lab.slam.shape.fields.settings import GpisSettings
from tactile_lab.slam.shape.model import FittedShape
from tactile_lab.slam.shape.selection.contradictions import stray_cost
from tactile_lab.slam.shape.selection.held_out import predicts_better
from tactile_lab.slam.shape.selection.models import fit_shape
from tactile_lab.slam.shape.selection.planar_choice import best_shape, free_evidence, outline_of
from tactile_lab.slam.shape.selection.spatial_choice import best_spatial_shape
from tactile_lab.slam.shape.selection.unexplained import are_inside, unexplained
from tactile_lab.slam.shape.surfaces.surface import Contour, SurfaceMesh, extract_contour
from tests.support.baseline import assert_baseline
from tests.support.digest import digest
from tests.support.shape_examples import contacts_on_box, contacts_on_polygon, noisy, rectangle

BOX_m = np.array([0.08, 0.06, 0.05])


def flat(count: int = 24, settings: GpisSettings | None = None, noise: float = 1.0) -> Gpis:
    points_m, normals = contacts_on_polygon(rectangle(), count, seed=4, noise=noise)
    sigmas = np.linspace(0.0008, 0.0015, count), np.linspace(0.1, 0.06, count)
    return Gpis.fit(points_m, normals, *sigmas, settings).with_log_parameters(np.log([0.0009, 0.05]))


def solid(count: int = 24, without: frozenset[str] = frozenset()) -> Gpis:
    points_m, normals = noisy(*contacts_on_box(BOX_m, count, seed=2), seed=2)
    sigmas = np.linspace(0.0008, 0.0015, count), np.linspace(0.1, 0.06, count)
    settings = GpisSettings(without=without)  # type: ignore[arg-type]
    return Gpis.fit(points_m, normals, *sigmas, settings).with_log_parameters(np.log([0.0009, 0.05]))


def outline(contour: Contour) -> list[object]:
    return [digest(contour.points_m), digest(1e3 * contour.sigma_m)]


class Box:
    """A box as a shape, larger by ``grown`` than the contacts' one, with a given evidence."""

    name = "box"

    def __init__(self, log_evidence: float | None, grown: float = 1.0, shift_m: float = 0.0) -> None:
        self.log_evidence, self._grown, self._shift_m = log_evidence, grown, shift_m

    def contour(self, resolution_m: float = 0.001) -> Contour:
        raise ShapeError("none")

    def mesh(self, resolution_m: float = 0.003, floor_m: float | None = None) -> SurfaceMesh:
        box = trimesh.creation.box(self._grown * BOX_m)
        vertices_m = np.add(box.vertices, [self._shift_m, 0.0, 0.0])
        return SurfaceMesh(vertices_m, np.asarray(box.faces), np.full(8, 0.001), np.asarray(box.vertex_normals), True)


def test_evidence_of_free_places_and_strays() -> None:
    """Free places along a line through an outline; contacts ever farther from a surface."""
    contour = extract_contour(flat(), resolution_m=0.003)
    line_m = np.column_stack([np.linspace(0.0, 0.08, 12), np.linspace(0.0, 0.02, 12)])
    away_m = np.linspace(0.0, 0.012, 13)
    values = {
        "free": [free_evidence(contour, line_m[k:], flat()) for k in range(13)],
        "strays": [stray_cost(away_m[k : k + 1], np.array([1e6])) for k in range(13)],
        "sum": stray_cost(away_m, np.linspace(1e5, 1e6, 13)),
    }
    assert_baseline("shape/selection/free_evidence", values)


def test_the_choice_in_the_plane() -> None:
    """With ever more free places inside, contacts ever farther beyond a face or off it, and with parts left out."""
    values: dict[str, list[object]] = {"free": [], "beyond": [], "astray": [], "without": [], "leaning": []}
    for step in range(6):
        values["free"].append(best_shape(flat(), np.repeat(0.96 * rectangle(), 6 * step, axis=0)).name)
        points_m, normals = contacts_on_polygon(rectangle(), 30, seed=4)
        corner_m = rectangle().max(axis=0)
        places = [
            [corner_m[0] + 0.003 * (step + 1), -corner_m[1]],
            [0.0, 0.03 - 0.004 * step],
            [-0.05 + 0.004 * step, 0.0],
        ]
        turn = 0.05 * step
        beyond = Gpis.fit(np.vstack([points_m, places[:1]]), np.vstack([normals, [[np.sin(turn), -np.cos(turn)]]]))
        values["beyond"].append(best_shape(beyond.with_log_parameters(np.log([0.0009, 0.05]))).name)
        astray = Gpis.fit(np.vstack([points_m, places[1:]]), np.vstack([normals, [[1.0, 0.0], [0.0, 1.0]]]))
        values["astray"].append(best_shape(astray.with_log_parameters(np.log([0.0009, 0.05]))).name)
    for part in ("polygon", "field", "contradictions", "corners", "right angles"):
        settings = GpisSettings(without=frozenset({part}))  # type: ignore[arg-type]
        shape = best_shape(flat(settings=settings), 0.9 * rectangle())
        values["without"].append([shape.name, shape.log_evidence])
    points_m, normals = contacts_on_polygon(rectangle(), 26, seed=5)
    diagonal = np.full((2, 2), np.sqrt(0.5))
    at_corner = Gpis.fit(np.vstack([points_m, rectangle()[2:3], [[0.0495, 0.0305]]]), np.vstack([normals, diagonal]))
    polygon, leaning = outline_of(at_corner, extract_contour(at_corner, resolution_m=0.003))
    values["leaning"] = [np.flatnonzero(leaning).tolist(), polygon.log_evidence]
    assert_baseline("shape/selection/planar_choice", values, rtol=1e-5)


def test_every_model_by_name() -> None:
    """Evidence and outline of each in the plane, with normals and with points off the surface; facets in space."""
    free_m, values = np.array([[0.03, 0.02], [0.045, 0.02]]), {}
    for name in ("gpis", "facets", "superquadric", "nagata", "occupancy", "point-cloud", "edge-features"):
        shape = fit_shape(name, flat(), free_m)
        values[name] = [shape.name, shape.log_evidence, outline(shape.contour(0.006))]
    thesis = flat(settings=GpisSettings(observations="offsurface", prior_mean="zero"))
    for name in ("superquadric", "nagata"):
        values[f"{name}, thesis"] = outline(fit_shape(name, thesis).contour(0.006))
    values["solid"] = [fit_shape("facets", solid(), None, 0.0).log_evidence]
    assert_baseline("shape/selection/models", values, rtol=1e-4, atol=1e-6)


def test_held_out_contacts() -> None:
    """A box that is ever larger than the contacts', a shape that cannot be made, and fields of other smoothness."""
    values = []
    for step in range(9):
        for length_m in (0.02, 0.05):
            field = solid(20).with_log_parameters(np.log([0.0009, length_m]))
            values.append(predicts_better(lambda _, step=step: Box(0.0, 1 + 0.02 * step), field, 0.006, None))
    assert not predicts_better(failing, solid(20), 0.006, None)
    assert_baseline("shape/selection/held_out", {"better": values})


def failing(_: Gpis) -> FittedShape:
    raise ShapeError("none")


def test_contacts_that_a_surface_does_not_explain() -> None:
    """Groups ever farther outside and inside, and ever farther from each other."""
    mesh = Box(0.0).mesh()
    values = []
    for step in range(8):
        gap_m = 0.004 + 0.003 * step
        outside = np.array([[0.04 + gap_m, 0, 0], [0.04 + gap_m, gap_m, 0.01], [0, 0.03 + gap_m, 0]])
        inside = np.array([[0.0, 0.0, 0.025 - gap_m], [0.01, 0.0, 0.02 - gap_m]])
        for far_m, together_m in ((0.012, 0.03), (0.006, 0.012)):
            found = unexplained(np.vstack([outside, inside]), mesh, far_m=far_m, together_m=together_m)
            values.append([[one.members.tolist(), one.farthest_m, one.is_inside] for one in found])
    assert unexplained(np.empty((0, 3)), mesh, far_m=0.01, together_m=0.1) == []
    places_m = 0.05 * np.sin(np.arange(60.0).reshape(20, 3))
    assert_baseline("shape/selection/unexplained", {"groups": values, "inside": are_inside(places_m, mesh)})


def chosen(field: Gpis, evidence: float | None, free_m: Array | None = None) -> list[object]:
    """The choice in space without a table, where only a polyhedron competes with what is given."""
    shape = best_spatial_shape(Box(evidence), field, lambda one, _: GpisShape(one), free_m, None)
    return [shape.name, shape.log_evidence]


def test_the_choice_in_space() -> None:
    """Against fields of rising evidence, with free places ever deeper in the solid, with strays and parts left out."""
    field = solid(30)
    base = field.log_marginal_likelihood()
    lone_m, lone = np.array([[0.0, 0.06, 0.02]]), np.array([[0.0, 0.6, 0.8]])
    strayed = field.extend(lone_m, lone)
    inner_m = np.array([[0.0, 0.0, 0.025 - 0.001 * k] for k in range(10)])
    values = {
        "evidence": [chosen(field, base + gain) for gain in (0.0, 100.0, 200.0)],
        "none": chosen(field, None),
        "free": [chosen(field, base, np.repeat(inner_m[k : k + 1], 4, axis=0))[0] for k in (0, 3, 9)],
        "stray": chosen(strayed, base),
        "without": [
            chosen(solid(30, frozenset({part})), base)
            for part in ("polyhedron", "field", "strays", "contradictions", "held-out contacts")
        ],
    }
    assert_baseline("shape/selection/spatial_choice", values, rtol=1e-4)
