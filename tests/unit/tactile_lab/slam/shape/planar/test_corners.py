"""Contacts at corners: found among others, no faces of their own, and what they tell."""

from __future__ import annotations

import numpy as np
import pytest

from drivers.core.contacts import Array
from tactile_lab.slam.shape.fields.gpis import Gpis
from tactile_lab.slam.shape.metrics.metrics import contour_errors
from tactile_lab.slam.shape.planar.polygon import Polygon
from tactile_lab.slam.shape.selection.planar_choice import best_shape, outline_of
from tactile_lab.slam.shape.surfaces.surface import extract_contour
from tests.support.shape_examples import NORMAL_SIGMA_rad, POINT_SIGMA_m, contacts_on_polygon, l_block, rectangle


def straddled(outline: Array, corner: int, count: int, seed: int) -> tuple[Array, Array]:
    """Contacts of fingertips that straddle a convex corner."""
    rng = np.random.default_rng(seed)
    before, after = outline[corner] - outline[corner - 1], outline[(corner + 1) % len(outline)] - outline[corner]
    ends = [np.arctan2(-along[0], along[1]) for along in (before, after)]
    angles = ends[0] + rng.uniform(0.2, 0.8, count) * ((ends[1] - ends[0]) % (2 * np.pi))
    points = outline[corner] + rng.normal(0.0, POINT_SIGMA_m, (count, 2))
    return points, np.column_stack([np.cos(angles), np.sin(angles)])


def fitted(outline: Array, corners: tuple[int, ...], seed: int, each: int = 2) -> tuple[Gpis, Array]:
    """A field of contacts on all faces and at some corners, and which of them are at corners."""
    points, normals = contacts_on_polygon(outline, 48, seed)
    leaning = [straddled(outline, corner, each, seed + corner) for corner in corners]
    points = np.vstack([points, *(pair[0] for pair in leaning)])
    normals = np.vstack([normals, *(pair[1] for pair in leaning)])
    gpis = Gpis.fit(points, normals, POINT_SIGMA_m, NORMAL_SIGMA_rad).optimise()
    return gpis, np.arange(len(points)) >= 48


@pytest.mark.parametrize("seed", range(4))
def test_straddled_corners_are_neither_faces_nor_errors(seed: int) -> None:
    gpis, leaning = fitted(rectangle(), (0, 1, 3), seed)
    polygon, found = outline_of(gpis, extract_contour(gpis))
    assert polygon.faces.count == 4
    assert np.mean(found[leaning]) >= 0.8
    assert np.mean(found[~leaning]) <= 0.05
    assert contour_errors(polygon.outline_m, rectangle()).hausdorff_m < 0.002


def test_an_object_with_straddled_corners_still_has_sharp_ones() -> None:
    gpis, _ = fitted(rectangle(), (0, 1, 2, 3), seed=0)
    shape = best_shape(gpis)
    assert isinstance(shape, Polygon)
    assert contour_errors(shape.contour().points_m, rectangle()).hausdorff_m < 0.002


def test_a_face_between_two_others_is_no_corner() -> None:
    outline = rectangle()
    cut = np.vstack([outline[0] + [0.012, 0.0], outline[1:], outline[0] + [0.0, 0.012]])
    points, normals = contacts_on_polygon(cut, 80, seed=3)
    gpis = Gpis.fit(points, normals, POINT_SIGMA_m, NORMAL_SIGMA_rad).optimise()
    polygon, _ = outline_of(gpis, extract_contour(gpis))
    assert polygon.faces.count == 5


def test_contacts_on_faces_alone_lie_at_no_corner() -> None:
    for outline in (rectangle(), l_block()):
        gpis, _ = fitted(outline, (), seed=5)
        assert outline_of(gpis, extract_contour(gpis))[1].sum() <= 1


def test_contacts_at_corners_make_the_polygon_likelier_where_they_belong_only() -> None:
    gpis, leaning = fitted(rectangle(), (0, 2), seed=1)
    polygon, _ = outline_of(gpis, extract_contour(gpis))
    at_corners = polygon.corners.chi_squares(polygon.corner_contacts)
    on_faces = polygon.corners.chi_squares(polygon.contacts)
    assert leaning.sum() == len(at_corners)
    assert at_corners.max() < np.median(on_faces)
