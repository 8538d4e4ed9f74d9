"""One run of a method on simulated grasps, from a cell to its figures."""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import Any, TypeAlias, TypeVar

import numpy as np

from drivers.core.errors import ShapeError
from tactile_lab.evaluation.registration import registration_rms_mm
from tactile_lab.experiments.cells import Cell
from tactile_lab.experiments.data import planar_data, spatial_data
from tactile_lab.experiments.data.sensing import SimulatedGrasps, SLIP_SIGMA_m, SLIP_SIGMA_rad
from tactile_lab.experiments.run_metrics import contour_figures, slam_figures
from tactile_lab.experiments.touched_metrics import touched_figures, touched_outline_figures
from tactile_lab.slam.graph.faces import FaceSettings, assign_to_segments, contour_segments
from tactile_lab.slam.graph.pose_graph import PoseGraphSettings, find_loops, optimise_poses
from tactile_lab.slam.result import SlamResult
from tactile_lab.slam.shape.fields.settings import GpisSettings
from tactile_lab.slam.shape.selection.planar_choice import best_shape
from tactile_lab.slam.shape.surfaces.surface import Contour
from tactile_lab.slam.slam_settings import SlamSettings
from tactile_lab.slam.tactile_slam import TactileSlam
from tactile_lab.slam.tracking.contacts.contact_map import ContactMap, PlacedGrasp
from tactile_lab.slam.tracking.contacts.contact_set import ContactSet
from tactile_lab.slam.tracking.contacts.motion import compose, planar_motion, spatial_pose

_Data = TypeVar("_Data", bound=SimulatedGrasps)
Figures: TypeAlias = Callable[[_Data, SlamResult], dict[str, Any]]

WITHOUT_GRAPH = "particle, no graph"
"""The calibrated filter without corrections by the pose graph."""

_LEAST_NOISE = 0.05
_DRIFT_SIGMAS = np.array([0.0025, 0.0025, np.deg2rad(3.0)])
_KERNEL_STEPS = 30


def track_in_plane(cell: Cell) -> dict[str, Any]:
    """Evaluate a method on planar grasps. Cell: shape, noise (percent), outliers (percent), method, grasps,
    particles.
    """
    data = planar_data.simulate(
        cell["shape"],
        cell.seed,
        motion_scale=cell["noise"] / 100,
        count=cell["grasps"],
        outlier_share=cell["outliers"] / 100,
    )
    return _track(data, cell, dimension=2)


def track_on_table(cell: Cell) -> dict[str, Any]:
    """Evaluate a method on grasps of a solid. Cell: as in the plane, without outliers."""
    scale = cell["noise"] / 100
    data = spatial_data.simulate(cell["shape"], cell.seed, motion_scale=scale, count=cell["grasps"])
    return _track(data, cell, dimension=3)


def track_in_space(cell: Cell) -> dict[str, Any]:
    """Evaluate a method on grasps of a solid held free in space, with all six degrees of freedom. Cell: as on the
    table.
    """
    scale = cell["noise"] / 100
    data = spatial_data.simulate(cell["shape"], cell.seed, motion="free", motion_scale=scale, count=cell["grasps"])
    return _track(data, cell, dimension=3, freedom="space")


def track_everyday_thing(cell: Cell) -> dict[str, Any]:
    """Evaluate a method, where it was touched, on grasps all over a thing on the table. Cell: as on the table."""
    scale = cell["noise"] / 100
    data = spatial_data.simulate(cell["shape"], cell.seed, motion_scale=scale, count=cell["grasps"], heights="all")
    return _track(data, cell, dimension=3, figures=touched_figures)


def track_everyday_section(cell: Cell) -> dict[str, Any]:
    """Evaluate a method, where it was touched, on grasps of a thing's outline at a share of its height. Cell: shape,
    height (percent), noise (percent), method, grasps.
    """
    share, scale = cell["height"] / 100, cell["noise"] / 100
    data = planar_data.simulate_section(
        cell["shape"], cell.seed, height_share=share, motion_scale=scale, count=cell["grasps"]
    )
    return _track(data, cell, dimension=2, figures=touched_outline_figures)


