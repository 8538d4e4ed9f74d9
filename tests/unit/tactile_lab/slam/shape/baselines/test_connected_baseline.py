"""Numbers of the models that connect contacts (Nagata patches, hulls) or count them in cells, on fixed problems."""

from __future__ import annotations

import numpy as np
import pytest

from drivers.core.contacts import Array
from drivers.core.errors import ShapeError
from tactile_lab.slam.shape.baselines.edge_features import EdgeFeatureField, EdgeFeatureShape
from tactile_lab.slam.shape.baselines.implicit import (
    contour_of,
    contour_of_nodes,
    mesh_of,
    mesh_of_nodes,
    vertex_normals,
)
from tactile_lab.slam.shape.baselines.nagata import NagataShape, edge_curvature, patch_points
from tactile_lab.slam.shape.baselines.occupancy import OccupancyShape
from tactile_lab.slam.shape.baselines.point_cloud import PointCloudShape
from tactile_lab.slam.shape.baselines.scattered import along_edges, distance_sigma, merge
from tactile_lab.slam.shape.surfaces.surface import Contour, SurfaceMesh
from tests.support.baseline import assert_baseline
from tests.support.digest import digest
from tests.support.shape_examples import (
    contacts_on_box,
    contacts_on_polygon,
    contacts_on_sphere,
    l_block,
    noisy,
    rectangle,
)

BOX_m = np.array([0.06, 0.05, 0.04])


def on_box(count: int, seed: int) -> tuple[Array, Array]:
    return noisy(*contacts_on_box(BOX_m, count, seed), seed)


def outline(contour: Contour) -> list[object]:
    return [digest(contour.points_m), digest(contour.sigma_m), contour.is_closed]


def surface(mesh: SurfaceMesh) -> list[object]:
    return [digest(each) for each in (mesh.vertices, mesh.sigma_m, mesh.normals)] + [len(mesh.faces), mesh.is_closed]


def grid(dimension: int, reach_m: float, count: int) -> Array:
    """Places on a grid that is not symmetric to the origin."""
    axis = np.linspace(-reach_m, 0.9 * reach_m, count)
    return np.stack(np.meshgrid(*[axis] * dimension, indexing="ij"), axis=-1).reshape(-1, dimension)


def test_close_contacts_are_averaged() -> None:
    """A second contact ever farther from the first, and ever more turned."""
    values = []
    for step in range(16):
        for away_m, turn in ((0.0007 * step, 0.1), (0.001, np.deg2rad(4.0 * step))):
            points_m = np.array([[0.0, 0.0], [away_m, 0.0], [0.05, 0.01], [2 * away_m, 0.0]])
            normals = np.array([[0.0, 1.0], [np.sin(turn), np.cos(turn)], [1.0, 0.0], [0.0, 1.0]])
            values.append([digest(each) for each in merge(points_m, normals)])
    sigma = distance_sigma(grid(2, 0.05, 4), np.array([[0.0, 0.0], [0.05, 0.01]]), 0.002)
    bows = along_edges(np.zeros((2, 2)), np.array([[0.01, 0.0], [0.0, 0.0041]]), np.array([[0.0, 0.003]] * 2), 0.002)
    assert_baseline("shape/baselines/merged", {"merged": values, "sigma": sigma, "along": bows})


def test_nagata_curves_and_patches() -> None:
    """Coefficients of edges as the normals at their ends turn, through straight, tame and too curved; patches."""
    turns = np.linspace(-1.6, 1.6, 27)
    count = len(turns)
    starts, ends = np.zeros((count, 2)), np.tile([0.02, 0.004], (count, 1))
    upright = np.tile([0.1, 1.0] / np.hypot(0.1, 1.0), (count, 1))
    others = np.column_stack([np.sin(turns), np.cos(turns)])
    corners = np.array([[[0.02, 0.0, 0.0], [0.0, 0.02, 0.0], [0.0, 0.0, 0.02]]])
    normals = np.array([[[1.0, 0.1, 0.2], [0.2, 1.0, 0.1], [0.0, 0.3, 1.0]]])
    normals /= np.linalg.norm(normals, axis=2, keepdims=True)
    eta, zeta = np.array([0.0, 0.3, 0.7, 1.0, 1.0]), np.array([0.0, 0.1, 0.5, 0.2, 1.0])
    values = {
        "bows": edge_curvature(starts, ends, upright, others),
        "same": edge_curvature(starts, ends, others, others),
        "patch": patch_points(corners, normals, eta, zeta),
    }
    assert_baseline("shape/baselines/nagata_edges", values)


