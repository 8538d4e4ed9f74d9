"""Numbers of flat faces and the poses they hold, compared with those stored: any change of them is told."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from tactile_lab.slam.shape.planar.segmentation import price_of_face
from tactile_lab.slam.tracking.contacts.contact_map import ContactMap
from tactile_lab.slam.tracking.contacts.motion import MotionNoise
from tactile_lab.slam.tracking.faces.face_extents import between_ends, overhang
from tactile_lab.slam.tracking.faces.facet_certainty import FacetCertainty
from tactile_lab.slam.tracking.faces.facet_smoothing import FacetedTrajectory, FacetSmoother, smoothed_with_faces
from tactile_lab.slam.tracking.faces.faceted_scorer import FacetedScorer
from tactile_lab.slam.tracking.faces.flat_faces import FlatFaces, flat_faces, tangents
from tactile_lab.slam.tracking.faces.regular_faces import made_regular
from tactile_lab.slam.tracking.faces.relocalization import Relocalizer
from tactile_lab.slam.tracking.faces.solid_face_extents import solid_face_extents
from tactile_lab.slam.tracking.joint.hypotheses import Hypothesis, HypothesisScorer
from tactile_lab.slam.tracking.joint.mechanisms import Mechanisms
from tactile_lab.slam.tracking.joint.proposals import ProposalSettings
from tests.support.baseline import assert_baseline
from tests.support.baseline_problems import KINDS, Kind, session, told, true_placed
from tests.support.digest import digest

NOISE = MotionNoise(translation_m=0.006, rotation_rad=0.2, palm_m=0.001)


def known(kind: Kind, count: int = 6) -> ContactMap:
    """A rectangle or a block with a step, its grasps a little beside the truth."""
    return true_placed(session(kind, count=count), kind, off=0.5)


def described(faces: FlatFaces) -> dict[str, Any]:
    return {
        "labels": faces.labels,
        "normals": faces.normals,
        "offsets": faces.offsets_m,
        "leaning": faces.leaning,
        "bounded": faces.bounded,
        "irregularity": faces.irregularity(),
    }


def fitted(found: FacetedTrajectory) -> dict[str, Any]:
    costs = [found.chi_square, found.motion_cost, found.cost, found.description_length(7.0)]
    return {"rows": found.rows, "costs": costs, **described(found.faces)}


def scorer(mechanisms: Mechanisms | None = None) -> FacetedScorer:
    return FacetedScorer(HypothesisScorer(NOISE, 2.0, mechanisms), NOISE, mechanisms)


def maybe(one: Hypothesis | None) -> dict[str, Any] | None:
    return None if one is None else told(one)


def test_contacts_beyond_the_corners_of_an_outline() -> None:
    """An outline with right angles, a notch and one corner too flat to end a face; contacts on and beyond each side."""
    angles = np.array([0.0, 1.4, 1.6, 2.9, 3.3, 4.7])
    normals, offsets = (
        np.column_stack([np.cos(angles), np.sin(angles)]),
        np.array([0.05, 0.03, 0.031, 0.04, 0.04, 0.03]),
    )
    labels = np.arange(24) % 6
    along = np.column_stack([-normals[:, 1], normals[:, 0]])
    reach = 0.06 * np.cos(1.1 * np.arange(24))
    points = offsets[labels, None] * normals[labels] + reach[:, None] * along[labels]
    found = overhang(points, labels, normals, offsets)
    values = {
        "beyond": found.beyond_m,
        "ways": found.ways,
        "by offsets": found.by_offsets,
        "between": between_ends(points, labels, normals, offsets, np.linspace(0.001, 0.01, 24)),
    }
    assert_baseline("tracking/faces/overhang", values)


@pytest.mark.parametrize("kind", KINDS)
def test_poses_and_faces_smoothed_together(kind: Kind) -> None:
    """A few steps of the optimiser with the faces found, with them made regular and with the ends of a solid; what
    follows from moved contacts; and faces merged while that pays.
    """
    contact_map = known(kind)
    rows, world = contact_map.rows, contact_map.contacts_world
    faces, neighbours = flat_faces(contact_map)
    smoother = FacetSmoother(contact_map, NOISE)
    regular = made_regular(contact_map, faces, smoother.information(rows, faces))
    price = price_of_face(world.point_sigma_m, world.normal_sigma_rad)
    values: dict[str, Any] = {
        "faces": described(faces),
        "neighbours": neighbours(faces),
        "tangents": tangents(faces.normals),
        "merged": described(faces.merge(0, 1)),
        "regular": described(regular),
        "one step": fitted(smoother.fit(rows, faces, 1)),
        "three regular steps": fitted(smoother.fit(rows, regular, 3)),
        "information": digest(smoother.information(rows, regular)),
        "response": digest(smoother.response(rows, faces, world.shared.displacements_m())),
        "simplified": fitted(smoother.simplify(rows, faces, 3 * price, neighbours)),
    }
    if kind != "plane":
        ends = solid_face_extents(contact_map, faces)
        bound = FacetSmoother(contact_map, NOISE, ends)
        points, normals = contact_map.contacts.points_m, faces.normals
        values["ends"] = [ends.contacts, ends.faces, digest(ends.strengths)]
        values["beyond"] = digest(ends.beyond(points, normals, faces.offsets_m))
        near = replace(faces, offsets_m=faces.offsets_m - 0.004)
        values["between ends"] = fitted(bound.fit(rows, near, 2))
    settled = smoothed_with_faces(contact_map, NOISE)
    assert settled is not None
    values["settled"] = fitted(settled)
    assert_baseline(f"tracking/faces/smoothing-{kind}", values, rtol=1e-5, atol=1e-7)


def divided(contact_map: ContactMap) -> FlatFaces:
    """Its faces, each with four contacts or more divided in two."""
    faces, _ = flat_faces(contact_map)
    labels, normals, offsets = faces.labels.copy(), list(faces.normals), list(faces.offsets_m)
    for face in range(faces.count):
        mine = np.flatnonzero(labels == face)
        if len(mine) >= 4:
            labels[mine[1::2]] = len(normals)
            normals.append(faces.normals[face])
            offsets.append(faces.offsets_m[face] + 0.0005)
    return FlatFaces(labels, np.array(normals), np.array(offsets), faces.leaning, np.zeros_like(faces.bounded))


def all_pairs(given: FlatFaces) -> list[tuple[int, int]]:
    return [(one, other) for other in range(given.count) for one in range(other)]


@pytest.mark.parametrize("price", [0.3, 2.0, 7.0])
@pytest.mark.parametrize("kind", ["plane", "table"])
def test_faces_divided_too_far_are_merged(kind: Kind, price: float) -> None:
    """Which halves are put together again, at three prices."""
    contact_map = known(kind, 5)
    found = FacetSmoother(contact_map, NOISE).simplify(contact_map.rows, divided(contact_map), price, all_pairs)
    assert_baseline(f"tracking/merged-faces/{kind}-{price:g}", fitted(found), rtol=1e-4, atol=1e-6)


@pytest.mark.parametrize("kind", ["plane", "table"])
def test_what_a_merger_is_expected_to_cost(kind: Kind) -> None:
    """Each pair of halves and of faces that are nearly flat, after one step of the optimiser."""
    contact_map = known(kind, 5)
    smoother = FacetSmoother(contact_map, NOISE)
    at = smoother.fit(contact_map.rows, divided(contact_map), 1)
    costs = smoother._merger_costs(at, all_pairs(at.faces))
    assert_baseline(f"tracking/merged-faces/expected-{kind}", {str(each): costs[each] for each in costs}, rtol=1e-4)


@pytest.mark.parametrize("kind", KINDS)
def test_how_certain_poses_and_faces_are(kind: Kind) -> None:
    """Information of the poses, and how points of the surface follow poses and what contacts of a finger share."""
    contact_map = known(kind)
    certainty = FacetCertainty.of(contact_map, NOISE)
    seen = contact_map.contacts
    places, normals = seen.points_m[::3] * 1.1, seen.normals[::3]
    values = {
        "poses": digest(certainty.information_of_poses),
        "faces by poses": digest(certainty.faces_by_poses),
        "by fingers": digest(certainty.faces_by_fingers),
        "by contacts": digest(certainty.faces_by_contacts),
        "surface": digest(certainty.surface_change(places, normals)),
        "shared": certainty.shared_change(places, normals)[:6],
        "each": digest(certainty.shared_change_each(places, normals)),
        "regularities": len(certainty.faces.regularities),
    }
    assert_baseline(f"tracking/faces/certainty-{kind}", values, rtol=1e-5, atol=1e-8)


def test_a_point_belongs_to_the_face_nearest_in_place_and_normal() -> None:
    """Points near edges of a block, with normals between those of two faces: each follows one of them."""
    certainty = FacetCertainty.of(known("table"), NOISE)
    normals = certainty.faces.normals
    turns = np.linspace(0.0, 1.0, 41)[:, None]
    between = turns * normals[0] + (1 - turns) * normals[1]
    between /= np.linalg.norm(between, axis=1, keepdims=True)
    places = certainty.faces.offsets_m[0] * normals[0] + 0.9 * certainty.faces.offsets_m[1] * normals[1] * turns
    assert_baseline(
        "tracking/faces/nearest-face", {"by poses": certainty.surface_change(places, between).sum(axis=1)}, rtol=1e-5
    )


@pytest.mark.parametrize("kind", ["plane", "table"])
def test_hypotheses_scored_by_faces(kind: Kind) -> None:
    """A hypothesis with one wrong contact and one left out wrongly: smoothed, doubted, made regular, settled."""
    contact_map = known(kind, 5)
    grasp = contact_map.placed[2]
    seen = grasp.contacts_world
    moved = seen.points_m.copy()
    moved[0] += 0.012 * seen.normals[0] * np.array([1.0, -1.0, 0.5])[: contact_map.dimension]
    contact_map = contact_map.with_placed(2, replace(grasp, contacts_world=replace(seen, points_m=moved)))
    doubtful = contact_map.without_contact(3, 1)
    mechanisms = Mechanisms()
    sharp = scorer(mechanisms)
    better = sharp.better(doubtful)
    values: dict[str, Any] = {
        "better": told(better),
        "without errors": [sorted(one.left_out) for one in sharp.without_errors(contact_map).placed],
        "regular": told(sharp.regular(better)),
        "smooth with facets": maybe(sharp.smooth_with_facets(doubtful)),
        "changed": sorted(mechanisms.changed),
    }
    if kind == "plane":
        values["without faces"] = told(scorer(Mechanisms(frozenset({"faces"}))).better(doubtful))
        faceless = scorer(Mechanisms(frozenset({"faces"}))).without_errors(contact_map)
        values["without errors or faces"] = [sorted(one.left_out) for one in faceless.placed]
        values["without doubts"] = told(scorer(Mechanisms(frozenset({"doubts"}))).better(doubtful))
    else:
        mesh = sharp.solid(better)
        values["settled"] = maybe(sharp.settle(doubtful))
        values["solid"] = (
            None if mesh is None else [len(mesh.vertices), mesh.vertices.mean(axis=0), np.ptp(mesh.vertices, axis=0)]
        )
    assert_baseline(f"tracking/faces/scored-{kind}", values, rtol=3e-4, atol=1e-5)


@pytest.mark.parametrize("kind", ["plane", "table"])
def test_a_grasp_in_the_wrong_place_is_searched(kind: Kind) -> None:
    """A grasp turned by a quarter: the place it is given, the costs, and the rivals that were tried."""
    contact_map = known(kind)
    rows = contact_map.rows
    rows[4] = contact_map.space.move(rows[4], np.array([0.012, -0.01, 1.5]))
    wrong = contact_map.with_rows(rows)
    if kind == "plane":
        wrong = wrong.without_contact(4, 0)
    sharp = scorer()
    start = sharp.better(wrong) if kind == "plane" else sharp.settle(wrong)
    assert start is not None
    search = Relocalizer(sharp, NOISE, ProposalSettings(samples=48))
    found = search.improve(start)
    values = {"start": told(start), "found": told(found), "rivals": [one.cost for one in search.rivals]}
    assert_baseline(f"tracking/faces/relocalized-{kind}", values, rtol=3e-4, atol=1e-5)
