"""The comparison models: each reproduces what it can represent, is closed, and says when it cannot be made."""

from __future__ import annotations

import numpy as np
import pytest
import trimesh

from drivers.core.contacts import Array
from drivers.core.errors import ConfigurationError, ShapeError
from tactile_lab.slam.shape.baselines.edge_features import EdgeFeatureField, EdgeFeatureShape
from tactile_lab.slam.shape.baselines.nagata import NagataShape, edge_curvature, patch_points
from tactile_lab.slam.shape.baselines.occupancy import OccupancyShape
from tactile_lab.slam.shape.baselines.point_cloud import PointCloudShape
from tactile_lab.slam.shape.fields.gpis import Gpis
from tactile_lab.slam.shape.metrics.metrics import contour_errors
from tactile_lab.slam.shape.planar.outlines import encloses, is_simple
from tactile_lab.slam.shape.selection.models import SHAPE_MODELS, fit_shape
from tactile_lab.slam.shape.surfaces.surface import SurfaceMesh
from tests.support.shape_examples import (
    NORMAL_SIGMA_rad,
    POINT_SIGMA_m,
    contacts_on_box,
    contacts_on_polygon,
    contacts_on_sphere,
    ellipse,
    l_block,
    noisy,
    rectangle,
)

ALONE = ("superquadric", "nagata", "occupancy", "point-cloud", "edge-features")
RADIUS_m = 0.040


def arc(opening_rad: float) -> tuple[Array, Array]:
    """The two ends of a circle's arc, with normals."""
    angle = np.array([-opening_rad / 2, opening_rad / 2])
    outward = np.column_stack([np.cos(angle), np.sin(angle)])
    return RADIUS_m * outward, outward


def is_proper(mesh: SurfaceMesh) -> bool:
    solid = trimesh.Trimesh(mesh.vertices, mesh.faces, process=False)
    return bool(solid.is_watertight and solid.is_winding_consistent and solid.volume > 0)


@pytest.mark.parametrize("name", [name for name in SHAPE_MODELS if name != "facets"])
@pytest.mark.parametrize("outline", [rectangle(), ellipse()], ids=["rectangle", "ellipse"])
def test_every_model_outlines_simple_shapes(name: str, outline: Array) -> None:
    gpis = Gpis.fit(*contacts_on_polygon(outline, 60, seed=1), POINT_SIGMA_m, NORMAL_SIGMA_rad)
    contour = fit_shape(name, gpis).contour()
    assert is_simple(contour.points_m)
    assert len(contour.sigma_m) == len(contour.points_m)
    assert (contour.sigma_m > 0).all()
    assert contour_errors(contour.points_m, outline).mean_distance_m < 0.0035


@pytest.mark.parametrize("name", ALONE)
def test_every_model_surfaces_a_box_and_ends_at_the_floor(name: str) -> None:
    points, normals = noisy(*contacts_on_box(np.array([0.12, 0.06, 0.06]), 70, seed=2), seed=2)
    shape = fit_shape(name, Gpis.fit(points, normals, POINT_SIGMA_m, NORMAL_SIGMA_rad))
    mesh = shape.mesh(0.006, floor_m=-0.02)
    assert is_proper(mesh)
    assert mesh.vertices[:, 2].min() >= -0.02 - 1e-6
    volume = trimesh.Trimesh(mesh.vertices, mesh.faces, process=False).volume
    assert volume == pytest.approx(0.12 * 0.06 * 0.05, rel=0.35)
    with pytest.raises(ShapeError):
        shape.contour()


def test_an_unknown_model_is_named_with_those_there_are() -> None:
    gpis = Gpis.fit(*contacts_on_sphere(RADIUS_m, 10, 2, seed=0))
    with pytest.raises(ConfigurationError, match="no shape model"):
        fit_shape("clay", gpis)


def test_off_surface_observations_serve_all_models_too() -> None:
    settings = Gpis.fit(*contacts_on_sphere(RADIUS_m, 24, 2, seed=0)).settings
    thesis = settings.model_copy(update={"observations": "offsurface"})
    gpis = Gpis.fit(*contacts_on_sphere(RADIUS_m, 24, 2, seed=0), settings=thesis)
    for name in ALONE:
        assert fit_shape(name, gpis).contour().is_closed