def test_nagata_shapes() -> None:
    """Outline of an ellipse by angle and of an L in its order; surface of a sphere and of a box, cut at a table."""
    radius = np.array([0.05, 0.03])
    points_m, normals = contacts_on_sphere(1.0, 14, 2, seed=2)
    level = normals / radius
    level /= np.linalg.norm(level, axis=1, keepdims=True)
    by_angle = NagataShape.of(points_m * radius + [0.02, -0.01], level, np.linspace(0.001, 0.002, 14))
    bent_m, bent = contacts_on_polygon(l_block(), 22, seed=3)
    order = np.argsort(np.arctan2(bent_m[:, 1] + 0.015, bent_m[:, 0] + 0.02))
    ball = NagataShape.of(*contacts_on_sphere(0.03, 30, 3, seed=1), np.full(30, 0.001))
    box = NagataShape.of(*on_box(40, seed=4), np.full(40, 0.001))
    values = {
        "by angle": outline(by_angle.contour(0.004)),
        "in order": outline(NagataShape.of(bent_m, bent, np.full(22, 0.001), order).contour(0.004)),
        "ball": surface(ball.mesh(0.006)),
        "box": surface(box.mesh(0.005, floor_m=-0.012)),
        "faces": digest(box.faces),
    }
    assert_baseline("shape/baselines/nagata_shapes", values)
    assert by_angle.faces.shape == (0, 3)
    with pytest.raises(ShapeError, match="enclose nothing"):
        NagataShape.of(bent_m, bent, np.full(22, 0.001), order[::-1])


def test_which_few_contacts_nagata_patches_can_join() -> None:
    """Three to six contacts on a sphere: too few, on one side of their middle, or all around it."""
    found = []
    for seed in range(24):
        for count in (3, 4, 5, 6):
            try:
                shape = NagataShape.of(*contacts_on_sphere(0.03, count, 3, seed), np.full(count, 0.001))
                found.append(f"{len(shape.faces)}")
            except ShapeError as error:
                found.append(str(error)[:25])
    assert {each[:25] for each in found} > {"the contacts enclose noth", "the contacts are all on o"}
    points_m, normals = contacts_on_sphere(0.03, 2, 2, seed=1)
    with pytest.raises(ShapeError, match="enclose nothing"):
        NagataShape.of(points_m, normals, np.full(2, 0.001))
    assert_baseline("shape/baselines/nagata_few", {"found": found})


def test_hulls_of_contacts() -> None:
    """Outline of an L and surface of a box, the tightest with all contacts in one body; the surface above a floor."""
    bent = PointCloudShape.of(*contacts_on_polygon(l_block(), 40, seed=3), np.linspace(0.001, 0.002, 40))
    box = PointCloudShape.of(*on_box(50, seed=2), np.full(50, 0.001))
    values = {
        "outline": outline(bent.contour(0.004)),
        "edges": bent.facets,
        "surface": surface(box.mesh(0.008)),
        "cut": surface(box.mesh(0.008, floor_m=-0.015)),
        "triangles": digest(box.facets),
    }
    assert_baseline("shape/baselines/point_cloud", values)


def test_occupancy_of_cells() -> None:
    """Log odds in the plane with free places, half of them beyond the grid, and in space; outline and surface."""
    points_m, normals = contacts_on_polygon(l_block(), 26, seed=6)
    free_m = np.column_stack([np.linspace(0.01, 0.2, 12), np.full(12, 0.03)])
    flat = OccupancyShape.of(points_m, normals, np.linspace(0.001, 0.003, 26), free_m)
    few_m, few = contacts_on_polygon(rectangle(0.09, 0.07), 7, seed=2, noise=0.0)
    sparse = OccupancyShape.of(few_m, few, np.full(7, 0.001))
    solid = OccupancyShape.of(*on_box(20, seed=5), np.full(20, 0.001))
    values = {
        "first": flat.first_m,
        "log odds": digest(flat.log_odds),
        "outline": outline(flat.contour()),
        "sparse": digest(sparse.log_odds),
        "solid": digest(solid.log_odds.reshape(len(solid.log_odds), -1).sum(axis=1)),
        "surface": surface(solid.mesh(floor_m=-0.01)),
    }
    assert_baseline("shape/baselines/occupancy", values)


