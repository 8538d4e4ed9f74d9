"""At the end of a session errors of fingers are estimated where the object has flat faces, and only there."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from drivers.core.contacts import Contact
from tactile_lab.experiments.data import planar_data
from tactile_lab.experiments.data.planar_data import PlanarGrasps
from tactile_lab.experiments.data.sensing import with_finger_errors
from tactile_lab.slam.result import SlamResult
from tactile_lab.slam.tactile_slam import TactileSlam
from tests.support.simulated_contacts import registration_mm


def summed_up(contact: Contact) -> Contact:
    """The contact, its finger's errors stated by their sum."""
    moves = contact.shared_moves_m
    assert moves is not None
    return replace(contact, shared_moves_m=None, shared_covariance_m2=moves @ moves.T)


def finished(data: PlanarGrasps) -> SlamResult:
    slam = TactileSlam()
    for grasp in data.grasps:
        slam.add_grasp(grasp)
    return slam.finish()


@pytest.mark.parametrize(("shape", "has_faces"), [("rectangle", True), ("ellipse", False)])
def test_only_flat_faces_tell_errors(shape: str, has_faces: bool) -> None:
    data = with_finger_errors(planar_data.simulate(shape, 3, count=5), 0.0008, np.random.default_rng(3))
    grasps = [replace(grasp, contacts=tuple(map(summed_up, grasp.contacts))) for grasp in data.grasps]
    stated, summed = finished(data), finished(replace(data, grasps=tuple(grasps)))
    assert stated.contour is not None
    assert summed.contour is not None
    same = np.array_equal(stated.contour.sigma_m, summed.contour.sigma_m)
    assert same is not has_faces
    if has_faces:
        assert stated.contour.shared_sigma_m < summed.contour.shared_sigma_m
        assert registration_mm(data, stated) < 2.0
    else:
        np.testing.assert_array_equal(stated.contour.points_m, summed.contour.points_m)
