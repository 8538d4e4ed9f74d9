"""The pose graph behind the filter (thesis section 3.3.3): all poses corrected at once (eq. 3.19 to 3.25).

Nodes are the object's planar poses at each grasp. Edges are the filter's steps from grasp to grasp with the
filter's covariance (3.23), and one for each pair of similar grasps (3.26) with its own covariance. Every such loop is
tested before it enters, and weighs less the worse it fits (a redescending cost), so that one wrong association cannot
bend the whole trajectory.

The nodes are kept as inverse poses ``object_T_world``. An edge between two of them is a motion of the object in the
world, as it was measured, whatever the estimated poses are. Between the poses ``world_T_object`` themselves an error
of heading would enter, times the way between the grasps: 3 degrees over 10 cm are 5 mm.
"""

from __future__ import annotations

from dataclasses import dataclass

import gtsam
import numpy as np
from pydantic import Field

from drivers.core.configuration import StrictModel
from drivers.core.contacts import Array
from drivers.core.poses import planar
from tactile_lab.slam.graph.chances import chi_squared_quantile
from tactile_lab.slam.graph.faces import Labels
from tactile_lab.slam.graph.registration import Alignment, align
from tactile_lab.slam.graph.relative_poses import RelativePose
from tactile_lab.slam.graph.similarity import SharedContacts, SimilaritySettings, shared_contacts
from tactile_lab.slam.tracking.contacts.contact_map import ContactMap
from tactile_lab.slam.tracking.contacts.contact_set import ContactSet
from tactile_lab.slam.tracking.contacts.motion import inverse, pose_vector, vector_pose

_ANCHOR_SIGMAS = np.array([1e-6, 1e-6, 1e-6])


class PoseGraphSettings(StrictModel):
    """Parameters of the graph.

    Attributes:
        similarity: which grasps are compared.
        confidence: loops are refused above this quantile of the chi-square distribution of their test value.
        robust_scale: whitened error at which a loop's weight has fallen to a quarter (Geman-McClure).
        least_translation_m, least_rotation_rad: minimum standard deviations; a sampled or linearised covariance does
            not include the model's own errors.
    """

    similarity: SimilaritySettings = SimilaritySettings()
    confidence: float = Field(default=0.99, gt=0, lt=1)
    robust_scale: float = Field(default=3.0, gt=0)
    least_translation_m: float = Field(default=0.0005, gt=0)
    least_rotation_rad: float = Field(default=0.005, gt=0)


@dataclass(frozen=True)
class LoopReport:
    """One pair of similar grasps, tested.

    Attributes:
        earlier, later: numbers of the grasps in the map.
        faces: how many faces they share.
        test_value: squared Mahalanobis distance between the loop and the filter's poses.
        limit: its limit.
        accepted: whether it is in the graph.
        reason: the reason as text.
        earlier_T_later: the relative pose of the object's frames from the shared contacts (3.26). It holds
            for the earlier pose as it was estimated: its heading enters, times the way between the grasps.
        displacement: the measurement of the contacts alone: the motion in the world that brings the object from where
            it was at the later grasp to where it was at the earlier one.
    """

    earlier: int
    later: int
    faces: int
    test_value: float
    limit: float
    accepted: bool
    reason: str
    earlier_T_later: gtsam.Pose2
    displacement: gtsam.Pose2


@dataclass(frozen=True)
class Loop:
    """A tested loop, with the covariance of its relative pose (gtsam's order)."""

    report: LoopReport
    covariance: Array


def find_loops(
    contact_map: ContactMap, faces: Labels, settings: PoseGraphSettings, later_grasps: list[int]
) -> list[Loop]:
    """Compare each of the later grasps with all before it but its predecessor.

    Args:
        contact_map: all grasps.
        faces: the face of each of the map's contacts.
        settings: what counts as similar, and how loops are tested.
        later_grasps: numbers of the grasps to compare.

    Returns:
        A loop for every pair with enough shared faces; other pairs are not reported.
    """
    contacts, grasp_of = contact_map.contacts, contact_map.grasp_indices
    loops = []
    for later in later_grasps:
        for earlier in range(later - 1):
            ours, theirs = np.flatnonzero(grasp_of == earlier), np.flatnonzero(grasp_of == later)
            shared = shared_contacts(contacts, faces, ours, theirs, settings.similarity)
            if shared.faces >= settings.similarity.least_faces:
                loops.append(_tested_loop(contact_map, contacts, shared, earlier, later, settings))
    return loops


def _tested_loop(
    contact_map: ContactMap,
    contacts: ContactSet,
    shared: SharedContacts,
    earlier: int,
    later: int,
    settings: PoseGraphSettings,
) -> Loop:
    alignment = align(contacts.select(shared.later), contacts.select(shared.earlier), on_table=True)
    correction = planar(alignment.target_T_source)
    rows = contact_map.rows
    estimated = vector_pose(rows[earlier]).between(vector_pose(rows[later]))
    covariance = _believable(alignment.covariance, settings)
    spread = covariance + _path_covariance(contact_map, earlier, later, settings)
    # Seen from the object frame the later contacts move by the correction, so the later pose moves by its inverse.
    moved = gtsam.Pose2.Logmap(correction)
    test_value = float(moved @ np.linalg.solve(spread, moved))
    relative = estimated.compose(correction.inverse())
    displacement = vector_pose(rows[earlier]).compose(correction).compose(vector_pose(rows[later]).inverse())
    verdict, reason = _judge(shared, alignment, test_value, settings)
    limit = _test_limit(settings)
    return Loop(
        LoopReport(earlier, later, shared.faces, test_value, limit, verdict, reason, relative, displacement),
        covariance,
    )