def test_nagata_edges_are_tangent_to_both_normals() -> None:
    rng = np.random.default_rng(0)
    starts, ends = rng.normal(size=(2, 20, 3))
    normals = rng.normal(size=(2, 20, 3)) * 0.3 + np.cross(ends - starts, rng.normal(size=(20, 3)))
    normals /= np.linalg.norm(normals, axis=2, keepdims=True)
    bow = edge_curvature(starts, ends, *normals)
    tame = np.linalg.norm(bow, axis=1) > 0
    assert tame.sum() > 5
    np.testing.assert_allclose(np.sum((ends - starts - bow) * normals[0], axis=1)[tame], 0, atol=1e-12)
    np.testing.assert_allclose(np.sum((ends - starts + bow) * normals[1], axis=1)[tame], 0, atol=1e-12)


def test_nagata_curves_follow_a_circle_to_fourth_order() -> None:
    def error(opening_rad: float) -> float:
        points, normals = arc(opening_rad)
        bow = edge_curvature(points[:1], points[1:], normals[:1], normals[1:])
        share = np.linspace(0, 1, 101)[:, None]
        curve = points[0] + (points[1] - points[0] - bow) * share + bow * share**2
        return float(np.abs(np.linalg.norm(curve, axis=1) - RADIUS_m).max())

    assert error(0.5) < 2e-3 * RADIUS_m
    assert error(0.5) / error(0.25) == pytest.approx(16, rel=0.05)


def test_nagata_patches_follow_a_sphere_and_share_their_edges() -> None:
    points, normals = contacts_on_sphere(RADIUS_m, 120, 3, seed=0)
    shape = NagataShape.of(points, normals, np.full(120, 1e-3))
    mesh = shape.mesh(0.004)
    assert is_proper(mesh)
    flat = PointCloudShape.of(points, normals, np.full(120, 1e-3)).mesh(0.004)
    bent_error, flat_error = (np.abs(np.linalg.norm(m.vertices, axis=1) - RADIUS_m).mean() for m in (mesh, flat))
    assert bent_error < 0.15 * flat_error
    corners = np.eye(3)[None]
    ends = patch_points(corners, corners, np.array([0.0, 1.0, 1.0]), np.array([0.0, 0.0, 1.0]))
    np.testing.assert_allclose(ends, corners, atol=1e-12)


def test_nagata_joins_contacts_of_an_outline_by_their_angle_unless_the_order_is_given() -> None:
    outline = np.array(
        [[0.0, 0.0], [0.06, 0.0], [0.06, 0.02], [0.015, 0.02], [0.015, 0.03], [0.06, 0.03], [0.06, 0.05]]
    )
    outline = np.vstack([outline, [[0.0, 0.05]]])
    middle = (outline.min(axis=0) + outline.max(axis=0)) / 2
    normals = (outline - middle) / np.linalg.norm(outline - middle, axis=1, keepdims=True)
    shuffled = np.random.default_rng(3).permutation(len(outline))
    sigmas = np.full(len(outline), 1e-3)
    given = NagataShape.of(outline[shuffled], normals[shuffled], sigmas, np.argsort(shuffled))
    np.testing.assert_allclose(given.points_m, outline)
    by_angle = NagataShape.of(outline[shuffled], normals[shuffled], sigmas).points_m - middle
    turns = np.diff(np.unwrap(np.arctan2(by_angle[:, 1], by_angle[:, 0])))
    assert len(by_angle) == len(outline)
    assert (turns > 0).all()


def test_nagata_normals_that_contradict_each_other_leave_the_edge_straight() -> None:
    start, end = np.zeros((1, 2)), np.array([[0.01, 0.0]])
    wild = np.array([[0.9, 0.1]]) / np.hypot(0.9, 0.1)
    assert np.linalg.norm(edge_curvature(start, end, wild, np.array([[0.0, 1.0]]))) == 0


def test_contacts_on_one_side_are_refused_by_models_that_join_them() -> None:
    points = np.random.default_rng(0).uniform(-0.03, 0.03, (20, 3)) * [1, 1, 0]
    normals = np.tile([0.0, 0.0, 1.0], (20, 1))
    with pytest.raises(ShapeError):
        NagataShape.of(points, normals, np.full(20, 1e-3))
    with pytest.raises(ShapeError):
        PointCloudShape.of(points, normals, np.full(20, 1e-3))
    with pytest.raises(ShapeError):
        PointCloudShape.of(points[:2, :2], normals[:2, 1:], np.full(2, 1e-3))


