"""A solid that stays where it stands, grasped from candidates."""

from __future__ import annotations

import numpy as np
import pytest

from drivers.core.contacts import FINGERS
from tactile_lab.experiments.data.fixed_solid import FixedSolid
from tactile_lab.experiments.data.solids import solid
from tactile_lab.slam.shape.surfaces.sampling import nearest_on_mesh


@pytest.fixture(scope="module")
def cube() -> FixedSolid:
    """A cube after a grasp by every third candidate."""
    found = FixedSolid(solid("cube-6"), np.random.default_rng(5))
    for candidate in found.candidates()[::3]:
        found.grasp(candidate)
    return found


def test_contacts_lie_on_the_surface_as_far_as_the_sensors_can_tell(cube: FixedSolid) -> None:
    away_m, _ = nearest_on_mesh(cube.points_m, cube.true_mesh)
    assert np.sqrt(np.mean(away_m**2)) == pytest.approx(0.001, rel=0.25)


def test_it_stands_on_the_table(cube: FixedSolid) -> None:
    assert cube.true_mesh.bounds[0, 2] == pytest.approx(0.0, abs=1e-9)


def test_grasps_reach_all_sides_and_the_top_but_not_the_underside(cube: FixedSolid) -> None:
    middle = np.array([0.0, 0.0, 0.03])
    for way in ([1, 0, 0], [-1, 0, 0], [0, 1, 0], [0, -1, 0], [0, 0, 1]):
        assert ((cube.points_m - middle) @ way > 0.027).sum() > 5
    assert (cube.normals[:, 2] > -0.6).all()


def test_the_middle_finger_presses_on_the_top(cube: FixedSolid) -> None:
    pressing = [contact for grasp in cube.contacts for contact in grasp if contact.finger == FINGERS[1]]
    assert np.mean([contact.normal_world[2] > 0.8 for contact in pressing]) > 0.95


def test_every_contact_has_the_number_of_its_grasp(cube: FixedSolid) -> None:
    assert len(cube.grasp_indices) == len(cube.points_m)
    assert cube.grasp_indices.tolist() == sorted(cube.grasp_indices.tolist())
    assert cube.grasp_indices[-1] == len(cube.contacts) - 1
