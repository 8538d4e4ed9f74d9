"""Figures of merit of a run."""

from __future__ import annotations

from typing import Literal

import numpy as np
import pytest

from tactile_lab.experiments.data import planar_data, spatial_data
from tactile_lab.experiments.data.outlines import OUTLINES_m
from tactile_lab.experiments.data.sensing import SimulatedGrasps
from tactile_lab.experiments.data.solids import solid
from tactile_lab.experiments.run_metrics import NO_SIZES, contour_figures, mesh_figures, size_figures, slam_figures
from tactile_lab.slam.result import SlamResult
from tactile_lab.slam.shape.surfaces.surface import Contour, SurfaceMesh
from tactile_lab.slam.slam_settings import SlamSettings
from tactile_lab.slam.tactile_slam import TactileSlam


def test_the_truth_itself_has_no_error_and_is_covered() -> None:
    outline = OUTLINES_m["L"]
    found = contour_figures(Contour(outline + 0.01, np.full(len(outline), 0.001), True), outline)
    assert found["hausdorff_mm"] < 0.05
    assert found["within_2_sigma"] == 1.0
    mesh = solid("l-block").mesh
    sigma = np.full(len(mesh.vertices), 1e-3)
    normals = np.asarray(mesh.vertex_normals)
    surface = SurfaceMesh(np.asarray(mesh.vertices), np.asarray(mesh.faces, dtype=np.int64), sigma, normals, True)
    assert mesh_figures(surface, mesh)["hausdorff_mm"] < 0.3
    assert mesh_figures(None, mesh)["hausdorff_mm"] is None


def test_sizes_are_judged_by_their_own_sigma_where_both_ends_were_touched() -> None:
    true_m = np.array([[0.0, 0.0], [0.10, 0.0], [0.10, 0.06], [0.0, 0.06]])
    found_m, sigma_m = true_m * [1.01, 1.0], np.full(4, 0.001)
    known = np.array([True, True, True, False])
    found = size_figures(Contour(found_m, sigma_m, is_closed=True, known=known), true_m)
    assert found["size_off_mm"] == pytest.approx([1.0, 0.0], abs=1e-9)
    assert found["size_z"] == pytest.approx([0.5, 0.0], abs=1e-9)
    guess = Contour(found_m, sigma_m, is_closed=True, known=np.array([True, False, False, True]))
    assert len(size_figures(guess, true_m)["size_z"]) == 1
    assert size_figures(None, true_m) == NO_SIZES


@pytest.mark.parametrize("motion", ["table", "free"])
def test_a_run_has_the_sizes_of_what_stands_on_a_table(motion: Literal["table", "free"]) -> None:
    data = spatial_data.simulate("ellipsoid", 0, motion=motion, count=3)
    result = _known_poses_run(data, 3, "table" if motion == "table" else "space")
    whole = size_figures(result.mesh, np.asarray(data.mesh.vertices))
    assert whole["size_z"]
    assert slam_figures(data, result)["size_z"] == (whole["size_z"] if motion == "table" else [])


def test_a_run_in_the_plane_has_the_sizes_of_its_outline() -> None:
    data = planar_data.simulate("rectangle", 0, count=4)
    result = _known_poses_run(data, 2, "table")
    assert slam_figures(data, result)["size_z"] == size_figures(result.contour, data.outline_m)["size_z"] != []


def _known_poses_run(data: SimulatedGrasps, dimension: Literal[2, 3], freedom: Literal["table", "space"]) -> SlamResult:
    settings = SlamSettings(method="known-pose", dimension=dimension, freedom=freedom, mesh_resolution_m=0.01)
    slam = TactileSlam(settings, 0, known_poses=data.world_T_body)
    for grasp in data.grasps:
        slam.add_grasp(grasp)
    return slam.finish()
