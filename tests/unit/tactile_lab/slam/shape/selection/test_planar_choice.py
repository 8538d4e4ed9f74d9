"""Which shape model is chosen: by evidence and by what is known to be free, never by name."""

from __future__ import annotations

import numpy as np
import pytest

from drivers.core.contacts import Array
from tactile_lab.slam.shape.fields.gpis import Gpis
from tactile_lab.slam.shape.fields.gpis_shape import GpisShape
from tactile_lab.slam.shape.fields.settings import GpisSettings
from tactile_lab.slam.shape.metrics.metrics import contour_errors
from tactile_lab.slam.shape.model import FittedShape
from tactile_lab.slam.shape.planar.outlines import is_simple
from tactile_lab.slam.shape.selection.planar_choice import best_shape
from tactile_lab.slam.shape.surfaces.sampling import polygon_area
from tests.support.shape_examples import (
    contacts_on_box,
    contacts_on_polygon,
    ellipse,
    l_block,
    noisy,
    rectangle,
    triangle,
)


def stadium(half_m: float = 0.03, radius_m: float = 0.025) -> Array:
    angles = np.linspace(-np.pi / 2, np.pi / 2, 60)
    right = np.column_stack([half_m + radius_m * np.cos(angles), radius_m * np.sin(angles)])
    return np.vstack([right, -right])


def hexagon(radius_m: float = 0.045) -> Array:
    angles = np.arange(6) * np.pi / 3
    return radius_m * np.column_stack([np.cos(angles), np.sin(angles)])


def chosen(outline: Array, count: int, seed: int) -> FittedShape:
    return best_shape(Gpis.fit(*contacts_on_polygon(outline, count, seed)).optimise())


@pytest.mark.parametrize(
    ("outline", "names", "largest_m"),
    [
        (rectangle(), "polygon", 0.0015),
        (rectangle(0.06, 0.06), "polygon", 0.0015),
        (hexagon(), "polygon", 0.0022),
        (triangle(), "polygon", 0.002),
        (l_block(), "polygon", 0.0018),
        (ellipse(), "gpis", 0.0018),
        (stadium(), "gpis or rounded", 0.0020),
    ],
)
def test_forty_contacts_give_the_right_model_and_a_good_outline(outline: Array, names: str, largest_m: float) -> None:
    shapes = [chosen(outline, 40, seed) for seed in range(2)]
    assert {shape.name for shape in shapes} <= set(names.split(" or "))
    errors = [contour_errors(shape.contour().points_m, outline).hausdorff_m for shape in shapes]
    assert np.mean(errors) < largest_m


@pytest.mark.parametrize("outline", [rectangle(), l_block(), ellipse(), stadium()], ids=["rect", "L", "ell", "stad"])
@pytest.mark.parametrize("count", [6, 12, 20])
def test_few_contacts_never_give_a_crossed_outline(outline: Array, count: int) -> None:
    for seed in range(5):
        contour = chosen(outline, count, seed).contour()
        assert is_simple(contour.points_m)
        assert polygon_area(contour.points_m) > 0


def test_places_known_to_be_free_speak_against_a_model() -> None:
    points, normals = contacts_on_polygon(rectangle(), 40, seed=0)
    field = Gpis.fit(points, normals).optimise()
    sharp = best_shape(field)
    assert sharp.name == "polygon"
    in_the_corners = np.repeat(0.95 * rectangle(), 60, axis=0)
    assert best_shape(field, in_the_corners).name == "gpis"
    assert best_shape(field, 1.2 * rectangle()).name == "polygon"


@pytest.mark.parametrize(("turn_deg", "name"), [(0, "gpis"), (60, "polygon")])
def test_a_contact_that_continues_a_face_far_beyond_its_end_speaks_against_a_model(turn_deg: float, name: str) -> None:
    """It tells of sides that nobody has touched; one that points elsewhere is just wrong."""
    points, normals = contacts_on_polygon(rectangle(), 40, seed=0)
    turn = np.radians(-90 + turn_deg)
    corner = rectangle().max(axis=0)
    beyond = np.vstack([points, [corner[0] + 0.02, -corner[1]]])
    with_one = Gpis.fit(beyond, np.vstack([normals, [np.cos(turn), np.sin(turn)]])).optimise()
    assert best_shape(with_one).name == name


def test_evidence_of_the_chosen_model_is_the_larger_one() -> None:
    field = Gpis.fit(*contacts_on_polygon(rectangle(), 40, seed=0)).optimise()
    sharp, smooth = best_shape(field).log_evidence, GpisShape(field).log_evidence
    assert sharp is not None
    assert smooth is not None
    assert sharp > smooth


def test_off_surface_points_have_no_comparable_evidence_and_stay_a_field() -> None:
    thesis = GpisSettings(observations="offsurface", kernel="thin_plate", prior_mean="zero")
    shape = best_shape(Gpis.fit(*contacts_on_polygon(rectangle(), 40, seed=0), settings=thesis))
    assert shape.name == "gpis"
    assert shape.log_evidence is None


def test_contacts_on_one_side_stay_a_field() -> None:
    points, normals = contacts_on_polygon(rectangle(), 60, seed=0)
    one_side = normals[:, 1] > 0.7
    assert best_shape(Gpis.fit(points[one_side], normals[one_side])).name == "gpis"


def test_a_field_in_space_gives_a_mesh() -> None:
    points, normals = noisy(*contacts_on_box(np.array([0.05, 0.05, 0.05]), 40, seed=0), seed=0)
    assert len(GpisShape(Gpis.fit(points, normals)).mesh(0.006).faces) > 100
