"""Figures over what was touched, and nothing else."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import trimesh
from gtsam import Pose3

from drivers.core.contacts import Array, Grasp
from drivers.core.poses import rotate, transform_points
from tactile_lab.experiments.data.planar_data import simulate_section
from tactile_lab.experiments.data.spatial_data import SpatialGrasps, simulate
from tactile_lab.experiments.touched_metrics import (
    NOTHING_TOUCHED,
    touched_figures,
    touched_outline_figures,
)
from tactile_lab.slam.result import SlamResult
from tactile_lab.slam.shape.fields.gpis import Gpis
from tactile_lab.slam.shape.surfaces.sampling import sample_polygon
from tactile_lab.slam.shape.surfaces.surface import Contour, SurfaceMesh


def touched_at_low_x() -> SpatialGrasps:
    """A box of 120 mm along x with contacts on its lower half of x alone."""
    data = simulate("box-12x6x6", 3001, count=12)
    pairs = zip(data.grasps, data.world_T_body, strict=True)
    return replace(data, grasps=tuple(_low(grasp, pose) for grasp, pose in pairs))


def _low(grasp: Grasp, world_T_body: Pose3) -> Grasp:
    x = transform_points(world_T_body.inverse(), grasp.points_world_m)[:, 0]
    return replace(grasp, contacts=tuple(c for c, low in zip(grasp.contacts, x < 0, strict=True) if low))


def told(data: SpatialGrasps, mesh: trimesh.Trimesh, sigma_m: float) -> SlamResult:
    """A result that tells a mesh, in the body's frame."""
    pairs = [(g, p.inverse()) for g, p in zip(data.grasps, data.world_T_body, strict=True) if g.contacts]
    points: Array = np.vstack([transform_points(pose, grasp.points_world_m) for grasp, pose in pairs])
    normals = np.vstack([rotate(pose, grasp.normals_world) for grasp, pose in pairs])
    vertices, faces = trimesh.remesh.subdivide_to_size(mesh.vertices, mesh.faces, 0.004)
    outward = np.asarray(trimesh.Trimesh(vertices, faces, process=False).vertex_normals)
    surface = SurfaceMesh(vertices, np.asarray(faces), np.full(len(vertices), sigma_m), outward, True)
    return SlamResult("joint", 0, 3, (), (), (), (), Gpis.fit(points, normals), None, surface, "complete")


def box(longer_m: float = 0.0, wider_m: float = 0.0) -> trimesh.Trimesh:
    """The box, longer at its end of high x, or wider on both sides."""
    mesh = trimesh.creation.box((0.12 + longer_m, 0.06 + 2 * wider_m, 0.06))
    mesh.apply_translation([longer_m / 2, 0.0, 0.0])
    return mesh


def test_what_nobody_touched_does_not_count() -> None:
    data = touched_at_low_x()
    found = touched_figures(data, told(data, box(longer_m=0.03), 1e-3))
    assert found["touched_hausdorff_mm"] < 0.7
    assert found["touched_within_2_sigma"] == 1.0
    assert 0.2 < found["touched_share"] < 0.6


def test_errors_where_it_was_touched_do() -> None:
    data = touched_at_low_x()
    found = touched_figures(data, told(data, box(wider_m=0.004), 1e-3))
    assert 3.5 < found["touched_hausdorff_mm"] < 8
    assert found["touched_within_2_sigma"] < 0.7


def test_without_a_surface_there_are_no_figures() -> None:
    data = touched_at_low_x()
    assert touched_figures(data, replace(told(data, box(), 1e-3), mesh=None)) == NOTHING_TOUCHED


@pytest.mark.parametrize(("name", "least_mm"), [("cup", 60), ("wedge", 30)])
def test_grasps_at_all_heights_reach_from_the_foot_to_the_top(name: str, least_mm: float) -> None:
    data = simulate(name, 3001, heights="all", count=12)
    heights = np.concatenate([grasp.points_world_m[:, 2] for grasp in data.grasps])
    assert 1e3 * np.ptp(heights) > least_mm
    assert heights.min() < 0.025


@pytest.mark.parametrize(("wider_m", "within"), [(0.0, 1.0), (0.004, 0.0)])
def test_in_the_plane_what_lies_near_a_contact_counts(wider_m: float, within: float) -> None:
    data = simulate_section("wedge", 3001, height_share=0.25, motion_scale=0.1, count=12)
    assert np.ptp(data.outline_m, axis=0) == pytest.approx([0.1, 0.06])
    outline_m = data.outline_m * (1 + wider_m / np.abs(data.outline_m).max(axis=0))
    grasps, poses = data.grasps, data.world_T_body
    points = np.vstack([transform_points(p.inverse(), g.points_world_m) for g, p in zip(grasps, poses, strict=True)])
    normals = np.vstack([rotate(p.inverse(), g.normals_world) for g, p in zip(grasps, poses, strict=True)])
    dense_m = sample_polygon(outline_m, 0.001)
    contour = Contour(dense_m, np.full(len(dense_m), 0.001), is_closed=True)
    field = Gpis.fit(points[:, :2], normals[:, :2])
    found = touched_outline_figures(data, SlamResult("joint", 0, 2, (), (), (), (), field, contour, None, "complete"))
    assert found["touched_hausdorff_mm"] == pytest.approx(1e3 * wider_m * np.sqrt(2), abs=0.1)
    assert found["touched_within_2_sigma"] == pytest.approx(within, abs=0.05)
    assert found["touched_share"] > 0.9
