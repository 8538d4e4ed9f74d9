"""Errors of an estimated shape relative to the true one (appendix C)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from gtsam import Pose2, Pose3

from drivers.core.contacts import Array
from drivers.core.errors import ShapeError
from drivers.core.poses import spatial, transform_points
from tactile_lab.slam.shape.metrics.overlap import mesh_overlap, polygon_overlap
from tactile_lab.slam.shape.surfaces.sampling import (
    TriangleMesh,
    distances_to_mesh,
    distances_to_polygon,
    mesh_arrays,
    sample_mesh,
    sample_polygon,
)

CONTOUR_STEP_m = 0.0005
MESH_SAMPLES = 50_000


@dataclass(frozen=True)
class ShapeErrors:
    """Distances between an estimated and a true surface; both are sampled densely, distances are exact.

    Attributes:
        hausdorff_m: (C.1), the larger of the two directed maxima.
        estimated_to_truth_m: (C.2) with A the estimate: distance of the estimate from the truth.
        truth_to_estimated_m: (C.3): distance of the truth from the estimate.
        mean_distance_m: average of the two directed mean distances.
        chamfer_m: sum of the two directed mean distances.
        fscore_1mm, fscore_2mm: harmonic mean of the shares of each surface within 1 or 2 mm of the other, 0 to 1.
        iou: overlap of the enclosed areas or volumes, intersection over union, 0 to 1.
    """

    hausdorff_m: float
    estimated_to_truth_m: float
    truth_to_estimated_m: float
    mean_distance_m: float
    chamfer_m: float
    fscore_1mm: float
    fscore_2mm: float
    iou: float


def contour_errors(estimated_m: Array, truth_m: Array, truth_T_estimated: Pose2 | None = None) -> ShapeErrors:
    """Compare closed polygons of shape (n, 2), sampled every 0.5 mm.

    Args:
        estimated_m: the estimated outline; the last point joins the first.
        truth_m: the true outline.
        truth_T_estimated: applied to the estimate first; identity if None.

    Raises:
        ShapeError: an outline has fewer than three points, or coordinates that are not numbers.
    """
    _check_polygon(estimated_m, "the estimated outline")
    _check_polygon(truth_m, "the true outline")
    if truth_T_estimated is not None:
        estimated_m = transform_points(spatial(truth_T_estimated), np.pad(estimated_m, ((0, 0), (0, 1))))[:, :2]
    outward = _directed_distances(
        distances_to_polygon(sample_polygon(estimated_m, CONTOUR_STEP_m), truth_m),
        distances_to_polygon(estimated_m, truth_m),
    )
    inward = _directed_distances(
        distances_to_polygon(sample_polygon(truth_m, CONTOUR_STEP_m), estimated_m),
        distances_to_polygon(truth_m, estimated_m),
    )
    return _errors(outward, inward, polygon_overlap(estimated_m, truth_m))


def mesh_errors(estimated: TriangleMesh, truth: TriangleMesh, truth_T_estimated: Pose3 | None = None) -> ShapeErrors:
    """Compare closed meshes, each sampled with 50 000 points (always the same ones).

    Args:
        estimated: the estimated surface.
        truth: the true surface.
        truth_T_estimated: applied to the estimate first; identity if None.

    Raises:
        ShapeError: a mesh has no faces, or coordinates that are not numbers.
    """
    moved = _Mesh(*mesh_arrays(estimated))
    if truth_T_estimated is not None:
        moved = _Mesh(transform_points(truth_T_estimated, moved.vertices), moved.faces)
    _check_mesh(moved, "the estimated mesh")
    _check_mesh(truth, "the true mesh")
    return _errors(_mesh_distances(moved, truth), _mesh_distances(truth, moved), mesh_overlap(moved, truth))


@dataclass(frozen=True)
class _Mesh:
    vertices: Array
    faces: Array


@dataclass(frozen=True)
class _Directed:
    """Distances from one surface to the other: of evenly spread samples, and the largest one, including corners."""

    distances_m: Array
    largest_m: float


def _directed_distances(samples_m: Array, corners_m: Array) -> _Directed:
    return _Directed(samples_m, float(max(samples_m.max(), corners_m.max())))


def _mesh_distances(source: TriangleMesh, target: TriangleMesh) -> _Directed:
    corners = np.asarray(source.vertices)[np.unique(source.faces)]
    return _directed_distances(
        distances_to_mesh(sample_mesh(source, MESH_SAMPLES), target), distances_to_mesh(corners, target)
    )


def _errors(outward: _Directed, inward: _Directed, iou: float) -> ShapeErrors:
    means = float(outward.distances_m.mean()), float(inward.distances_m.mean())
    return ShapeErrors(
        hausdorff_m=max(outward.largest_m, inward.largest_m),
        estimated_to_truth_m=outward.largest_m,
        truth_to_estimated_m=inward.largest_m,
        mean_distance_m=sum(means) / 2,
        chamfer_m=sum(means),
        fscore_1mm=_fscore(outward, inward, 0.001),
        fscore_2mm=_fscore(outward, inward, 0.002),
        iou=iou,
    )


def _fscore(outward: _Directed, inward: _Directed, limit_m: float) -> float:
    precision, recall = (float(np.mean(side.distances_m < limit_m)) for side in (outward, inward))
    return 2 * precision * recall / (precision + recall) if precision + recall > 0 else 0.0


def _check_polygon(points_m: Array, name: str) -> None:
    if np.ndim(points_m) != 2 or np.shape(points_m)[1] != 2 or len(points_m) < 3:
        raise ShapeError(f"{name} has shape {np.shape(points_m)}", hint="At least three points in the plane are needed")
    if not np.isfinite(points_m).all():
        raise ShapeError(f"{name} has coordinates that are not numbers")


def _check_mesh(mesh: TriangleMesh, name: str) -> None:
    if len(mesh.faces) == 0:
        raise ShapeError(f"{name} has no faces")
    if not np.isfinite(mesh.vertices).all():
        raise ShapeError(f"{name} has coordinates that are not numbers")
