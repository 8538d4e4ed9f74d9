"""Loops in a map: misplaced grasps confirm themselves, and are found out all the same."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
from gtsam import Pose3

from drivers.core.contacts import Array
from drivers.core.poses import spatial
from tactile_lab.evaluation.files.plain import plain
from tactile_lab.evaluation.loops import wrong_loops
from tactile_lab.slam.graph.back_end import BackEnd, BackEndSettings
from tactile_lab.slam.graph.placement import PlacementSettings, judge_placements
from tactile_lab.slam.graph.pose_graph import LoopReport
from tactile_lab.slam.graph.relocation import relocation_candidates
from tactile_lab.slam.tracking.contacts.contact_map import ContactMap
from tactile_lab.slam.tracking.contacts.motion import MotionNoise, deviation, vector_pose
from tests.support.simulated_contacts import true_map

MISPLACED = 9


@cache
@cache
def misplaced_map() -> ContactMap:
    """One grasp lies where it fits the shape as well, turned to another corner of the triangle."""
    truth = true_map("triangle", count=16)
    others = ContactMap(truth.placed[:MISPLACED] + truth.placed[MISPLACED + 1 :], truth.settings)
    found = relocation_candidates(others, truth.placed[MISPLACED].contacts_world)
    turned = np.abs(deviation(found.rows, truth.rows[MISPLACED])[:, 2]) > np.deg2rad(60.0)
    rows = truth.rows.copy()
    rows[MISPLACED] = found.rows[turned][0]
    return truth.with_rows(rows)


def judged(contact_map: ContactMap, *, as_printed: bool) -> tuple[LoopReport, ...]:
    back_end = BackEnd(BackEndSettings(), as_printed=as_printed)
    back_end.close_all_loops(contact_map)
    return back_end.reports


def true_poses() -> list[Pose3]:
    return [spatial(vector_pose(row)) for row in true_map("triangle", count=16).rows]


def wrong_of(reports: tuple[LoopReport, ...], poses: list[Pose3]) -> int | None:
    return wrong_loops([plain(report) for report in reports], poses, true_poses())


def test_on_true_poses_many_loops_are_accepted_and_none_is_wrong() -> None:
    reports = judged(true_map("triangle", count=16), as_printed=False)
    assert sum(report.accepted for report in reports) >= 10
    assert wrong_of(reports, true_poses()) == 0


def test_loops_of_a_misplaced_grasp_are_refused() -> None:
    reports = judged(misplaced_map(), as_printed=False)
    accepted = [report for report in reports if report.accepted]
    assert accepted
    assert all(MISPLACED not in (report.earlier, report.later) for report in accepted)
    assert wrong_of(reports, [spatial(vector_pose(row)) for row in misplaced_map().rows]) == 0


def test_a_misplaced_grasp_is_told_where_it_fits_better() -> None:
    placement = judge_placements(misplaced_map(), MotionNoise(), PlacementSettings())[MISPLACED]
    assert not placement.sure
    assert "fits better" in placement.reason
    assert placement.other is not None
    gap = np.abs(deviation(placement.other, true_map("triangle", count=16).rows[MISPLACED]))
    assert np.hypot(gap[0], gap[1]) < 0.01
    assert gap[2] < 0.2


def test_grasps_kept_aside_have_no_sure_place() -> None:
    truth = true_map("triangle", count=16)
    aside = replace(truth, placed=(*truth.placed[:-1], truth.placed[-1].put_aside()))
    last = judge_placements(aside, MotionNoise(), PlacementSettings())[-1]
    assert not last.sure
    assert last.reason == "contacts kept aside"


def test_every_loop_keeps_a_verdict_with_a_reason() -> None:
    reports = judged(misplaced_map(), as_printed=False)
    assert all(report.reason for report in reports)
    assert any("place is not sure" in report.reason for report in reports)
    assert all(report.test_value <= report.limit for report in reports if report.accepted)


def test_the_thesis_s_variant_tests_each_loop_alone() -> None:
    reports = judged(misplaced_map(), as_printed=True)
    assert not any("place is not sure" in report.reason for report in reports)


def test_displacements_hold_whatever_the_object_frame_s_heading_is() -> None:
    """Turning the object frame by 20 degrees changes no measurement, and so no verdict about right and wrong."""
    truth = true_map("triangle", count=16)
    turn = np.array([0.004, -0.002, 0.35])
    rows: Array = np.array([compose_right(row, turn) for row in truth.rows])
    reports = judged(truth.with_rows(rows), as_printed=True)
    assert wrong_of(reports, true_poses()) == 0


def compose_right(row: Array, turn: Array) -> Array:
    pose = vector_pose(row).compose(vector_pose(turn))
    return np.array([pose.x(), pose.y(), pose.theta()])
