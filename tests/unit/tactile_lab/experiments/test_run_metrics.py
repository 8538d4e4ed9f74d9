"""Figures of merit of a run."""

from __future__ import annotations

import numpy as np

from tactile_lab.experiments.data.outlines import OUTLINES_m
from tactile_lab.experiments.data.solids import solid
from tactile_lab.experiments.run_metrics import contour_figures, mesh_figures
from tactile_lab.slam.shape.surfaces.surface import Contour, SurfaceMesh


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
