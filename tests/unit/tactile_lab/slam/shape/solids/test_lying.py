"""Bottles on their side, felt from above and from both sides, and what leans."""

from __future__ import annotations

import numpy as np
import pytest
import trimesh

from drivers.core.contacts import Array
from drivers.core.errors import ShapeError
from tactile_lab.experiments.data.household import turned
from tactile_lab.slam.shape.fields.gpis import Gpis
from tactile_lab.slam.shape.solids.lying import Leaning, Lying
from tactile_lab.slam.shape.surfaces.sampling import distances_to_mesh, sample_mesh_with_normals

HEADING_rad = np.deg2rad(33.0)
POINT_SIGMA_m, NORMAL_SIGMA_rad = 0.0005, 0.05


def lying(mesh: trimesh.Trimesh) -> trimesh.Trimesh:
    """Its axis along a heading, on the table at height zero."""
    laid = mesh.copy()
    laid.apply_transform(trimesh.transformations.rotation_matrix(np.pi / 2, [0, 1, 0]))  # type: ignore[no-untyped-call]
    laid.apply_transform(trimesh.transformations.rotation_matrix(HEADING_rad, [0, 0, 1]))  # type: ignore[no-untyped-call]
    laid.apply_translation([0.02, -0.01, -laid.bounds[0, 2]])
    return laid


def felt(mesh: trimesh.Trimesh, count: int = 50) -> Gpis:
    """Contacts all over what does not look down, with noise."""
    rng = np.random.default_rng(3)
    points_m, normals = sample_mesh_with_normals(mesh, 4000)
    chosen = rng.choice(np.flatnonzero((normals[:, 2] > -0.3) & (points_m[:, 2] > 0.001)), count, replace=False)
    points_m = points_m[chosen] + POINT_SIGMA_m * rng.normal(size=(count, 3))
    ways: Array = normals[chosen] + NORMAL_SIGMA_rad * rng.normal(size=(count, 3))
    ways /= np.linalg.norm(ways, axis=1, keepdims=True)
    return Gpis.fit(points_m, ways, POINT_SIGMA_m, NORMAL_SIGMA_rad).optimise(max_iterations=5)


def test_a_bottle_on_its_side() -> None:
    bottle = lying(turned([0, 32, 35, 35, 30, 17, 14, 14, 0], [-65, -65, -61, 12, 32, 47, 53, 65, 65]))
    shape = Lying.fit(felt(bottle), 0.0)
    axis = shape.along[2]
    assert abs(axis[:2] @ [np.cos(HEADING_rad), np.sin(HEADING_rad)]) == pytest.approx(1.0, abs=0.001)
    mesh = shape.mesh()
    assert trimesh.Trimesh(mesh.vertices, mesh.faces, process=False).is_watertight
    assert mesh.vertices[:, 2].min() == pytest.approx(0.0, abs=0.0015)
    assert distances_to_mesh(bottle.vertices, mesh).max() < 0.008, "the end of its neck was hardly touched"
    assert distances_to_mesh(sample_mesh_with_normals(bottle, 500)[0], mesh).mean() < 0.001


def test_half_a_cylinder_is_cut_at_the_table() -> None:
    whole = lying(turned([0, 40, 40, 0], [-50, -50, 50, 50]))
    whole.apply_translation([0.0, 0.0, -0.040])
    mesh = Lying.fit(felt(whole), 0.0).mesh()
    assert mesh.vertices[:, 2].min() == 0.0
    over_table = whole.vertices[:, 2] > 0
    assert distances_to_mesh(whole.vertices[over_table], mesh).max() < 0.005


def test_a_box_has_no_axis() -> None:
    box = trimesh.creation.box([0.1, 0.06, 0.04])
    box.apply_translation([0.0, 0.0, 0.02])
    with pytest.raises(ShapeError):
        Lying.fit(felt(box), 0.0)


def leaning_tub(lean_rad: float) -> trimesh.Trimesh:
    """A solid of revolution that leans on the edge of its foot, its lowest point on the table."""
    tub = turned([0, 30, 40, 38, 0], [0, 0, 45, 90, 90])
    tub.apply_transform(trimesh.transformations.rotation_matrix(lean_rad, [1.0, 0.3, 0.0]))  # type: ignore[no-untyped-call]
    tub.apply_translation([0.01, -0.005, -tub.bounds[0, 2]])
    return tub


def test_what_leans_is_found_with_its_lean() -> None:
    shape = Leaning.fit(felt(leaning_tub(0.2), 90), 0.0)
    assert shape.name == "leaning turned"
    assert np.arccos(shape.along[2, 2]) == pytest.approx(0.2, abs=0.03)
    surface = shape.mesh()
    assert trimesh.Trimesh(surface.vertices, surface.faces, process=False).is_watertight
    assert surface.vertices[:, 2].min() == pytest.approx(0.0, abs=0.004)
    above = surface.vertices[:, 2] > 0.012
    assert distances_to_mesh(surface.vertices[above], leaning_tub(0.2)).max() < 0.003


def test_what_stands_or_is_not_round_does_not_lean() -> None:
    with pytest.raises(ShapeError, match="no axis leans"):
        Leaning.fit(felt(leaning_tub(0.0), 90), 0.0)
    with pytest.raises(ShapeError, match="do not meet an axis that leans"):
        Leaning.fit(felt(trimesh.creation.box([0.06, 0.05, 0.07]), 90), -0.035)
