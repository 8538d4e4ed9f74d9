"""The consistency of a session's uncertainties, as figures of its evaluation."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from drivers.core.contacts import Array
from drivers.core.poses import planar
from tactile_lab.evaluation.consistency.levels import CURVE, LEVELS
from tactile_lab.evaluation.consistency.pose_covariance import covariance_in_world
from tactile_lab.evaluation.consistency.poses import PoseConsistency, birth_frame, common_frame, pose_consistency
from tactile_lab.evaluation.consistency.surfaces import SurfaceConsistency, mesh_consistency, outline_consistency
from tactile_lab.evaluation.estimate_with_truth import EstimateWithTruth, true_outline
from tactile_lab.evaluation.files.mesh_io import read_estimated_mesh
from tactile_lab.evaluation.files.results import Results
from tactile_lab.evaluation.files.tables import read_contour
from tactile_lab.evaluation.truth.rotational_symmetry import round_axis_m


@dataclass(frozen=True)
class PoseFigures:
    """Pose uncertainties against the truth.

    Attributes:
        count: number of poses judged.
        nees: mean normalised squared error per component; 1 if the stated covariances are true.
        inside: share of the poses inside the stated regions of :data:`LEVELS`.
        log_score: mean log density of the true pose, metres and radians.
    """

    count: int
    nees: float
    inside: tuple[float, ...]
    log_score: float

    @classmethod
    def of(cls, found: PoseConsistency | None) -> PoseFigures | None:
        """The figures of a whole trajectory."""
        if found is None:
            return None
        return cls(len(found.nees), float(np.mean(found.nees)), found.inside, found.log_score)


@dataclass(frozen=True)
class ConsistencyFigures:
    """Stated uncertainties against the truth.

    Attributes:
        levels: the stated probabilities of ``inside``.
        curve_levels: those of the calibration curve.
        poses: relative to the object frame where it was born, at the first grasp.
        poses_common: relative to the object frame that agrees best with all grasps.
        surface: of the outline or surface, at the best fit.
    """

    levels: tuple[float, ...]
    curve_levels: tuple[float, ...]
    poses: PoseFigures | None
    poses_common: PoseFigures | None
    surface: SurfaceConsistency | None


def consistency(estimate: EstimateWithTruth) -> ConsistencyFigures | None:
    """Judge poses and surface; None if the truth is known of neither. Turns of symmetry do not count."""
    truth = estimate.truth.world_T_object
    told, covariances = estimate.poses_modulo_symmetry, estimate.results.trajectory.covariances
    in_common = common_covariances(estimate.results) or covariances
    axis_m = round_axis_m(estimate.symmetry, truth)
    born = PoseFigures.of(pose_consistency(told, covariances, truth, birth_frame(told, truth), axis_m))
    common = PoseFigures.of(pose_consistency(told, in_common, truth, common_frame(told, truth), axis_m))
    surface = _surface(estimate)
    if born is None and common is None and surface is None:
        return None
    return ConsistencyFigures(LEVELS, CURVE, born, common, surface)


def common_covariances(results: Results) -> tuple[Array | None, ...]:
    """Covariances of the poses in the best common object frame, shape (6, 6); empty in results without them."""
    stated = results.slam.get("common_covariances") or ()
    return tuple(
        None if pose is None or covariance is None else covariance_in_world(pose, np.array(covariance, dtype=float))
        for pose, covariance in zip(results.trajectory.world_T_object, stated, strict=False)
    )


def _surface(estimate: EstimateWithTruth) -> SurfaceConsistency | None:
    compared, _ = estimate.shape
    if compared is None:
        return None
    if estimate.results.dimension == 3:
        found = read_estimated_mesh(estimate.folder / "mesh.ply")
        assert estimate.truth.mesh is not None
        return mesh_consistency(found.mesh, found.sigma_m, estimate.truth.mesh, compared.truth_T_fitted)
    outline, truth_m = read_contour(estimate.folder / "contour.csv"), true_outline(estimate.results, estimate.truth)
    if truth_m is None or not len(outline.sigma_m):
        return None
    return outline_consistency(outline.points_m, outline.sigma_m, truth_m, planar(compared.truth_T_fitted))
