"""What uncertain poses do to the stated uncertainty of a surface."""

from __future__ import annotations

from collections.abc import Callable
from functools import cache

import numpy as np
import pytest

from drivers.core.contacts import Array
from tactile_lab.experiments.data import spatial_data
from tactile_lab.slam.shape.fields.gpis_shape import GpisShape
from tactile_lab.slam.shape.fields.settings import GpisSettings
from tactile_lab.slam.shape.fields.standing_field import StandingField
from tactile_lab.slam.shape.planar.polygon import Polygon
from tactile_lab.slam.shape.selection.planar_choice import best_shape
from tactile_lab.slam.shape.solids.planes import fit_planes, weighted_contacts
from tactile_lab.slam.shape.solids.polyhedron import Polyhedron
from tactile_lab.slam.shape.solids.prism import Prism
from tactile_lab.slam.shape.surfaces.surface import SurfaceMesh
from tactile_lab.slam.tracking.contacts.contact_map import ContactMap, PlacedGrasp
from tactile_lab.slam.tracking.contacts.contact_set import ContactSet
from tactile_lab.slam.tracking.contacts.motion import MotionNoise
from tactile_lab.slam.tracking.contacts.spatial_pose_vectors import SPATIAL
from tactile_lab.slam.tracking.evidence.pose_evidence import PoseEvidence
from tactile_lab.slam.tracking.faces.facet_certainty import FacetCertainty
from tactile_lab.slam.tracking.faces.flat_faces import tangents
from tactile_lab.slam.tracking.joint.pose_uncertainty import propagate_pose_uncertainty
from tests.support.simulated_contacts import true_map

NOISE, HELD = MotionNoise(), MotionNoise(translation_m=1e-6, rotation_rad=1e-5)
TABLE_m, COARSE_m = 0.0, 0.006
MODELS: dict[str, Callable[[ContactMap], Polyhedron | Prism | StandingField]] = {
    "box-12x6x6": lambda known: Polyhedron.fit(known.fit()),
    "cylinder": lambda known: Prism.fit(known.fit(), best_shape),
    "sphere": lambda known: StandingField.fit(known.fit(), TABLE_m),
}


@cache
def doubted(shape: str, noise: MotionNoise = NOISE) -> tuple[SurfaceMesh, SurfaceMesh]:
    """The surface at the true poses with its own sigma, and with that of the poses."""
    known = true_map(shape, count=12, dimension=3)
    model = MODELS[shape](known)
    mesh = model.mesh(COARSE_m, TABLE_m)
    return mesh, propagate_pose_uncertainty(mesh, model, known, noise)


def nudged(known: ContactMap, step: Array) -> ContactMap:
    """The map with all poses but the first moved by a step of shape ((k - 1) * 3,)."""
    return known.with_rows(known.rows + np.vstack([np.zeros(3), step.reshape(-1, 3)]))


@pytest.mark.parametrize("shape", MODELS)
def test_poses_add_to_the_sigma_of_a_surface_and_change_nothing_else(shape: str) -> None:
    given, doubtful = doubted(shape)
    _, held = doubted(shape, HELD)
    assert doubtful.vertices is given.vertices
    assert np.all(doubtful.sigma_m >= held.sigma_m - 1e-9)
    added_mm = 1e3 * np.sqrt(np.median(doubtful.sigma_m**2 - held.sigma_m**2))
    assert 0.05 < added_mm < 1.0


def test_poses_are_in_doubt_from_the_second_grasp_on() -> None:
    def sigma_m(count: int) -> tuple[Array, Array, Array]:
        known = true_map("rectangle", count=count)
        model = GpisShape(known.fit())
        outline = model.contour(0.004)
        held, slipped = (propagate_pose_uncertainty(outline, model, known, noise).sigma_m for noise in (HELD, NOISE))
        return outline.sigma_m, held, slipped

    alone_m, *told_alone_m = sigma_m(1)
    assert all(told_m.tolist() == alone_m.tolist() for told_m in told_alone_m), "the first pose defines the frame"
    _, held_m, slipped_m = sigma_m(2)
    assert np.sqrt(np.median(slipped_m**2 - held_m**2)) > 1e-4


@pytest.mark.parametrize("shape", MODELS)
def test_where_the_object_hardly_slips_the_best_fit_only_takes(shape: str) -> None:
    """But for places that hardly count in the fit, as they are not well known."""
    given, doubtful = doubted(shape, HELD)
    assert np.all(doubtful.sigma_m < 1.15 * given.sigma_m + 2e-5)
    walls = np.abs(given.normals[:, 2]) < 1e-6
    if shape == "sphere":  # nothing is said of how its places are wrong together
        assert np.allclose(doubtful.sigma_m, given.sigma_m, atol=2e-5)
    else:
        assert np.median(doubtful.sigma_m[walls]) < 0.9 * np.median(given.sigma_m[walls])


def test_planes_move_a_surface_as_much_as_they_state() -> None:
    model = Polyhedron.fit(true_map("box-12x6x6", count=12, dimension=3).fit())
    mesh = model.mesh(COARSE_m, TABLE_m)
    moves = model.moves_m(mesh.vertices, mesh.normals)
    inner = np.abs(mesh.normals).max(axis=1) > 1 - 1e-9
    own_m = np.sqrt(np.sum(moves**2, axis=1))[inner & (mesh.normals[:, 2] > -0.5)]
    told_m = mesh.sigma_m[inner & (mesh.normals[:, 2] > -0.5)]
    assert np.all(own_m < told_m * 1.001)
    assert np.median(own_m / told_m) > 0.9


