"""Ground between two parallel faces that nothing touched: bridged by the provisional outline, unless it strays."""

from __future__ import annotations

import numpy as np
import pytest

from drivers.core.contacts import Array
from tactile_lab.slam.shape.planar.joints import JointMaker
from tactile_lab.slam.shape.planar.segmentation import Faces, PlanarContacts
from tactile_lab.slam.shape.surfaces.surface import Contour

WIDTH_m, HEIGHT_m, SIGMA_m = 0.05, 0.02, 0.001
ALONG = np.linspace(0.0, WIDTH_m, 4)


def maker(provisional: Array | None) -> JointMaker:
    """Joints of a slab touched below and above; the outline between is provisional."""
    below, above = np.column_stack([ALONG, 0 * ALONG]), np.column_stack([ALONG[::-1], 0 * ALONG + HEIGHT_m])
    normals = np.repeat([[0.0, -1.0], [0.0, 1.0]], len(ALONG), axis=0)
    contacts = PlanarContacts.of(np.vstack([below, above]), normals, SIGMA_m, 0.1)
    faces = Faces(
        labels=np.repeat([0, 1], len(ALONG)),
        directions_rad=np.array([-np.pi / 2, np.pi / 2]),
        offsets_m=np.array([0.0, HEIGHT_m]),
        order=np.arange(2 * len(ALONG)),
        chi_square=0.0,
        direction_groups=np.array([0, 0]),
    )
    outline = None if provisional is None else Contour(provisional, np.full(len(provisional), 0.002), True)
    return JointMaker(contacts, faces, outline)


def slab_that_bulges(to_m: float) -> Array:
    """A closed outline whose right end is a nose of that length beyond the slab's."""
    out = np.linspace(WIDTH_m, WIDTH_m + to_m, 30)
    nose = np.vstack([np.column_stack([out, 0 * out]), np.column_stack([out[::-1], 0 * out + HEIGHT_m])])
    return np.vstack(
        [np.column_stack([ALONG, 0 * ALONG])[:-1], nose, np.column_stack([ALONG[::-1], 0 * ALONG + HEIGHT_m])[1:]]
    )


def test_a_short_way_round_is_taken_from_the_provisional_outline() -> None:
    joint = maker(slab_that_bulges(0.02)).between(0, 1)
    np.testing.assert_allclose(joint.points_m[[0, -1]], [[WIDTH_m, 0.0], [WIDTH_m, HEIGHT_m]], atol=1e-12)
    assert joint.points_m[:, 0].max() == pytest.approx(WIDTH_m + 0.02)
    step_m = np.linalg.norm(joint.points_m[1] - joint.points_m[0])
    np.testing.assert_allclose(joint.sigma_m[[0, 1]], [SIGMA_m, np.hypot(0.002, 0.5 * step_m)])
    assert joint.sigma_m.argmax() in (len(joint.sigma_m) // 2 - 1, len(joint.sigma_m) // 2)


@pytest.mark.parametrize("provisional", [slab_that_bulges(0.10), None])
def test_without_an_outline_or_where_it_makes_a_detour_the_bridge_is_straight(provisional: Array | None) -> None:
    joint = maker(provisional).between(0, 1)
    np.testing.assert_allclose(joint.points_m[:, 0], WIDTH_m)
    np.testing.assert_allclose(joint.points_m[[0, -1], 1], [0.0, HEIGHT_m], atol=1e-12)
    assert joint.sigma_m[0] == joint.sigma_m[-1] == pytest.approx(SIGMA_m)
    assert joint.sigma_m.max() == pytest.approx(SIGMA_m + HEIGHT_m / 4)
