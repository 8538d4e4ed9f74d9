"""The signed distance from a solid's surface, also where that surface is folded."""

from __future__ import annotations

import numpy as np
import trimesh

from tactile_lab.slam.shape.solids.solid_field import SolidField


def box_with_a_fold() -> trimesh.Trimesh:
    """A cube of 20 mm about the origin, and beside it a triangle on top of the same one turned over."""
    box, corners = trimesh.creation.box((0.02, 0.02, 0.02)), np.array([[14, 0, 0], [18, 0, 0], [14, 4, 0]]) / 1000
    faces = np.vstack([box.faces, len(box.vertices) + np.array([[0, 1, 2], [0, 2, 1]])])
    return trimesh.Trimesh(np.vstack([box.vertices, corners]), faces, process=False)


def test_beside_a_fold_the_distance_is_that_to_its_edge_and_grows_away_from_it() -> None:
    places_m = np.array([[0.016, -0.001, 0.0], [0.016, -0.002, 0.001]])
    found = SolidField(box_with_a_fold(), 0.001).predict(places_m, gradient=True)
    away_m = places_m - [0.016, 0.0, 0.0]
    lengths_m = np.linalg.norm(away_m, axis=1)
    np.testing.assert_allclose(found.mean_m, lengths_m, atol=1e-9)
    np.testing.assert_allclose(found.gradient, away_m / lengths_m[:, None], atol=1e-6)


def test_inside_the_solid_a_fold_is_the_nearest_surface_and_the_distance_negative() -> None:
    mesh = box_with_a_fold()
    mesh.vertices[-3:] = np.array([[0, 0, 0], [4, 0, 0], [0, 4, 0]]) / 1000
    found = SolidField(mesh, 0.001).predict(np.array([[0.002, -0.001, 0.0]]), gradient=True)
    np.testing.assert_allclose(found.mean_m, -0.001, atol=1e-9)
    np.testing.assert_allclose(found.gradient, [[0.0, 1.0, 0.0]], atol=1e-6)


def test_everywhere_else_it_is_the_distance_from_the_box() -> None:
    places_m = np.array([[0.0, 0.0, 0.008], [0.0, 0.0, 0.013], [-0.015, 0.002, 0.001]])
    found = SolidField(box_with_a_fold(), 0.001).predict(places_m, gradient=True)
    np.testing.assert_allclose(found.mean_m, [-0.002, 0.003, 0.005], atol=1e-9)
    np.testing.assert_allclose(found.gradient, [[0, 0, 1], [0, 0, 1], [-1, 0, 0]], atol=1e-9)
