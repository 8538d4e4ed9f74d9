"""Outlines and surfaces of values on a grid: closed, on the zero level, around what is inside."""

from __future__ import annotations

import numpy as np
import pytest
import trimesh
from scipy import ndimage

from drivers.core.contacts import Array
from tactile_lab.slam.shape.surfaces.level_sets import level_mesh, level_outlines, without_small_bends
from tactile_lab.slam.shape.surfaces.sampling import polygon_area


def blobs(shape: tuple[int, ...], seed: int, smooth: float) -> Array:
    """Random bodies, positive on all sides."""
    values = ndimage.gaussian_filter(np.random.default_rng(seed).normal(size=shape), smooth)
    return np.pad(values / values.std() + 0.3, 1, constant_values=1.0)


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize("smooth", [0.5, 1.0, 3.0])
def test_an_outline_goes_around_each_region_and_each_hole(seed: int, smooth: float) -> None:
    values = blobs((30, 23), seed, smooth)
    lines = level_outlines(values)
    _, regions = ndimage.label(values <= 0)
    _, outer = ndimage.label(values > 0, np.ones((3, 3)))
    areas = np.array([polygon_area(line) for line in lines])
    assert ((areas < 0).sum(), (areas > 0).sum()) == (regions, outer - 1)  # regions one way round, holes the other
    for line in lines:
        on_line = ndimage.map_coordinates(values, line.T, order=1)
        np.testing.assert_allclose(on_line, 0.0, atol=1e-12)
        assert np.linalg.norm(line - np.roll(line, 1, axis=0), axis=1).max() <= np.sqrt(2) + 1e-12


def test_an_outline_through_nodes_is_closed() -> None:
    values = np.maximum(*np.abs(np.indices((9, 9)) - 4)) - 2.0
    (line,) = level_outlines(values)
    assert abs(polygon_area(line)) == pytest.approx(16.0)


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize("smooth", [0.5, 1.0, 3.0])
def test_a_surface_is_closed_and_faces_outwards(seed: int, smooth: float) -> None:
    values = blobs((18, 15, 12), seed, smooth)
    vertices, faces = level_mesh(values)
    mesh = trimesh.Trimesh(vertices, faces, process=False)
    assert mesh.is_watertight
    assert mesh.is_winding_consistent
    assert mesh.volume > 0
    on_surface = ndimage.map_coordinates(values, vertices.T, order=1)
    np.testing.assert_allclose(on_surface, 0.0, atol=1e-9)


def test_a_surface_through_nodes_is_closed_and_has_no_triangle_without_area() -> None:
    """A floor at the height of a layer of nodes, as a table is."""
    values = np.linalg.norm(np.indices((25, 25, 25)) - 12.3, axis=0) - 8.0
    values = np.maximum(values, 10.0 - np.arange(25))
    mesh = trimesh.Trimesh(*level_mesh(values), process=False)
    assert mesh.is_watertight
    assert mesh.area_faces.min() > 1e-8
    assert mesh.bounds[0, 2] == pytest.approx(10.0, abs=1e-3)
    cap = np.pi * 5.7**2 * (3 * 8.0 - 5.7) / 3  # of the ball, below the floor
    assert mesh.volume == pytest.approx(4 / 3 * np.pi * 8.0**3 - cap, rel=0.02)


@pytest.mark.parametrize("tolerance", [0.01, 0.3, 2.0])
def test_a_simplified_line_stays_near_every_point_and_keeps_its_ends(tolerance: float) -> None:
    line = np.cumsum(np.random.default_rng(2).normal(size=(60, 2)), axis=0)
    simple = without_small_bends(line, tolerance)
    assert (simple[0].tolist(), simple[-1].tolist()) == (line[0].tolist(), line[-1].tolist())
    share = np.linspace(0, 1, 201)[:, None, None]
    places = (simple[:-1] * (1 - share) + simple[1:] * share).reshape(-1, 2)
    away = np.linalg.norm(line[:, None] - places[None], axis=-1).min(axis=1)
    assert away.max() <= tolerance + 0.05
    assert len(simple) < len(line) or tolerance < 0.1


def test_a_closed_line_may_be_simplified() -> None:
    ring = np.array([[0.0, 0.0], [1.0, 0.01], [2.0, 0.0], [2.0, 2.0], [0.0, 2.0], [0.0, 0.0]])
    assert len(without_small_bends(ring, 0.1)) == 5