@pytest.mark.parametrize("shape", ["box-12x6x6", "cylinder"])
def test_a_level_top_is_as_certain_as_without_because_the_table_holds_the_object(shape: str) -> None:
    given, doubtful = doubted(shape)
    top = given.normals[:, 2] > 1 - 1e-6
    assert top.sum() > 3
    assert np.allclose(doubtful.sigma_m[top], given.sigma_m[top], atol=1e-4)


def test_faces_move_as_planes_fitted_anew_to_contacts_at_other_poses() -> None:
    known = true_map("box-12x6x6", count=12, dimension=3)
    certainty = FacetCertainty.of(known, NOISE)
    faces, seen = certainty.faces, known.contacts
    middles = np.array([seen.points_m[faces.labels == face].mean(axis=0) for face in range(faces.count)])
    step = np.random.default_rng(0).normal(size=33) * np.tile([2e-3, 2e-3, 2e-2], 11)
    moved = nudged(known, step).contacts
    weighted = weighted_contacts(moved.points_m, moved.normals, moved.point_sigma_m, moved.normal_sigma_rad)
    anew = fit_planes(weighted, faces.labels)
    away_m = anew.offsets_m - np.sum(middles * anew.normals, axis=1)
    foretold_m = certainty.surface_change(middles, faces.normals) @ step
    before_m = faces.offsets_m - np.sum(middles * faces.normals, axis=1)
    assert np.abs(foretold_m).max() > 3e-4
    assert np.allclose(foretold_m, away_m - before_m, atol=1e-4)


def test_the_field_follows_the_poses_as_foretold() -> None:
    known = true_map("sphere", count=12, dimension=3)
    places_m = known.contacts.points_m
    change = PoseEvidence(known, NOISE).field_change(known.rows, places_m)
    step = np.random.default_rng(0).normal(size=change.shape[1]) * np.tile([3e-4, 3e-4, 3e-3], change.shape[1] // 3)
    found_m = nudged(known, step).fit().mean(places_m) - known.fit().mean(places_m)
    foretold_m = change @ step
    assert np.corrcoef(found_m, foretold_m)[0, 1] > 0.9
    assert np.std(foretold_m) == pytest.approx(np.std(found_m), rel=0.3)


@pytest.mark.parametrize("shape", ["rectangle", "ellipse"])
def test_the_best_fit_takes_a_part_of_an_outlines_own_variance(shape: str) -> None:
    known = true_map(shape)
    model = best_shape(known.fit())
    assert isinstance(model, Polygon if shape == "rectangle" else GpisShape)
    outline = model.contour(0.002)
    told = propagate_pose_uncertainty(outline, model, known, HELD)
    covariance_m2 = model.covariance_m2(outline.points_m)
    assert np.all(np.diag(covariance_m2) <= outline.sigma_m**2 * 1.001)
    draws = np.linalg.cholesky(covariance_m2 + 1e-14 * np.eye(len(covariance_m2)))
    draws = draws @ np.random.default_rng(0).normal(size=(len(draws), 2000))
    arms, normals = outline.points_m - outline.points_m.mean(axis=0), outline.normals
    turning = arms[:, 0] * normals[:, 1] - arms[:, 1] * normals[:, 0]
    motions = np.column_stack([normals, turning])
    left = draws - motions @ np.linalg.lstsq(motions, draws, rcond=None)[0]
    hidden_m2 = outline.sigma_m**2 - np.diag(covariance_m2)
    assert told.sigma_m == pytest.approx(np.sqrt(left.var(axis=1) + hidden_m2), rel=0.15)
    assert told.sigma_m.mean() < 0.9 * outline.sigma_m.mean()


def test_faces_at_right_angles_stay_so_whatever_the_poses_do() -> None:
    certainty = FacetCertainty.of(true_map("box-12x6x6", seed=2, count=12, dimension=3), NOISE)
    normals = certainty.faces.normals
    step = np.random.default_rng(0).normal(size=33) * np.tile([2e-3, 2e-3, 2e-2], 11)
    tilts = (certainty.faces_by_poses @ step).reshape(-1, 3)[:, :2]
    turned = np.einsum("sdt,st->sd", tangents(normals), tilts)
    assert np.abs(turned[:, :2]).max() > 1e-3
    assert np.abs(turned[:, 2]).max() < 1e-4
    change = turned @ normals.T + normals @ turned.T
    assert np.abs(change).max() < 0.1 * np.abs(turned).max()


def test_an_object_held_free_in_space_is_doubted_too() -> None:
    data = spatial_data.simulate("ellipsoid", 0, motion="free", motion_scale=0.5, count=8)
    placed = []
    for grasp, pose in zip(data.grasps, data.world_T_body, strict=True):
        contacts, motion = ContactSet.of_grasp(grasp, 3, 0.0), SPATIAL.vector(grasp.hand_motion_world)
        placed.append(PlacedGrasp(contacts, SPATIAL.vector(pose), np.eye(6) * 1e-6, motion))
    held = ContactMap(tuple(placed), GpisSettings(), SPATIAL)
    model = GpisShape(held.fit())
    given = model.mesh(COARSE_m)
    doubtful = propagate_pose_uncertainty(given, model, held, NOISE)
    added_mm = 1e3 * np.sqrt(np.median(doubtful.sigma_m**2 - given.sigma_m**2))
    assert 0.05 < added_mm < 3.0
