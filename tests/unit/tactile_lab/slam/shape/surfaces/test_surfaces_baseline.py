"""Numbers of outlines and surfaces of fixed fields: level sets, ends at heights, sigma, samples and distances."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pytest
import trimesh

from drivers.core.contacts import Array
from drivers.core.errors import ShapeError
from tactile_lab.slam.shape.fields.posterior import Prediction
from tactile_lab.slam.shape.surfaces.level_sets import level_mesh, level_outlines, without_small_bends
from tactile_lab.slam.shape.surfaces.sampling import (
    distances_to_polygon,
    distances_to_sides,
    nearest_on_mesh,
    polygon_area,
    sample_mesh_with_normals,
    sample_mesh_with_values,
    sample_polygon,
    sample_polygon_with_values,
)
from tactile_lab.slam.shape.surfaces.surface import (
    Contour,
    SurfaceMesh,
    extract_contour,
    extract_mesh,
    supported_mesh,
    supported_pieces,
)
from tests.support.baseline import assert_baseline
from tests.support.digest import digest
from tests.support.shape_examples import l_block


@dataclass(frozen=True)
class Ellipsoid:
    """A field of one or two ellipsoids (ellipses) along the axes, not a distance, with contacts on the first."""

    semi_axes_m: Array
    apart_m: float = np.inf
    sigma_inflation: float = 1.2
    leak_m: float = 0.0

    @property
    def contacts_m(self) -> Array:
        ends = np.vstack([np.diag(self.semi_axes_m), -np.diag(self.semi_axes_m)])
        return 0.6 * ends

    def predict(self, points_m: Array, *, gradient: bool = False, variance: bool = False) -> Prediction:
        first = self._one(points_m)
        second = self._one(points_m - [self.apart_m, *[0.0] * (points_m.shape[1] - 1)]) if self.apart_m < 1 else first
        slope = self._slope(points_m) if gradient else np.empty((0, points_m.shape[1]))
        spread = 1e-6 * (1 + 400 * points_m[:, 0] ** 2) if variance else np.empty(0)
        return Prediction(np.minimum(first, second) - self.leak_m, slope, spread)

    def _one(self, points_m: Array) -> Array:
        return np.asarray(0.02 * (np.sum((points_m / self.semi_axes_m) ** 2, axis=1) - 1))

    def _slope(self, points_m: Array) -> Array:
        return np.asarray(0.04 * points_m / self.semi_axes_m**2)


def surface(mesh: SurfaceMesh) -> list[object]:
    told = [digest(each) for each in (mesh.vertices, 1e3 * mesh.sigma_m, mesh.normals, mesh.faces)]
    return [*told, len(mesh.faces), mesh.is_closed]


def outline(contour: Contour) -> list[object]:
    return [digest(contour.points_m), digest(1e3 * contour.sigma_m), digest(contour.normals), contour.is_closed]


def waves(shape: tuple[int, ...]) -> Array:
    """Values with several regions below zero, some of which touch only at a corner, and zeros; positive all around."""
    places = np.indices(shape)
    rates = np.array([1.1, 1.7, 0.9])[: len(shape)].reshape(-1, *[1] * len(shape))
    inner = np.round(np.cos(places * rates + 0.4).sum(axis=0) - 0.3, 1)
    return np.pad(inner, 1, constant_values=0.5)


def test_level_sets_of_grids() -> None:
    """All outlines and the surface where a coarse grid changes its sign; a line without its small bends."""
    bends = np.column_stack([np.arange(30.0), 3 * np.sin(np.arange(30.0) / 4) + 0.2 * np.sin(9.0 * np.arange(30.0))])
    loops = level_outlines(waves((9, 11)))
    vertices, faces = level_mesh(waves((5, 6, 4)))
    values = {
        "outlines": [digest(loop) for loop in loops],
        "surface": [digest(vertices), digest(faces)],
        "bends": [without_small_bends(bends, tolerance)[:, 0] for tolerance in (0.05, 0.5, 2.0, 9.0)],
        "loop": digest(without_small_bends(bends[[*range(9), 0]], 0.3)),
        "short": without_small_bends(bends[:2], 0.1),
    }
    assert_baseline("shape/surfaces/level_sets", values)


def test_outlines_and_surfaces_of_a_field() -> None:
    """An ellipse and an ellipsoid, whole, at other resolutions, cut at a floor and a ceiling, and beside another."""
    flat, solid = Ellipsoid(np.array([0.04, 0.025])), Ellipsoid(np.array([0.04, 0.03, 0.025]))
    wide = Ellipsoid(np.array([0.1, 0.03]))
    values = {
        "outline": outline(extract_contour(flat, resolution_m=0.004)),
        "as usual": outline(extract_contour(Ellipsoid(np.array([0.012, 0.009])))),
        "beside": outline(extract_contour(Ellipsoid(np.array([0.03, 0.025]), 0.065), resolution_m=0.003)),
        "far": outline(extract_contour(wide, resolution_m=0.006)),
        "cut": outline(extract_contour(wide, resolution_m=0.006, largest_margin_m=0.02)),
        "surface": surface(extract_mesh(solid, resolution_m=0.009)),
        "usual": surface(extract_mesh(Ellipsoid(np.array([0.015, 0.012, 0.01])))),
        "floor": surface(extract_mesh(solid, resolution_m=0.009, floor_m=-0.0131)),
        "ceiling": surface(extract_mesh(solid, resolution_m=0.009, ceiling_m=0.0172)),
        "both": surface(extract_mesh(solid, resolution_m=0.007, floor_m=-0.007, ceiling_m=0.011)),
        "cap": surface(extract_mesh(solid, resolution_m=0.006, floor_m=0.018)),
    }
    assert_baseline("shape/surfaces/surfaces", values)
    with pytest.raises(ShapeError, match="below the table"):
        extract_mesh(solid, resolution_m=0.009, floor_m=0.03)
    with pytest.raises(ShapeError, match="no inside"):
        extract_contour(Ellipsoid(np.array([0.04, 0.025]), leak_m=-0.03), resolution_m=0.004)


def test_what_is_well_supported() -> None:
    """Pieces of an outline and faces of a surface, for rising limits of sigma."""
    contour = extract_contour(Ellipsoid(np.array([0.04, 0.025])), resolution_m=0.004)
    mesh = extract_mesh(Ellipsoid(np.array([0.04, 0.03, 0.025])), resolution_m=0.011)
    limits = np.quantile(contour.sigma_m, [0.0, 0.3, 0.7, 1.0])
    values = {
        "pieces": [[[digest(p.points_m), p.is_closed] for p in supported_pieces(contour, x)] for x in limits],
        "faces": [surface(supported_mesh(mesh, x)) for x in np.quantile(mesh.sigma_m, [0.4, 0.8, 1.0])],
    }
    assert_baseline("shape/surfaces/supported", values)


def test_samples_and_distances() -> None:
    """Of an L and of a mesh of unlike triangles, with values at their corners; distances from places on all sides."""
    places_m = 0.09 * np.sin(np.arange(24.0).reshape(12, 2))
    mesh = trimesh.creation.icosphere(subdivisions=1, radius=0.03)
    mesh.apply_scale([1.0, 1.5, 0.4])
    points, normals = sample_mesh_with_normals(mesh, 60, 3)
    values = {
        "area": [1e4 * polygon_area(l_block()), 1e4 * polygon_area(l_block()[::-1])],
        "samples": [digest(sample_polygon(l_block(), step_m)) for step_m in (0.003, 0.05)],
        "values": [digest(each) for each in sample_polygon_with_values(l_block(), np.arange(6.0), 0.01)],
        "on mesh": [digest(points), digest(normals)],
        "values on mesh": [digest(each) for each in sample_mesh_with_values(mesh, np.arange(42.0), 50, 4)],
        "distances": distances_to_polygon(places_m, l_block()),
        "sides": digest(distances_to_sides(places_m, np.vstack([l_block(), l_block()[-1:]]))),
        "nearest": [digest(each) for each in nearest_on_mesh(np.pad(places_m, ((0, 0), (0, 1))), mesh)],
    }
    assert_baseline("shape/surfaces/samples", values)
