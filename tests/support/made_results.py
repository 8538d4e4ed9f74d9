"""Results of an estimation that no estimator made: fixed poses, outlines and surfaces, and truths to judge them by."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import trimesh
from gtsam import Pose2, Pose3, Rot3

from drivers.core.contacts import Array, Contact, Grasp, StepSigma
from tactile_lab.evaluation.estimate_with_truth import Truth
from tactile_lab.evaluation.files.result_files import write_results
from tactile_lab.slam.doubt.status import Alternative, Doubt
from tactile_lab.slam.graph.pose_graph import LoopReport
from tactile_lab.slam.result import SlamResult, SlamStep
from tactile_lab.slam.shape.surfaces.surface import Contour, SurfaceMesh

COUNT = 7
SIZE_m = (0.10, 0.06, 0.05)


def yaw_pose(x_m: float, y_m: float, yaw_rad: float, z_m: float = 0.0) -> Pose3:
    return Pose3(Rot3.Yaw(yaw_rad), np.array([x_m, y_m, z_m]))


def true_poses() -> tuple[Pose3 | None, ...]:
    """Of each grasp; the camera saw the third one not."""
    found = [yaw_pose(0.02 * n, 0.01 * np.sin(n), 0.3 * n, 0.025) for n in range(COUNT)]
    return tuple(None if n == 2 else pose for n, pose in enumerate(found))


def poses() -> tuple[Pose3 | None, ...]:
    """Estimated: in an object frame of their own, a little off, the last but one unknown."""
    own = yaw_pose(0.005, -0.003, 0.4)
    made = [
        yaw_pose(0.02 * n + 0.001 * np.cos(3 * n), 0.01 * np.sin(n) - 0.0007 * n, 0.3 * n + 0.02 * np.sin(2 * n), 0.025)
        for n in range(COUNT)
    ]
    return tuple(None if n == 5 else pose * own for n, pose in enumerate(made))


def grasps() -> tuple[Grasp, ...]:
    """Contacts on the sides of the box, some of them off; the hand carries it between most grasps."""
    found = []
    for n in range(COUNT):
        at = yaw_pose(0.02 * n, 0.01 * np.sin(n), 0.3 * n, 0.025)
        contacts = []
        for number, (x, y, nx, ny) in enumerate(
            ((0.05, 0.01, 1, 0), (-0.05, 0.0, -1, 0), (0.02, 0.03, 0, 1))[: 1 + n % 3]
        ):
            place = at.transformFrom(np.array([x + 0.0004 * n * nx, y + 0.0004 * n * ny, 0.004 * number - 0.002 * n]))
            normal = at.rotation().rotate(np.array([float(nx), float(ny), 0.0]))
            covariance = np.diag([1e-6, 2e-6, 3e-6])
            contacts.append(Contact(f"F{number}", np.asarray(place), np.asarray(normal), covariance, 0.1, 0.4 + n))
        moved = Pose3() if n % 3 == 0 else yaw_pose(0.019, 0.001 * n, 0.29)
        sigma = StepSigma(0.002, 0.03) if n % 2 else None
        found.append(Grasp(n, 1_500_000_000 * n, tuple(contacts), at, moved, motion_sigma=sigma))
    return tuple(found)


def contour() -> Contour:
    """Of the box, rounded and too large on one side; a fifth of it was never touched."""
    angles = np.linspace(0.0, 2 * np.pi, 60, endpoint=False)
    uneven = 1.0 + 0.12 * np.cos(4 * angles) + 0.03 * np.sin(angles + 0.3) + 0.011 * np.cos(3 * angles - 0.5)
    ring = np.column_stack([0.052 * np.cos(angles), 0.0305 * np.sin(angles)]) * uneven[:, None]
    turn = np.array([[np.cos(-0.4), -np.sin(-0.4)], [np.sin(-0.4), np.cos(-0.4)]])
    sigma_m = 0.001 + 0.004 * (1.0 + np.cos(angles)) / 2
    return Contour((ring - [0.005, -0.003]) @ turn.T, sigma_m, True, np.cos(angles) < 0.8, 0.0009)


def mesh() -> SurfaceMesh:
    """Of the box, too large by millimetres, its top uncertain."""
    box = trimesh.creation.box((0.103, 0.058, 0.052)).subdivide().subdivide()
    box.vertices *= 1.0 + np.where(box.vertices > 0.0, [0.04, 0.07, 0.0], 0.0)  # no two sides alike
    placed = (box.vertices - [0.005, -0.003, 0.0]) @ yaw_pose(0.0, 0.0, -0.4).rotation().matrix().T
    heights = box.vertices[:, 2]
    normals = np.asarray(trimesh.Trimesh(placed, box.faces, process=False).vertex_normals)
    return SurfaceMesh(
        placed, np.asarray(box.faces), 0.001 + 0.1 * np.abs(heights), normals, True, heights < 0.02, 0.002
    )


def result(dimension: int, status: str = "partial") -> SlamResult:
    """With loops, doubts and another placing."""
    placed = poses()
    covariance = np.array([[4e-6, 1e-6, 2e-6], [1e-6, 3e-6, 0.0], [2e-6, 0.0, 2e-4]])
    covariances = tuple(None if pose is None else (0.0 if n == 0 else n) * covariance for n, pose in enumerate(placed))
    verdicts = ("first", "tracked", "uncertain", "tracked", "tracked", "untracked", "tracked")
    steps = tuple(
        SlamStep(
            n, 1_500_000_000 * n, pose, None, 50.0 + n, 0.1 * n, verdict, "by hand", 1 + n % 3, 1, 0.01 * (n + 1) ** 2
        )  # type: ignore[arg-type]
        for n, (pose, verdict) in enumerate(zip(placed, verdicts, strict=True))
    )
    return SlamResult(
        method="made",
        seed=5,
        dimension=dimension,
        world_T_object=placed,
        covariances=covariances,
        steps=steps,
        loops=loops(),
        surface=None,
        contour=contour() if dimension == 2 else None,
        mesh=mesh() if dimension == 3 else None,
        status=status,  # type: ignore[arg-type]
        warnings=("made by hand",),
        known_share=0.8,
        doubts=(Doubt("symmetry", "it looks alike from two sides", (1, 2)),),  # type: ignore[arg-type]
        alternatives=(Alternative((3, 4), (Pose3(), Pose3()), 0.25, 0.5, 0.02, 0.003),),
        common_covariances=tuple(None if pose is None else 0.5 * covariance for pose in placed),
    )


def loops() -> tuple[LoopReport, ...]:
    """One right, one wrong by its angle, one refused."""
    right = Pose2(0.06, 0.0, 0.9)
    return (
        LoopReport(0, 3, 2, 1.0, 7.8, True, "alike", right, Pose2(-0.058, -0.005, -0.88)),
        LoopReport(1, 4, 2, 2.0, 7.8, True, "alike", Pose2(0.0, 0.0, 0.5), Pose2(0.0, 0.03, -0.9)),
        LoopReport(0, 1, 1, 9.0, 7.8, False, "too far", right, right),
    )


def written(folder: Path, dimension: int, status: str = "partial", largest_sigma_m: float | None = None) -> Path:
    """The files of these results."""
    write_results(folder, result(dimension, status), grasps(), {"dimension": dimension}, largest_sigma_m)
    return folder


def truth(*, shaped: bool = True, outline: bool = False) -> Truth:
    """With the box, or with its outline alone."""
    half = np.array(SIZE_m[:2]) / 2
    corners: Array = half * np.array([[1.0, 1.0], [-1.0, 1.0], [-1.0, -1.0], [1.0, -1.0]])
    return Truth(
        true_poses(),
        trimesh.creation.box(SIZE_m) if shaped and not outline else None,
        corners if shaped and outline else None,
    )
