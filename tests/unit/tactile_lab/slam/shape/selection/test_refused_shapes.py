"""What no shape can be made of is refused in words: nothing is drawn that the contacts do not tell."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
import trimesh

from drivers.core.contacts import Array
from drivers.core.errors import ShapeError
from tactile_lab.slam.shape.baselines.nagata import NagataShape
from tactile_lab.slam.shape.baselines.occupancy import OccupancyShape
from tactile_lab.slam.shape.baselines.point_cloud import PointCloudShape
from tactile_lab.slam.shape.fields.gpis import Gpis
from tactile_lab.slam.shape.fields.standing_field import StandingField
from tactile_lab.slam.shape.metrics.metrics import mesh_errors
from tactile_lab.slam.shape.selection.models import fit_shape
from tactile_lab.slam.shape.selection.planar_choice import best_shape
from tactile_lab.slam.shape.solids.polyhedron import Polyhedron
from tactile_lab.slam.shape.solids.prism import Prism
from tests.support.shape_examples import contacts_on_box, contacts_on_polygon, noisy, rectangle

SIZE_m = np.array([0.10, 0.06, 0.06])
ONE_mm = np.full(4, 1e-3)
CORNERS = np.array([[0.04, 0.04], [-0.04, 0.04], [-0.04, -0.04], [0.04, -0.04]])


@pytest.fixture(scope="module")
def on_box() -> Gpis:
    return Gpis.fit(*noisy(*contacts_on_box(SIZE_m, 60, seed=4), seed=4), 1e-3, 0.09)


@pytest.mark.parametrize("kind", ["prism", "standing field", "polyhedron"])
def test_a_solid_has_no_outline(on_box: Gpis, kind: str) -> None:
    solid = {
        "prism": lambda field: Prism.fit(field, best_shape),
        "standing field": lambda field: StandingField.fit(field, -0.03),
        "polyhedron": Polyhedron.fit,
    }[kind](on_box)
    with pytest.raises(ShapeError, match=r"a surface, not an outline\. Ask for the mesh"):
        solid.contour()


def test_a_solid_below_the_table_is_refused(on_box: Gpis) -> None:
    with pytest.raises(ShapeError, match="whole shape lies below the table"):
        Prism.fit(on_box, best_shape).mesh(floor_m=0.2)
    with pytest.raises(ShapeError, match="all contacts lie below the table"):
        StandingField.fit(on_box, 0.2)


@pytest.mark.parametrize("name", ["facets", "nagata", "point-cloud", "occupancy", "edge-features"])
def test_an_outline_has_no_surface(name: str) -> None:
    outlined = fit_shape(name, Gpis.fit(*contacts_on_polygon(rectangle(), 40, seed=0), 1e-3, 0.09))
    with pytest.raises(ShapeError, match=r"in the plane.* no surface"):
        outlined.mesh()


def test_contacts_in_turn_the_wrong_way_round_or_crossing_enclose_nothing() -> None:
    with pytest.raises(ShapeError, match="enclose nothing"):
        NagataShape.of(CORNERS, CORNERS, ONE_mm, np.array([3, 2, 1, 0]))
    with pytest.raises(ShapeError, match="enclose nothing"):
        NagataShape.of(CORNERS[:2], CORNERS[:2], ONE_mm[:2], np.array([0, 1]))
    crossing = np.array([[0.0, 0.0], [0.1, 0.0], [0.1, 0.1], [0.02, -0.01]])
    with pytest.raises(ShapeError, match="cross each other"):
        NagataShape.of(crossing, np.tile([1.0, 0.0], (4, 1)), ONE_mm, np.arange(4)).contour()


def test_contacts_on_one_side_of_an_objects_middle_have_no_patches() -> None:
    corner = np.vstack([np.zeros(3), 0.1 * np.eye(3)])
    with pytest.raises(ShapeError, match="all on one side of the object"):
        NagataShape.of(corner, np.vstack([-np.ones(3) / 3**0.5, np.eye(3)]), ONE_mm)


def test_contacts_in_other_units_would_need_too_large_a_grid() -> None:
    with pytest.raises(ShapeError, match=r"a grid of \d+ x \d+ cells is too large\. Check the units"):
        OccupancyShape.of(1e3 * CORNERS, CORNERS, ONE_mm)


def test_contacts_on_a_line_form_no_cloud() -> None:
    line = np.column_stack([np.linspace(0, 0.1, 6), np.zeros(6)])
    with pytest.raises(ShapeError, match="enclose nothing"):
        PointCloudShape.of(line, np.tile([0.0, 1.0], (6, 1)), np.full(6, 1e-3))


def test_a_mesh_with_a_vertex_at_no_place_is_not_compared() -> None:
    box = trimesh.creation.box((0.1, 0.06, 0.06))
    torn = box.copy()
    vertices: Array = np.array(torn.vertices)
    vertices[0, 0] = np.nan
    torn = trimesh.Trimesh(vertices, torn.faces, process=False)
    judged: list[Callable[[], object]] = [lambda: mesh_errors(torn, box), lambda: mesh_errors(box, torn)]
    for compare in judged:
        with pytest.raises(ShapeError, match="not numbers"):
            compare()
