"""Registration of round solids, whose own turns no contact can tell."""

from __future__ import annotations

import numpy as np
from gtsam import Pose2

from tactile_lab.evaluation.registration import registration_rms_mm
from tactile_lab.experiments.merit import contour_figures, mesh_figures, without_own_turns
from tactile_lab.experiments.outlines import OUTLINES_m
from tactile_lab.experiments.sensing import planar_pose
from tactile_lab.experiments.solids import solid
from tactile_lab.experiments.spatial_data import simulate
from tactile_lab.geometry.poses import spatial
from tactile_lab.shape.surface import Contour, SurfaceMesh


def test_turns_about_the_own_axis_do_not_count_but_shifts_do() -> None:
    data, rng = simulate("cylinder", 0, count=8), np.random.default_rng(0)
    contacts = [grasp.points_world_m for grasp in data.grasps]
    born = spatial(Pose2(0.01, -0.02, 0.7))

    def registration(shift_m: float) -> tuple[float, float]:
        slips = [planar_pose(shift_m * rng.normal(size=2), rng.normal(0.0, 1.0)) for _ in contacts]
        estimate = [pose * spatial(slip) * born for pose, slip in zip(data.world_T_body, slips, strict=True)]
        plain = registration_rms_mm(contacts, estimate, data.world_T_body, 3)
        turned = registration_rms_mm(contacts, without_own_turns(estimate, data.world_T_body), data.world_T_body, 3)
        assert plain is not None
        assert turned is not None
        return plain, turned

    plain, turned = registration(0.0)
    assert plain > 10.0
    assert turned < 1e-6
    _, turned = registration(0.004)
    assert 2.0 < turned < 8.0


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
