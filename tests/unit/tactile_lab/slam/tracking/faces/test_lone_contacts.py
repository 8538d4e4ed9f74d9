"""Solids with a wrong contact that no face holds."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from tactile_lab.experiments.data import second_family
from tactile_lab.slam.shape.fields.settings import GpisSettings
from tactile_lab.slam.tracking.contacts.contact_map import ContactMap, PlacedGrasp
from tactile_lab.slam.tracking.contacts.contact_set import ContactSet
from tactile_lab.slam.tracking.contacts.motion import MotionNoise, planar_motion
from tactile_lab.slam.tracking.faces.faceted_scorer import FacetedScorer
from tactile_lab.slam.tracking.joint.hypotheses import HypothesisScorer
from tactile_lab.slam.tracking.joint.mechanisms import Mechanism, Mechanisms
from tactile_lab.slam.tracking.joint.proposals import UNEXPLAINED_COST

NOISE = MotionNoise(palm_m=second_family.PALM_SIGMA_m)
GRASP, NUMBER = 7, 2
"""Of the contact that is made wrong. One of sixty random ones leaves a wedge without faces."""


def test_a_contact_alone_on_its_face_does_not_keep_a_solid_from_having_faces() -> None:
    wedge = _wedge_with_a_wrong_contact()
    smooth, found = _scorer("without one").better(wedge), _scorer().better(wedge)
    assert smooth.map.left_out_count == 0
    assert found.cost < smooth.cost - 100
    assert found.map.left_out_count == 1
    assert found.map.placed[GRASP].left_out == {NUMBER}


def _scorer(*without: Mechanism) -> FacetedScorer:
    mechanisms = Mechanisms(frozenset(without))
    return FacetedScorer(HypothesisScorer(NOISE, UNEXPLAINED_COST, mechanisms), NOISE, mechanisms)


def _wedge_with_a_wrong_contact() -> ContactMap:
    placed = _placed("wedge")
    grasp = placed.placed[GRASP]
    points, normals = grasp.contacts_world.points_m.copy(), grasp.contacts_world.normals.copy()
    points[NUMBER] += [0.0049, -0.0039, 0.0238]
    normals[NUMBER] = np.array([0.499, 0.239, -0.833])
    wrong = replace(grasp.contacts_world, points_m=points, normals=normals)
    return placed.with_placed(GRASP, replace(grasp, contacts_world=wrong))


def _placed(shape: str) -> ContactMap:
    """Twelve grasps at their true poses."""
    data = second_family.simulate(shape, 43, dimension=3, count=12)
    grasps = [
        PlacedGrasp(
            ContactSet.of_grasp(grasp, 3, 0.0).without_free_places(),
            planar_motion(pose),
            1e-8 * np.eye(3),
            planar_motion(grasp.hand_motion_world),
        )
        for grasp, pose in zip(data.grasps, data.world_T_body, strict=True)
    ]
    return ContactMap(tuple(grasps), GpisSettings()).with_best_kernel()