@pytest.mark.parametrize("seed", range(3))
def test_occupancy_is_never_where_a_fingertip_passed(seed: int) -> None:
    points, normals = contacts_on_polygon(l_block(), 40, seed)
    ways = points[:, None] + np.linspace(0.004, 0.035, 30)[None, :, None] * normals[:, None]
    blocked = np.array([encloses(l_block(), way).any() for way in ways])
    free = ways[~blocked].reshape(-1, 2)
    contour = OccupancyShape.of(points, normals, np.full(40, 1e-3), free).contour()
    assert not encloses(contour.points_m, free).any()


def test_occupancy_without_contacts_nearby_stays_unknown_and_unoccupied() -> None:
    shape = OccupancyShape.of(*contacts_on_polygon(rectangle(), 40, seed=0), np.full(40, 1e-3))
    assert shape.log_odds[0].max() < 0
    assert shape.log_odds[:, -1].max() < 0
    centre = tuple(np.round(-shape.first_m / shape.cell_m).astype(int))
    assert shape.log_odds[centre] > 0


def test_point_cloud_outlines_pass_through_contacts_only() -> None:
    outline = ellipse()
    points, normals = contacts_on_polygon(outline, 50, seed=0, noise=0.0)
    shape = PointCloudShape.of(points, normals, np.full(50, 1e-3))
    corners = shape.points_m[np.unique(shape.facets)]
    assert (np.linalg.norm(corners[:, None] - points[None], axis=2).min(axis=1) < 0.005).all()
    assert contour_errors(shape.contour().points_m, outline).hausdorff_m < 0.006


def box_edge() -> tuple[Array, Array]:
    """Contacts on two faces that meet at a right angle along the y axis, none nearer to the edge than 8 mm."""
    along = np.linspace(-0.02, 0.02, 3)
    away = np.array([0.008, 0.018, 0.028])
    first = np.array([[-a, y, 0.0] for a in away for y in along])
    second = np.array([[0.0, y, -a] for a in away for y in along])
    normals = np.repeat([[0.0, 0.0, 1.0], [1.0, 0.0, 0.0]], 9, axis=0)
    return np.vstack([first, second]), normals


def test_edge_features_keep_a_box_edge_sharper_than_a_smooth_field() -> None:
    points, normals = box_edge()
    field, smooth = EdgeFeatureField(points, normals), Gpis.fit(points, normals)
    inwards = np.linspace(-0.01, 0.01, 401)
    diagonal = np.column_stack([-inwards, 0 * inwards, -inwards])

    def reach(values: Array) -> float:
        """How far inside the true edge, along the diagonal, the surface passes."""
        return float(inwards[np.argmax(values < 0)] * np.sqrt(2))

    assert abs(reach(field.value(diagonal))) < 0.0006
    assert abs(reach(smooth.mean(diagonal))) > 2 * abs(reach(field.value(diagonal)))


def test_edge_features_keep_a_concave_edge_too() -> None:
    points, normals = box_edge()
    field = EdgeFeatureField(points, -normals)
    places = np.array([[-0.002, 0, -0.002], [0.002, 0, -0.002], [-0.002, 0, 0.002], [0.002, 0, 0.002]])
    np.testing.assert_array_equal(field.value(places) > 0, [True, False, False, False])


def test_edge_features_are_flat_on_one_face_and_distances_there() -> None:
    points = np.array([[x, y, 0.0] for x in (-0.01, 0.0, 0.01) for y in (-0.01, 0.0, 0.01)])
    field = EdgeFeatureField(points, np.tile([0.0, 0.0, 1.0], (9, 1)))
    heights = np.array([-0.01, -0.001, 0.0, 0.003])
    places = np.column_stack([[0.002, 0.0, 0.001, -0.004], np.zeros(4), heights])
    np.testing.assert_allclose(field.value(places), heights, atol=1e-12)


def test_edge_feature_outlines_do_not_run_on_beyond_the_contacts() -> None:
    for seed in range(3):
        points, normals = contacts_on_polygon(rectangle(), 40, seed)
        contour = EdgeFeatureShape(EdgeFeatureField(points, normals), 1e-3).contour()
        assert contour.is_closed
        assert contour_errors(contour.points_m, rectangle()).hausdorff_m < 0.009
