"""Faces of contours and solids, and grasps that share them."""

from __future__ import annotations

import numpy as np
import pytest

from tactile_lab.experiments.data.outlines import OUTLINES_m
from tactile_lab.slam.graph.faces import (
    NO_FACE,
    FaceSettings,
    assign_to_segments,
    cluster_by_normals,
    contour_segments,
    split_by_paths,
    surface_faces,
)
from tactile_lab.slam.graph.similarity import SimilaritySettings, shared_contacts
from tactile_lab.slam.tracking.contacts.contact_set import ContactSet

SETTINGS = FaceSettings()


def dense(outline_m: np.ndarray) -> np.ndarray:
    ends = np.roll(outline_m, -1, axis=0)
    shares = np.linspace(0.0, 1.0, 40, endpoint=False)[:, None]
    return np.concatenate([a + shares * (b - a) for a, b in zip(outline_m, ends, strict=True)])


def on_outline(name: str, per_edge: int, seed: int = 0) -> tuple[ContactSet, np.ndarray]:
    """Contacts on every edge, and the edges' numbers."""
    rng, outline = np.random.default_rng(seed), OUTLINES_m[name]
    along = np.roll(outline, -1, axis=0) - outline
    edges = np.repeat(np.arange(len(outline)), per_edge)
    points = outline[edges] + rng.uniform(0.15, 0.85, len(edges))[:, None] * along[edges]
    normals = np.column_stack([along[:, 1], -along[:, 0]])[edges]
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    noisy = points + rng.normal(size=points.shape) * 1e-3
    return ContactSet(noisy, normals, np.full(len(edges), 1e-3), np.full(len(edges), 0.1)), edges


def partition(labels: np.ndarray) -> set[frozenset[int]]:
    return {frozenset(np.flatnonzero(labels == label).tolist()) for label in np.unique(labels)}


@pytest.mark.parametrize("name", ["rectangle", "triangle", "L", "hexagon"])
def test_a_contour_is_divided_into_its_sides(name: str) -> None:
    segments = contour_segments(dense(OUTLINES_m[name]), SETTINGS)
    contacts, edges = on_outline(name, 4)
    assert len(segments.starts_m) == len(OUTLINES_m[name])
    assert partition(assign_to_segments(contacts, segments, SETTINGS)) == partition(edges)


def test_segments_do_not_depend_on_where_the_contour_starts() -> None:
    contour = dense(OUTLINES_m["L"])
    lengths = [
        np.sort(np.linalg.norm(found.ends_m - found.starts_m, axis=1))
        for found in (contour_segments(np.roll(contour, shift, axis=0), SETTINGS) for shift in (0, 17, 101))
    ]
    assert np.allclose(lengths[0], lengths[1])
    assert np.allclose(lengths[0], lengths[2])


def test_contacts_far_from_every_side_or_facing_wrongly_have_no_face() -> None:
    segments = contour_segments(dense(OUTLINES_m["rectangle"]), SETTINGS)
    contacts = ContactSet(
        np.array([[0.08, 0.0], [0.05, 0.0]]), np.array([[1.0, 0.0], [-1.0, 0.0]]), np.full(2, 1e-3), np.full(2, 0.1)
    )
    assert np.all(assign_to_segments(contacts, segments, SETTINGS) == NO_FACE)


def test_equal_normals_share_a_cluster() -> None:
    normals = np.array([[1, 0, 0], [0, 0, 1], [0.99, 0.1, 0], [0, -1, 0], [0.05, 0, 1]], dtype=float)
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    assert partition(cluster_by_normals(normals, 0.5)) == {frozenset({0, 2}), frozenset({1, 4}), frozenset({3})}


def test_parallel_faces_with_another_between_them_are_divided() -> None:
    """A staircase: two treads of one normal, joined by a riser."""
    steps = np.linspace(0.0, 0.03, 7)
    lower = np.column_stack([steps, np.zeros(7), np.zeros(7)])
    riser = np.column_stack([np.full(7, 0.034), np.zeros(7), steps + 0.003])
    upper = np.column_stack([steps + 0.038, np.zeros(7), np.full(7, 0.037)])
    labels = np.repeat([0, 1, 0], 7)
    found = split_by_paths(np.vstack([lower, riser, upper]), labels, neighbours=3)
    assert partition(found) == {frozenset(range(7)), frozenset(range(7, 14)), frozenset(range(14, 21))}


def test_one_face_stays_one() -> None:
    grid = np.stack(np.meshgrid(np.arange(5), np.arange(4)), axis=-1).reshape(-1, 2) * 0.01
    points = np.column_stack([grid, np.zeros(20)])
    assert len(np.unique(split_by_paths(points, np.zeros(20, dtype=np.int64), neighbours=4))) == 1


def test_a_box_has_its_faces() -> None:
    rng = np.random.default_rng(1)
    half = np.array([0.06, 0.03, 0.03])
    axes = np.repeat([0, 0, 1, 1, 2], 12)
    signs = np.repeat([1, -1, 1, -1, 1], 12)
    points = rng.uniform(-0.85, 0.85, (60, 3)) * half
    points[np.arange(60), axes] = signs * half[axes]
    normals = np.zeros((60, 3))
    normals[np.arange(60), axes] = signs
    faces = surface_faces(ContactSet(points, normals, np.full(60, 1e-3), np.full(60, 0.1)), SETTINGS)
    for label in np.unique(faces):
        assert len(np.unique(axes[faces == label] * 2 + signs[faces == label])) == 1
    assert len(np.unique(faces)) <= 8


def test_grasps_on_three_sides_are_similar() -> None:
    contacts, edges = on_outline("rectangle", 2)
    first, second = np.arange(0, 8, 2), np.arange(1, 8, 2)
    shared = shared_contacts(contacts, edges, first, second, SimilaritySettings())
    assert shared.similar
    assert shared.faces == 4
    assert np.array_equal(edges[shared.earlier], edges[shared.later])


def test_grasps_on_two_sides_are_not_and_the_reason_says_so() -> None:
    contacts, edges = on_outline("rectangle", 2)
    shared = shared_contacts(contacts, edges, np.array([0, 2]), np.array([1, 3]), SimilaritySettings())
    assert not shared.similar
    assert "2 shared faces, 3 needed" in shared.reason


def test_enough_faces_may_still_be_unobservable() -> None:
    """Three faces of one normal: sliding along them is free."""
    contacts = ContactSet(
        np.array([[0.0, 0.0], [0.02, 0.01], [0.04, 0.0]] * 2), np.tile([0.0, 1.0], (6, 1)), np.full(6, 1e-3), np.ones(6)
    )
    faces = np.array([0, 1, 2, 0, 1, 2])
    shared = shared_contacts(contacts, faces, np.arange(3), np.arange(3, 6), SimilaritySettings())
    assert shared.faces == 3
    assert "not observable" in shared.reason


def test_contacts_without_a_face_are_not_paired() -> None:
    contacts, _ = on_outline("rectangle", 2)
    none = np.full(8, NO_FACE)
    assert shared_contacts(contacts, none, np.arange(4), np.arange(4, 8), SimilaritySettings()).faces == 0