def _test_limit(settings: PoseGraphSettings) -> float:
    return chi_squared_quantile(settings.confidence, 3)


def _judge(shared: SharedContacts, alignment: Alignment, value: float, settings: PoseGraphSettings) -> tuple[bool, str]:
    """Whether a loop is accepted, and why."""
    limit = _test_limit(settings)
    fit_limit = chi_squared_quantile(settings.confidence, max(alignment.degrees_of_freedom, 1))
    if not shared.similar:
        return False, shared.reason
    if not alignment.observable:
        return False, "the pairs leave a direction free"
    if alignment.chi_square > fit_limit:
        return False, f"contacts do not fit each other ({1e3 * alignment.rms_m:.1f} mm rms)"
    if value > limit:
        return False, f"contradicts the filter (test value {value:.1f} above {limit:.1f})"
    return True, f"{shared.faces} shared faces, test value {value:.1f} below {limit:.1f}"


def _believable(covariance: Array, settings: PoseGraphSettings) -> Array:
    least = np.array([settings.least_translation_m, settings.least_translation_m, settings.least_rotation_rad])
    return np.asarray((covariance + covariance.T) / 2 + np.diag(least**2))


def _path_covariance(contact_map: ContactMap, earlier: int, later: int, settings: PoseGraphSettings) -> Array:
    """Uncertainty accumulated between two grasps: each step's covariance, in the object frame, added up."""
    return np.asarray(sum(_step_covariance(contact_map, index, settings) for index in range(earlier + 1, later + 1)))


def _step_covariance(contact_map: ContactMap, index: int, settings: PoseGraphSettings) -> Array:
    """The filter's covariance of a pose (3.23), turned from world axes into the object's."""
    grasp = contact_map.placed[index]
    turn = np.eye(3)
    turn[:2, :2] = vector_pose(grasp.pose).rotation().matrix().T
    return _believable(turn @ grasp.covariance @ turn.T, settings)


def optimise_poses(contact_map: ContactMap, loops: list[Loop], settings: PoseGraphSettings) -> ContactMap:
    """Minimise (3.20) over all poses by Levenberg-Marquardt; the first pose stays.

    Args:
        contact_map: grasps with the filter's poses and covariances.
        loops: those accepted enter the graph.
        settings: of the graph.
    """
    rows = contact_map.rows
    nodes = [vector_pose(row) for row in inverse(rows)]
    graph, start = gtsam.NonlinearFactorGraph(), gtsam.Values()
    graph.add(gtsam.PriorFactorPose2(0, nodes[0], gtsam.noiseModel.Diagonal.Sigmas(_ANCHOR_SIGMAS)))
    for index, node in enumerate(nodes):
        start.insert(index, node)
    for index in range(1, len(nodes)):
        graph.add(_factor(_step(contact_map, index, settings)))
    cost = gtsam.noiseModel.mEstimator.GemanMcClure.Create(settings.robust_scale)
    for loop in (loop for loop in loops if loop.report.accepted):
        graph.add(_factor(loop_edge(loop, rows), cost))
    found = gtsam.LevenbergMarquardtOptimizer(graph, start).optimize()
    corrected = np.array([pose_vector(found.atPose2(index)) for index in range(len(nodes))])
    return contact_map.with_rows(inverse(corrected))


def loop_edge(loop: Loop, rows: Array) -> RelativePose:
    """A loop between inverse poses; its covariance is transformed from the earlier object frame to the world."""
    report = loop.report
    carried = report.displacement.inverse().compose(vector_pose(rows[report.earlier])).AdjointMap()
    covariance = carried @ loop.covariance @ carried.T
    return RelativePose(report.earlier, report.later, pose_vector(report.displacement), covariance)


def _step(contact_map: ContactMap, index: int, settings: PoseGraphSettings) -> RelativePose:
    """The filter's motion of the object since the previous grasp, between inverse poses (3.23)."""
    before, pose = (vector_pose(row) for row in contact_map.rows[[index - 1, index]])
    carried = pose.AdjointMap()
    covariance = carried @ _step_covariance(contact_map, index, settings) @ carried.T
    return RelativePose(index - 1, index, pose_vector(before.compose(pose.inverse())), covariance)


def _factor(edge: RelativePose, cost: gtsam.noiseModel.mEstimator.Base | None = None) -> gtsam.BetweenFactorPose2:
    noise = gtsam.noiseModel.Gaussian.Covariance(edge.covariance)
    robust = noise if cost is None else gtsam.noiseModel.Robust.Create(cost, noise)
    return gtsam.BetweenFactorPose2(edge.start, edge.end, vector_pose(edge.pose), robust)


def explains_better(corrected: ContactMap, present: ContactMap) -> bool:
    """The corrected poses make the contacts at least as likely (2.16), kernel parameters being equal."""
    return corrected.fit().log_marginal_likelihood() >= present.fit().log_marginal_likelihood()
