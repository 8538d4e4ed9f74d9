"""Results of tactile SLAM: after every grasp, and at the end."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from gtsam import Pose3

from drivers.core.contacts import Array
from tactile_lab.slam.doubt.status import Alternative, Doubt, Status
from tactile_lab.slam.graph.pose_graph import LoopReport
from tactile_lab.slam.shape.fields.gpis import Gpis
from tactile_lab.slam.shape.surfaces.surface import Contour, SurfaceMesh

Verdict = Literal["first", "tracked", "uncertain", "untracked"]


@dataclass(frozen=True)
class SlamStep:
    """The result of one grasp.

    Attributes:
        index, stamp_ns: of the grasp.
        world_T_object: pose after this grasp, None before the object frame is defined.
        covariance: of (x m, y m, yaw rad) in the world, shape (3, 3), None if there is no pose.
        effective_count: effective number of particles or hypotheses.
        observability: smallest eigenvalue of (3.18) of this grasp's contacts for motions on the table.
        verdict: "first", "tracked", "uncertain" or "untracked".
        reason: the verdict as text.
        contacts: number of contacts of this dimension.
        contacts_used: number of them used for the shape.
        seconds: computing time.
    """

    index: int
    stamp_ns: int
    world_T_object: Pose3 | None
    covariance: Array | None
    effective_count: float
    observability: float
    verdict: Verdict
    reason: str
    contacts: int
    contacts_used: int
    seconds: float


@dataclass(frozen=True)
class SlamResult:
    """A finished session.

    Attributes:
        method, seed, dimension: as requested.
        world_T_object: the pose at each grasp, None if unknown.
        covariances: of (x, y, yaw), None as the poses.
        steps: the result of each grasp when it was taken; later corrections are in ``world_T_object``.
        loops: every loop of the pose graph with its verdict.
        surface: the final field in the object frame, None if there was no usable grasp.
        contour: the final outline (dimension 2), object frame.
        mesh: the final surface (dimension 3), object frame.
        status: how far to trust it, see :mod:`tactile_lab.slam.doubt.status`.
        warnings: failures that did not end the estimation.
        known_share: share of the outline or surface that was touched, 0 to 1; None without a shape.
        doubts: reasons to doubt the result.
        common_covariances: of (x, y, yaw) in the object frame in which all grasps agree best, not in that of the first
            grasp, which has an error too; empty for methods but "joint".
        alternatives: other placings of grasps that the contacts allow, the most likely first.
    """

    method: str
    seed: int
    dimension: int
    world_T_object: tuple[Pose3 | None, ...]
    covariances: tuple[Array | None, ...]
    steps: tuple[SlamStep, ...]
    loops: tuple[LoopReport, ...]
    surface: Gpis | None
    contour: Contour | None
    mesh: SurfaceMesh | None
    status: Status
    warnings: tuple[str, ...] = ()
    known_share: float | None = None
    doubts: tuple[Doubt, ...] = ()
    alternatives: tuple[Alternative, ...] = ()
    common_covariances: tuple[Array | None, ...] = ()

    @property
    def step_seconds(self) -> tuple[float, ...]:
        """Computing time of each step."""
        return tuple(step.seconds for step in self.steps)
