"""Figures over what a fingertip can get to, touched or not."""

from __future__ import annotations

import json

import numpy as np
import pytest
import trimesh

from tactile_lab.experiments.reach import reached_metrics
from tactile_lab.experiments.reach.reached_metrics import NOTHING_KNOWN, reach_figures
from tactile_lab.slam.shape.surfaces.surface import SurfaceMesh


@pytest.fixture(autouse=True)
def few_places(monkeypatch: pytest.MonkeyPatch) -> None:
    """Each costs a look at every posture of the hand."""
    monkeypatch.setattr(reached_metrics, "_PLACES", 200)


def box(wider_m: float = 0.0) -> trimesh.Trimesh:
    """A box that may be wider on both sides; its middle is the origin."""
    return trimesh.creation.box((0.12, 0.06 + 2 * wider_m, 0.06))


def model(mesh: trimesh.Trimesh, sigma_m: float) -> SurfaceMesh:
    vertices, faces = trimesh.remesh.subdivide_to_size(mesh.vertices, mesh.faces, 0.004)
    outward = np.asarray(trimesh.Trimesh(vertices, faces, process=False).vertex_normals)
    return SurfaceMesh(vertices, np.asarray(faces), np.full(len(vertices), sigma_m), outward, True)


@pytest.mark.parametrize(
    ("sigma_m", "wider_m", "share", "off_mm"), [(1e-3, 0.0, 1.0, 0.0), (1e-3, 0.012, 0.55, 13.0), (4e-3, 0.0, 0.0, 0.0)]
)
def test_known_is_where_the_model_is_near_and_says_so(
    sigma_m: float, wider_m: float, share: float, off_mm: float
) -> None:
    found = reach_figures(model(box(wider_m), sigma_m), box())
    assert found["known_share"] == pytest.approx(share, abs=0.12)
    assert found["reach_hausdorff_mm"] == pytest.approx(off_mm, abs=2.0)


@pytest.mark.parametrize(("side", "off_mm"), [(1.0, 20.0), (-1.0, 0.0)])
def test_a_dent_counts_in_the_top_and_not_in_the_underside(side: float, off_mm: float) -> None:
    whole = model(box(), 1e-3)
    x, y, z = np.abs(whole.vertices).T
    is_in_it = (x < 0.02) & (y < 0.01) & (z > 0.029) & (side * whole.vertices[:, 2] > 0)
    dented_m = whole.vertices - np.outer(is_in_it, [0.0, 0.0, 0.02 * side])
    found = reach_figures(SurfaceMesh(dented_m, whole.faces, whole.sigma_m, whole.normals, True), box())
    assert found["reach_hausdorff_mm"] == pytest.approx(off_mm, abs=2.0)


def test_nothing_is_known_without_a_model() -> None:
    found = reach_figures(None, box())
    assert found == NOTHING_KNOWN
    json.dumps(found, allow_nan=False)
