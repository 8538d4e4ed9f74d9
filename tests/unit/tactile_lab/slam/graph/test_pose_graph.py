"""The pose graph: loops are found, tested and reported, and repair a drifting trajectory."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from drivers.core.contacts import Array
from tactile_lab.experiments.data.outlines import OUTLINES_m
from tactile_lab.experiments.data.planar_data import simulate
from tactile_lab.slam.graph.back_end import BackEnd, BackEndSettings
from tactile_lab.slam.graph.faces import assign_to_segments, contour_segments
from tactile_lab.slam.graph.pose_graph import Loop, LoopReport, PoseGraphSettings, find_loops, optimise_poses
from tactile_lab.slam.shape.fields.settings import GpisSettings
from tactile_lab.slam.tracking.contacts.contact_map import ContactMap, PlacedGrasp
from tactile_lab.slam.tracking.contacts.contact_set import ContactSet
from tactile_lab.slam.tracking.contacts.motion import (
    compose,
    deviation,
    inverse,
    planar_motion,
    pose_vector,
    vector_pose,
)

DRIFT_SIGMAS = np.array([0.0015, 0.0015, 0.03])
NOTHING = np.zeros(3)


def true_map(seed: int = 0, count: int = 8) -> ContactMap:
    """A rectangle's grasps at their true poses, the object frame being the body's."""
    data = simulate("rectangle", seed, count=count)
    placed = [
        PlacedGrasp(
            ContactSet.of_grasp(grasp, 2, 0.0),
            planar_motion(pose),
            np.diag(DRIFT_SIGMAS**2) if grasp.index else np.eye(3) * 1e-10,
            planar_motion(grasp.hand_motion_world),
        )
        for grasp, pose in zip(data.grasps, data.world_T_body, strict=True)
    ]
    return ContactMap(tuple(placed), GpisSettings())


def drifting(contact_map: ContactMap, seed: int = 1) -> ContactMap:
    """Every pose off by the sum of small errors so far."""
    rng = np.random.default_rng(seed)
    drift, rows = np.zeros(3), [contact_map.rows[0]]
    for row in contact_map.rows[1:]:
        drift = compose(drift, rng.normal(size=3) * DRIFT_SIGMAS)
        rows.append(compose(row, drift))
    return contact_map.with_rows(np.array(rows))


def rectangle_faces(contact_map: ContactMap) -> np.ndarray:
    settings = BackEndSettings().faces
    outline = OUTLINES_m["rectangle"]
    ring = np.concatenate(
        [np.linspace(a, b, 30, endpoint=False) for a, b in zip(outline, np.roll(outline, -1, 0), strict=True)]
    )
    return assign_to_segments(contact_map.contacts, contour_segments(ring, settings), settings)


def position_error_m(estimate: ContactMap, truth: ContactMap) -> float:
    gaps = deviation(estimate.rows, truth.rows)
    return float(np.sqrt(np.mean(gaps[:, :2] ** 2)))


def loop(rows: Array, earlier: int, later: int, accepted: bool = True, off: Array = NOTHING) -> Loop:
    """A loop as contacts tell it that touch the same places at poses ``rows``, or places that are ``off``."""
    relative = compose(compose(inverse(rows[earlier]), rows[later]), off)
    displacement = vector_pose(compose(compose(rows[earlier], off), inverse(rows[later])))
    report = LoopReport(earlier, later, 3, 1.0, 11.3, accepted, "for the test", vector_pose(relative), displacement)
    return Loop(report, np.diag([1e-6, 1e-6, 1e-4]))


def test_loops_between_true_poses_are_accepted_and_small() -> None:
    contact_map = true_map()
    loops = find_loops(contact_map, rectangle_faces(contact_map), PoseGraphSettings(), list(range(2, 8)))
    assert len(loops) >= 5
    accepted = [found for found in loops if found.report.accepted]
    assert len(accepted) >= 0.8 * len(loops)
    for found in accepted:
        rows = contact_map.rows
        true = compose(inverse(rows[found.report.earlier]), rows[found.report.later])
        assert np.hypot(*deviation(pose_vector(found.report.earlier_T_later), true)[:2]) < 0.008


def test_every_refused_loop_says_why() -> None:
    contact_map = true_map(seed=2)
    wrong = contact_map.rows
    wrong[5] = compose(wrong[5], np.array([0.004, 0.004, 0.5]))
    moved = contact_map.with_rows(wrong)
    settings = PoseGraphSettings()
    loops = find_loops(moved, rectangle_faces(contact_map), settings, [5])
    assert loops
    for found in loops:
        assert not found.report.accepted
        assert found.report.reason
        assert found.report.limit == pytest.approx(11.345, abs=1e-3)


def test_the_predecessor_is_no_loop() -> None:
    contact_map = true_map()
    loops = find_loops(contact_map, rectangle_faces(contact_map), PoseGraphSettings(), [4])
    assert {found.report.earlier for found in loops} <= {0, 1, 2}


def test_without_loops_the_filter_s_poses_stand() -> None:
    contact_map = drifting(true_map())
    assert np.allclose(optimise_poses(contact_map, [], PoseGraphSettings()).rows, contact_map.rows, atol=1e-9)


def test_true_loops_pull_a_drifting_trajectory_back() -> None:
    truth = true_map()
    estimate = drifting(truth)
    rows = truth.rows
    loops = [loop(rows, 0, later) for later in (2, 4, 6, 7)]
    corrected = optimise_poses(estimate, loops, PoseGraphSettings())
    assert position_error_m(corrected, truth) < 0.35 * position_error_m(estimate, truth)
    assert np.allclose(corrected.rows[0], truth.rows[0], atol=1e-6)


def test_loops_hold_whatever_the_heading_was_when_they_were_found() -> None:
    truth = true_map()
    drift = np.array([0.004, -0.003, np.deg2rad(8.0)])
    estimate = truth.with_rows(np.array([truth.rows[0], *(compose(row, drift) for row in truth.rows[1:])]))
    loops = find_loops(estimate, rectangle_faces(truth), PoseGraphSettings(), list(range(2, 8)))
    assert any(found.report.accepted for found in loops)
    for found in (found for found in loops if found.report.accepted):
        back = compose(pose_vector(found.report.displacement), truth.rows[found.report.later])
        gap = deviation(back, truth.rows[found.report.earlier])
        assert np.hypot(*gap[:2]) < 0.006
        assert abs(gap[2]) < np.deg2rad(8.0)


def test_a_wrong_loop_that_passed_the_test_hardly_bends_the_trajectory() -> None:
    truth = true_map()
    rows = truth.rows
    loops = [loop(rows, 0, later) for later in (3, 5, 7)]
    wrong = loop(rows, 1, 6, off=np.array([0.06, 0.0, np.pi / 2]))
    corrected = optimise_poses(drifting(truth), [*loops, wrong], PoseGraphSettings())
    assert position_error_m(corrected, truth) < 0.003


def test_refused_loops_stay_out_of_the_graph() -> None:
    contact_map = drifting(true_map())
    refused = loop(contact_map.rows, 0, 5, accepted=False, off=np.array([0.1, 0.1, 1.0]))
    assert np.allclose(optimise_poses(contact_map, [refused], PoseGraphSettings()).rows, contact_map.rows, atol=1e-9)


def test_the_back_end_makes_the_contacts_more_likely_or_changes_nothing() -> None:
    estimate = drifting(true_map(count=10))
    back_end = BackEnd(BackEndSettings())
    corrected = back_end.close_all_loops(estimate)
    assert back_end.reports
    assert corrected.fit().log_marginal_likelihood() >= estimate.fit().log_marginal_likelihood()


def test_a_back_end_that_is_switched_off_does_nothing() -> None:
    estimate = drifting(true_map())
    back_end = BackEnd(BackEndSettings(enabled=False))
    assert back_end.close_all_loops(estimate) is estimate
    assert back_end.close_loops(estimate) is estimate
    assert back_end.reports == ()


def test_grasps_kept_aside_make_no_loops() -> None:
    contact_map = true_map()
    aside = contact_map.placed[-1].put_aside()
    estimate = replace(contact_map, placed=(*contact_map.placed[:-1], aside))
    assert BackEnd(BackEndSettings()).close_loops(estimate) is estimate
    loops = find_loops(estimate, rectangle_faces(estimate), PoseGraphSettings(), [7])
    assert loops == []
