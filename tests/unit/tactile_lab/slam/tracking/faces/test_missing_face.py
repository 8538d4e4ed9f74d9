"""A face that every grasp was turned away from is found, and none is made up."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from drivers.core.contacts import Array
from tactile_lab.experiments.data import second_family
from tactile_lab.slam.shape.fields.settings import GpisSettings
from tactile_lab.slam.tracking.contacts.contact_map import ContactMap, PlacedGrasp
from tactile_lab.slam.tracking.contacts.contact_set import ContactSet
from tactile_lab.slam.tracking.contacts.motion import MotionNoise, planar_motion
from tactile_lab.slam.tracking.faces.faceted_scorer import FacetedScorer
from tactile_lab.slam.tracking.faces.flat_faces import flat_faces
from tactile_lab.slam.tracking.faces.missing_face import with_missing_face
from tactile_lab.slam.tracking.joint.hypotheses import HypothesisScorer

NOISE = MotionNoise(palm_m=second_family.PALM_SIGMA_m)
SHARP = FacetedScorer(HypothesisScorer(NOISE, 2.0), NOISE)
TURN_rad = 2 * np.pi / 8


@pytest.fixture(scope="module")
def octagon() -> ContactMap:
    """Sixteen grasps at their true poses; faces have contacts at multiples of an eighth turn."""
    data = second_family.simulate("octagonal-prism", 31)
    placed = [
        PlacedGrasp(
            ContactSet.of_grasp(grasp, 2, 0.0),
            planar_motion(pose),
            np.eye(3) * 1e-6,
            planar_motion(grasp.hand_motion_world),
        )
        for grasp, pose in zip(data.grasps, data.world_T_body, strict=True)
    ]
    return ContactMap(tuple(placed), GpisSettings()).with_best_kernel()


def touched(contact_map: ContactMap, index: int) -> Array:
    """Faces that a grasp touches, 0 to 7."""
    normals = contact_map.contacts.normals[contact_map.grasp_indices == index]
    return np.round(np.arctan2(normals[:, 1], normals[:, 0]) / TURN_rad - 0.5).astype(int) % 8


def turned_away(contact_map: ContactMap, face: int) -> ContactMap:
    """Every grasp turned by eighths until none of its contacts is on a face."""
    rows = contact_map.rows
    for index in range(len(rows)):
        faces = touched(contact_map, index)
        turns = next(k for k in (0, 1, -1, 2, -2, 3, -3, 4) if face not in (faces - k) % 8)
        rows[index, 2] += turns * TURN_rad
    return contact_map.with_rows(rows)


def test_the_missing_face_of_an_octagon_is_found(octagon: ContactMap) -> None:
    given = SHARP.better(turned_away(octagon, 3))
    assert flat_faces(given.map)[0].count == 7
    found = with_missing_face(given, SHARP, NOISE)
    faces, _ = flat_faces(found.map)
    assert faces.count == 8
    assert np.ptp(faces.offsets_m) < 0.004 + np.ptp(flat_faces(octagon)[0].offsets_m)
    assert found.map.rows[0].tolist() == pytest.approx(given.map.rows[0].tolist())


def test_whole_outlines_and_long_sessions_stay(octagon: ContactMap) -> None:
    whole = SHARP.better(octagon)
    assert with_missing_face(whole, SHARP, NOISE) is whole
    seven = SHARP.better(turned_away(octagon, 3))
    settled = replace(seven, map=replace(seven.map, archive=seven.map.placed[:1]))
    assert with_missing_face(settled, SHARP, NOISE) is settled
