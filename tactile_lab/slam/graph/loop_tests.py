"""Tests which of the loops found can be trusted: placement, precision, and consistency with all others.

A loop found from faces (:func:`~tactile_lab.slam.graph.pose_graph.find_loops`) has passed the tests on its own pairs.
Three more follow, in this order, and the first that fails is the reason reported:

1. both grasps are placed with certainty (:mod:`placement`),
2. the relative pose is known well enough to detect a wrong loop,
3. it belongs to the combination of loops that agree with each other and with the hand's own motion
   (:func:`~tactile_lab.slam.graph.robust.solve_robustly`).

The nodes of that graph are inverse poses as well (:mod:`~tactile_lab.slam.graph.pose_graph` says why); the hand's
motion takes the place of the filter's steps.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from pydantic import Field

from drivers.core.configuration import StrictModel
from drivers.core.contacts import Array
from tactile_lab.slam.graph.placement import Placement, PlacementSettings, judge_placements
from tactile_lab.slam.graph.pose_graph import Loop, loop_edge
from tactile_lab.slam.graph.relative_poses import RelativePose
from tactile_lab.slam.graph.robust import LoopVerdict, RobustSettings, solve_robustly
from tactile_lab.slam.tracking.contacts.contact_map import ContactMap
from tactile_lab.slam.tracking.contacts.motion import MotionNoise, inverse


class LoopTestSettings(StrictModel):
    """Parameters of the tests.

    Attributes:
        placement: when a grasp's placement is certain.
        robust: consistency of the loops.
        largest_sigma_m, largest_sigma_rad: standard deviations of a loop above which it is refused as vague.
    """

    placement: PlacementSettings = PlacementSettings()
    robust: RobustSettings = RobustSettings()
    largest_sigma_m: float = Field(default=0.004, gt=0)
    largest_sigma_rad: float = Field(default=float(np.deg2rad(5.0)), gt=0)


def test_together(
    contact_map: ContactMap, loops: Sequence[Loop], noise: MotionNoise, settings: LoopTestSettings
) -> list[Loop]:
    """The same loops with their final verdicts.

    Args:
        contact_map: all grasps, planar poses.
        loops: found from faces; those already refused keep their reason.
        noise: of the motion from grasp to grasp.
        settings: see there.
    """
    if not any(loop.report.accepted for loop in loops):
        return list(loops)
    placements = judge_placements(contact_map, noise, settings.placement)
    judged = [_with_reason(loop, _doubt(loop, placements, settings)) for loop in loops]
    candidates = [index for index, loop in enumerate(judged) if loop.report.accepted]
    verdicts = _joint_verdicts(contact_map, [judged[index] for index in candidates], noise, settings.robust)
    for index, verdict in zip(candidates, verdicts, strict=True):
        judged[index] = _with_verdict(judged[index], verdict)
    return judged


def _doubt(loop: Loop, placements: Sequence[Placement], settings: LoopTestSettings) -> str:
    for index in (loop.report.earlier, loop.report.later):
        if not placements[index].sure:
            which = "earlier" if index == loop.report.earlier else "later"
            return f"the {which} grasp's place is not sure: {placements[index].reason}"
    sigma_m = float(np.sqrt(np.linalg.eigvalsh(loop.covariance[:2, :2])[-1]))
    sigma_rad = float(np.sqrt(loop.covariance[2, 2]))
    if sigma_m > settings.largest_sigma_m or sigma_rad > settings.largest_sigma_rad:
        return f"vague: known to {1e3 * sigma_m:.1f} mm and {np.degrees(sigma_rad):.1f} degrees only"
    return ""


def _with_reason(loop: Loop, doubt: str) -> Loop:
    if not (loop.report.accepted and doubt):
        return loop
    return replace(loop, report=replace(loop.report, accepted=False, reason=doubt))


def _joint_verdicts(
    contact_map: ContactMap, loops: Sequence[Loop], noise: MotionNoise, settings: RobustSettings
) -> tuple[LoopVerdict, ...]:
    rows = contact_map.rows
    odometry = [
        RelativePose(k, k + 1, inverse(grasp.motion), _motion_covariance(grasp.pose, noise))
        for k, grasp in enumerate(contact_map.placed[1:])
    ]
    edges = [loop_edge(loop, rows) for loop in loops]
    return solve_robustly(odometry, edges, settings, inverse(rows[0])).verdicts


def _motion_covariance(row: Array, noise: MotionNoise) -> Array:
    """The noise acts at the object; seen as a small motion about the world's origin."""
    about_origin = np.array([[1.0, 0.0, row[1]], [0.0, 1.0, -row[0]], [0.0, 0.0, 1.0]])
    return np.asarray(about_origin @ np.diag(noise.sigmas**2) @ about_origin.T)


def _with_verdict(loop: Loop, verdict: LoopVerdict) -> Loop:
    """The test value against all other loops takes the place of the one against the filter's poses."""
    faces = f"{loop.report.faces} shared faces, " if verdict.accepted else ""
    report = replace(
        loop.report,
        accepted=verdict.accepted,
        test_value=verdict.test_value,
        limit=verdict.limit,
        reason=faces + verdict.reason,
    )
    return replace(loop, report=report)