def test_fields_that_keep_edges() -> None:
    """Values around a box and an L, with the length from the contacts and with a given one; outline and surface."""
    bent = EdgeFeatureField(*contacts_on_polygon(l_block(), 30, seed=7))
    box = EdgeFeatureField(*on_box(36, seed=8))
    long = EdgeFeatureField(*on_box(12, seed=8), length_m=0.02)
    near = EdgeFeatureField(*(each[:3] for each in contacts_on_polygon(l_block(), 30, seed=7)))
    values = {
        "lengths": [each.length_m for each in (bent, box, long, near)],
        "bent": bent.value(grid(2, 0.09, 9)),
        "box": box.value(grid(3, 0.05, 4)),
        "long": long.value(grid(3, 0.05, 3)),
        "near": near.value(grid(2, 0.09, 3)),
        "outline": outline(EdgeFeatureShape(bent, 0.001).contour(0.003)),
        "surface": surface(EdgeFeatureShape(box, 0.001).mesh(0.008, floor_m=-0.015)),
    }
    assert len(bent.value(np.empty((0, 2)))) == 0
    assert_baseline("shape/baselines/edge_features", values)


def test_outlines_and_surfaces_of_functions() -> None:
    """The largest of two discs, one with a hole, at the border of the box, and of two balls above a table."""

    def discs(places: Array) -> Array:
        small = np.linalg.norm(places - 0.6, axis=1) - 0.2
        large = np.abs(np.linalg.norm(np.add(places, [0.3, 0.2]), axis=1) - 0.25) - 0.15
        return np.minimum(small, large)

    def balls(places: Array) -> Array:
        return np.minimum(np.linalg.norm(places - 0.5, axis=1) - 0.2, np.linalg.norm(places + 0.2, axis=1) - 0.4)

    def sigma(places: Array) -> Array:
        return np.asarray(0.1 + places[:, 0] ** 2)

    low, high = np.full(3, -1.0), np.full(3, 0.9)
    mesh = mesh_of(balls, low, high, 0.1, sigma, floor_m=-0.35)
    values = {
        "ring": outline(contour_of(discs, low[:2], high[:2], 0.07, sigma)),
        "cut": outline(contour_of(discs, low[:2], np.array([-0.3, 0.9]), 0.07, sigma)),
        "balls": surface(mesh),
        "cut balls": surface(mesh_of(balls, low, np.array([0.9, 0.9, -0.2]), 0.1, sigma)),
        "normals": digest(vertex_normals(mesh.vertices * [1, 2, 3], mesh.faces)),
    }
    assert_baseline("shape/baselines/implicit", values)
    with pytest.raises(ShapeError, match="no inside"):
        contour_of(lambda places: np.ones(len(places)), low[:2], high[:2], 0.3, sigma)
    with pytest.raises(ShapeError, match="no surface"):
        mesh_of(discs, low[:2], high[:2], 0.1, sigma)
    with pytest.raises(ShapeError, match="no outline"):
        contour_of(balls, low, high, 0.1, sigma)
    with pytest.raises(ShapeError, match="no surface"):
        mesh_of_nodes(low[:2], np.ones((3, 3)), 0.1, sigma)
    with pytest.raises(ShapeError, match="no outline"):
        contour_of_nodes(low, np.ones((3, 3, 3)), 0.1, sigma)
    with pytest.raises(ShapeError, match="5005 x 4005 nodes is too large"):
        contour_of(discs, np.zeros(2), np.array([5.0, 4.0]), 0.001, sigma)


def test_planar_models_have_no_surface_and_spatial_ones_no_outline() -> None:
    """Also with as many contacts as a place has coordinates."""
    flat_m, flat = contacts_on_polygon(l_block(), 3, seed=2)
    for flat_shape in (
        NagataShape.of(*contacts_on_polygon(l_block(), 12, seed=2), np.full(12, 0.001)),
        PointCloudShape.of(*contacts_on_polygon(l_block(), 40, seed=3), np.full(40, 0.001)),
        OccupancyShape.of(flat_m, flat, np.full(3, 0.001)),
        EdgeFeatureShape(EdgeFeatureField(flat_m, flat), 0.001),
    ):
        with pytest.raises(ShapeError, match="no surface"):
            flat_shape.mesh()
    for solid_shape in (
        NagataShape.of(*on_box(40, seed=4), np.full(40, 0.001)),
        PointCloudShape.of(*on_box(50, seed=2), np.full(50, 0.001)),
        OccupancyShape.of(*on_box(4, seed=5), np.full(4, 0.001)),
        EdgeFeatureShape(EdgeFeatureField(*on_box(4, seed=8)), 0.001),
    ):
        with pytest.raises(ShapeError, match="no outline"):
            solid_shape.contour()