def _track(
    data: _Data, cell: Cell, dimension: int, freedom: str = "table", figures: Figures[_Data] | None = None
) -> dict[str, Any]:
    settings = _slam_settings(cell, dimension, freedom)
    slam = TactileSlam(settings, cell.seed, data.world_T_body if settings.method == "known-pose" else None)
    for grasp in data.grasps:
        slam.add_grasp(grasp)
    started = time.perf_counter()
    result = slam.finish()
    finishing_s = time.perf_counter() - started
    further = figures(data, result) if figures else {}
    return {**slam_figures(data, result), **further, "finish_ms": round(1e3 * finishing_s, 1)}


def _slam_settings(cell: Cell, dimension: int, freedom: str) -> SlamSettings:
    """The method knows the noise of the motion, as in the thesis's simulations."""
    scale, method = max(cell["noise"] / 100, _LEAST_NOISE), cell["method"]
    given: dict[str, Any] = {
        "method": "particle" if method == WITHOUT_GRAPH else method,
        "dimension": dimension,
        "freedom": freedom,
        "motion": {"translation_m": scale * SLIP_SIGMA_m, "rotation_rad": scale * SLIP_SIGMA_rad},
    }
    if method == WITHOUT_GRAPH:
        given["back_end"] = {"enabled": False}
    if "particles" in dict(cell.setting):
        given["particles"] = cell["particles"]
    return SlamSettings.model_validate(given)


def correct_by_loops(cell: Cell) -> dict[str, Any]:
    """Drifting poses corrected by a pose graph with some of its loops. Cell: shape, constraints, grasps.

    The drift is a random walk of 2.5 mm per axis and 3 degrees per grasp, as with a filter that barely works.
    """
    data = planar_data.simulate(cell["shape"], cell.seed, count=cell["grasps"])
    rng = np.random.default_rng([cell.seed, 315])
    drifting = _drifting_map(data, rng)
    faces = FaceSettings()
    labels = assign_to_segments(drifting.contacts, contour_segments(data.outline_m, faces), faces)
    settings = PoseGraphSettings()
    loops = find_loops(drifting, labels, settings, list(range(1, len(drifting.placed))))
    accepted = [loop for loop in loops if loop.report.accepted]
    chosen = sorted(rng.permutation(len(accepted))[: cell["constraints"]])
    corrected = optimise_poses(drifting, [accepted[i] for i in chosen], settings) if chosen else drifting
    points = [grasp.points_world_m for grasp in data.grasps]
    poses = [spatial_pose(row, 0.0) for row in corrected.rows]
    return {
        **contour_figures(_outline(corrected), data.outline_m),
        "registration_mm": registration_rms_mm(points, poses, data.world_T_body, 2),
        "loops": len(chosen),
    }


def _outline(contact_map: ContactMap) -> Contour | None:
    """The outline of the most probable shape given the contacts; None if they enclose nothing."""
    try:
        return best_shape(contact_map.with_best_kernel(_KERNEL_STEPS).fit()).contour()
    except ShapeError:
        return None


def _drifting_map(data: planar_data.PlanarGrasps, rng: np.random.Generator) -> ContactMap:
    """The grasps at their true poses plus a random walk in the object's frame; the first one is unchanged."""
    drift, placed = np.zeros(3), []
    for grasp, pose in zip(data.grasps, data.world_T_body, strict=True):
        row = compose(planar_motion(pose), drift)
        covariance = np.diag(_DRIFT_SIGMAS**2) if grasp.index else 1e-10 * np.eye(3)
        contacts = ContactSet.of_grasp(grasp, 2, 0.0)
        placed.append(PlacedGrasp(contacts, row, covariance, planar_motion(grasp.hand_motion_world)))
        drift = compose(drift, _DRIFT_SIGMAS * rng.normal(size=3))
    return ContactMap(tuple(placed), GpisSettings())
