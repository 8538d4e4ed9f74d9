"""Faces that are made regular while the poses give way."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from drivers.core.contacts import Array
from tactile_lab.slam.tracking.contacts.contact_map import ContactMap
from tactile_lab.slam.tracking.contacts.motion import MotionNoise
from tactile_lab.slam.tracking.faces.facet_smoothing import FacetSmoother
from tactile_lab.slam.tracking.faces.faceted_scorer import FacetedScorer
from tactile_lab.slam.tracking.faces.flat_faces import FlatFaces, flat_faces, tangents
from tactile_lab.slam.tracking.faces.regular_faces import made_regular
from tactile_lab.slam.tracking.joint.hypotheses import HypothesisScorer
from tests.support.simulated_contacts import true_map

NOISE = MotionNoise()
CASES = [("rectangle", 2), ("L", 2), ("box-12x6x6", 3), ("l-block", 3)]


def settled(contact_map: ContactMap) -> tuple[ContactMap, FlatFaces, Array]:
    """The map with poses and faces smoothed together, the faces, and what is known of both."""
    smoother = FacetSmoother(contact_map, NOISE)
    at = smoother.fit(contact_map.rows, flat_faces(contact_map)[0], 20)
    return contact_map.with_rows(at.rows), at.faces, smoother.information(at.rows, at.faces)


def regular(contact_map: ContactMap) -> FlatFaces:
    return made_regular(*settled(contact_map))


def away_mm(contact_map: ContactMap, faces: FlatFaces) -> float:
    """RMS distance of the contacts from their faces."""
    seen = contact_map.contacts
    away_m = np.sum(seen.points_m * faces.normals[faces.labels], axis=1) - faces.offsets_m[faces.labels]
    return float(1e3 * np.sqrt(np.mean(away_m**2)))


@pytest.mark.parametrize(("shape", "dimension"), CASES)
def test_faces_meet_their_regularities_and_stay_with_their_contacts(shape: str, dimension: int) -> None:
    contact_map = true_map(shape, count=14, dimension=dimension)
    placed, faces, information = settled(contact_map)
    found = made_regular(placed, faces, information)
    assert len(found.regularities) >= found.count - 1
    assert np.abs(found.irregularity()).max() < 1e-6
    assert away_mm(placed, found) < 1.5 * away_mm(placed, faces) + 0.5


@pytest.mark.parametrize(("shape", "dimension"), CASES)
def test_how_regularities_change_with_the_faces(shape: str, dimension: int) -> None:
    found = regular(true_map(shape, count=14, dimension=dimension))
    # the axes by which parallel faces are compared turn with one of them
    faces = replace(found, regularities=tuple(each for each in found.regularities if each.kind != "parallel"))
    tilts = np.random.default_rng(0).normal(0.0, 1e-5, (faces.count, dimension - 1))
    moved = replace(faces, normals=faces.normals + np.einsum("sdt,st->sd", tangents(faces.normals), tilts))
    step = np.column_stack([tilts, np.ones(faces.count)])  # offsets do not matter
    foretold = np.einsum("rsd,sd->r", faces.irregularity_by_faces(), step)
    assert len(foretold) > 0
    assert foretold == pytest.approx(moved.irregularity() - faces.irregularity(), abs=1e-8)


def test_smoothed_faces_stay_regular() -> None:
    contact_map = true_map("box-12x6x6", count=14, dimension=3)
    found = FacetSmoother(contact_map, NOISE).fit(contact_map.rows, regular(contact_map), 20)
    assert np.abs(found.faces.irregularity()).max() < 1e-3
    assert FacetSmoother(contact_map, NOISE).fit(found.rows, found.faces, 20).cost == pytest.approx(
        found.cost, abs=0.01
    )


def test_what_poses_may_be_off_by_does_not_count_against_a_regularity() -> None:
    placed, faces, information = settled(true_map("rectangle", count=14))
    of_poses = len(information) - faces.normals.size
    held = information.copy()
    held[:of_poses, :of_poses] += 1e6 * np.diag(np.diag(information)[:of_poses])

    def largest_turn_deg(known: Array) -> int:
        """By how much the first face may be askew and is made regular all the same."""
        for degrees in range(1, 15):
            cosine, sine = np.cos(np.deg2rad(degrees)), np.sin(np.deg2rad(degrees))
            first = np.array([[cosine, -sine], [sine, cosine]]) @ faces.normals[0]
            found = made_regular(placed, replace(faces, normals=np.vstack([first, faces.normals[1:]])), known)
            if not any(0 in (each.face, each.other) for each in found.regularities):
                return degrees - 1
        return 15

    assert 0 < largest_turn_deg(held) < largest_turn_deg(information) < 10


@pytest.mark.parametrize(("shape", "dimension"), CASES)
def test_a_trajectory_gets_likelier_or_stays_as_it_is(shape: str, dimension: int) -> None:
    sharp = FacetedScorer(HypothesisScorer(NOISE, 5.0), NOISE)
    best = sharp.better(true_map(shape, count=14, dimension=dimension))
    assert sharp.regular(best).cost <= best.cost


def test_an_object_without_flat_faces_stays_as_it_is() -> None:
    sharp = FacetedScorer(HypothesisScorer(NOISE, 5.0), NOISE)
    best = sharp.better(true_map("ellipse", count=14))
    assert sharp.regular(best) is best
