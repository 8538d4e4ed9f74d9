"""Parts of shapes that the data support, and honest sigmas."""

from __future__ import annotations

import numpy as np
import pytest

from drivers.core.contacts import Array
from tactile_lab.slam.shape.fields.gpis import Gpis
from tactile_lab.slam.shape.fields.settings import GpisSettings
from tactile_lab.slam.shape.surfaces.sampling import distances_to_polygon
from tactile_lab.slam.shape.surfaces.surface import (
    Contour,
    extract_contour,
    extract_mesh,
    supported_mesh,
    supported_pieces,
)
from tests.support.shape_examples import contacts_on_box, contacts_on_polygon, ellipse, noisy, rectangle

NORMAL_SIGMA_rad = float(np.deg2rad(5))


def field(outline: Array, count: int, seed: int) -> Gpis:
    points, normals = contacts_on_polygon(outline, count, seed)
    return Gpis.fit(points, normals, 0.001, NORMAL_SIGMA_rad).optimise()


@pytest.mark.parametrize("outline", [rectangle(), ellipse()], ids=["rectangle", "ellipse"])
@pytest.mark.parametrize("count", [20, 60])
def test_the_outline_of_a_field_errs_by_less_than_two_sigma_nearly_everywhere(outline: Array, count: int) -> None:
    contours = [extract_contour(field(outline, count, seed)) for seed in range(8)]
    covered = [np.mean(distances_to_polygon(one.points_m, outline) < 2 * one.sigma_m) for one in contours]
    assert 0.90 < np.mean(covered) < 0.99


def test_sigma_grows_for_sharp_shapes_only() -> None:
    assert np.mean([field(rectangle(), 40, seed).sigma_inflation for seed in range(4)]) > 1.15
    assert np.mean([field(ellipse(), 40, seed).sigma_inflation for seed in range(4)]) < 1.06


def test_off_surface_points_do_not_tell_of_the_model_error() -> None:
    thesis = GpisSettings(observations="offsurface", kernel="thin_plate", prior_mean="zero")
    assert Gpis.fit(*contacts_on_polygon(rectangle(), 20, 0), settings=thesis).sigma_inflation == 1.0


def test_an_outline_is_cut_where_sigma_is_above_the_limit() -> None:
    sigma = np.array([1.0, 1.0, 9.0, 9.0, 1.0, 9.0, 1.0, 1.0])
    contour = Contour(np.column_stack([np.arange(8.0), np.zeros(8)]), sigma, is_closed=True)
    pieces = supported_pieces(contour, 2.0)
    assert [piece.points_m[:, 0].tolist() for piece in pieces] == [[4.0], [6.0, 7.0, 0.0, 1.0]]
    assert not any(piece.is_closed for piece in pieces)
    assert supported_pieces(contour, 10.0) == [contour]
    assert supported_pieces(contour, 0.5) == []


def test_untouched_sides_are_not_supported() -> None:
    points, normals = contacts_on_polygon(rectangle(), 60, seed=0)
    touched = points[:, 0] < 0.03
    contour = extract_contour(Gpis.fit(points[touched], normals[touched]).optimise())
    pieces = supported_pieces(contour, 0.002)
    assert max(piece.points_m[:, 0].max() for piece in pieces) < contour.points_m[:, 0].max()
    assert max(piece.sigma_m.max() for piece in pieces) <= 0.002


def test_a_surface_keeps_the_faces_that_the_data_support() -> None:
    points, normals = noisy(*contacts_on_box(np.array([0.08, 0.05, 0.05]), 60, seed=0), seed=0)
    touched = points[:, 0] < 0.02
    mesh = extract_mesh(Gpis.fit(points[touched], normals[touched]), resolution_m=0.006)
    limit = float(np.median(mesh.sigma_m))
    part = supported_mesh(mesh, limit)
    assert 0 < len(part.faces) < len(mesh.faces)
    assert part.sigma_m.max() <= limit
    assert part.faces.max() == len(part.vertices) - 1
    assert not part.is_closed
    assert supported_mesh(mesh, 1.0) is mesh
