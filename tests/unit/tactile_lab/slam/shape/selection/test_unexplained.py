"""Contacts off a surface in groups, and the parts that they make up beside a sharp solid."""

from __future__ import annotations

import numpy as np
import pytest
import trimesh

from drivers.core.contacts import Array
from tactile_lab.slam.shape.fields.gpis import Gpis
from tactile_lab.slam.shape.model import FittedShape
from tactile_lab.slam.shape.selection.unexplained import are_inside, unexplained
from tactile_lab.slam.shape.solids.with_parts import WithParts
from tactile_lab.slam.shape.surfaces.sampling import distances_to_mesh
from tactile_lab.slam.shape.surfaces.surface import Contour, SurfaceMesh
from tests.support.shape_examples import NORMAL_SIGMA_rad, POINT_SIGMA_m

HALF_m = 0.03
BOX: trimesh.Trimesh = trimesh.creation.box((2 * HALF_m,) * 3)


class Box:
    """A box about the origin, known without error."""

    name, log_evidence = "box", 100.0

    def contour(self, resolution_m: float = 0.001) -> Contour:
        raise NotImplementedError

    def mesh(self, resolution_m: float = 0.003, floor_m: float | None = None) -> SurfaceMesh:
        fine = BOX.subdivide_to_size(0.006)
        normals, sigma_m = np.asarray(fine.vertex_normals), np.full(len(fine.vertices), 0.0005)
        return SurfaceMesh(np.asarray(fine.vertices), np.asarray(fine.faces, dtype=np.int64), sigma_m, normals, True)


def on_knob() -> tuple[Array, Array]:
    """Contacts on a ball of 16 mm diameter, 20 mm from the box: on the far side of it alone."""
    ways = np.array([[1.0, 0, 0], [0, 1, 0], [0, -1, 0], [0, 0, 1], [0.7, 0.7, 0], [0.7, -0.7, 0]])
    ways /= np.linalg.norm(ways, axis=1, keepdims=True)
    return np.array([HALF_m + 0.028, 0.0, 0.0]) + 0.008 * ways, ways


def test_contacts_near_each_other_are_one_group_and_those_on_the_surface_none() -> None:
    points_m = np.array([[0.06, 0, 0], [0.07, 0, 0], [0, -0.06, 0], [0, 0, 0.034], [0.002, 0, 0], [-0.03, 0, 0]])
    found = unexplained(points_m, BOX, far_m=0.010, together_m=0.020)
    assert [(sorted(group.members.tolist()), group.is_inside) for group in found] == [
        ([0, 1], False),
        ([2], False),
        ([4], True),
    ]
    assert found[0].farthest_m == pytest.approx(0.07 - HALF_m)
    assert unexplained(np.empty((0, 3)), BOX, far_m=0.010, together_m=0.020) == []
    assert are_inside(points_m[:5], BOX).tolist() == [False, False, False, False, True]


def test_a_part_is_joined_to_the_solid_and_the_rest_of_that_stays() -> None:
    points_m, normals = on_knob()
    field = Gpis.fit(points_m, normals, POINT_SIGMA_m, NORMAL_SIGMA_rad)
    body: FittedShape = Box()
    shape = WithParts.of(body, field, np.ones(len(points_m), dtype=bool), None)
    assert shape.name == "box with a part"
    surface = shape.mesh()
    solid = trimesh.Trimesh(surface.vertices, surface.faces, process=False)
    assert solid.is_watertight
    assert len(solid.split()) == 1
    assert abs(solid.bounds[1, 0] - 0.066) < 0.003
    assert np.abs(solid.bounds[0] + HALF_m).max() < 0.001
    far = surface.vertices[:, 0] < 0.0
    assert surface.sigma_m[far].max() < 0.001
    assert distances_to_mesh(surface.vertices[far], BOX).max() < 0.0015
