"""What one run of each experiment does: from a cell to its figures."""

from __future__ import annotations

import time
from typing import Any

import numpy as np

from tactile_lab.errors import ShapeError
from tactile_lab.experiments import planar_data, spatial_data
from tactile_lab.experiments.cells import Cell
from tactile_lab.experiments.graph_stress import (
    StressGraph,
    stock_solvers,
    stress_graph,
    trajectory_errors,
)
from tactile_lab.experiments.merit import contour_figures, mesh_figures, slam_figures
from tactile_lab.experiments.sensing import SimulatedGrasps, SLIP_SIGMA_m, SLIP_SIGMA_rad
from tactile_lab.graph.faces import FaceSettings, assign_to_segments, contour_segments
from tactile_lab.graph.pose_graph import PoseGraphSettings, find_loops, optimise_poses
from tactile_lab.graph.robust import solve_robustly
from tactile_lab.shape.choice import GpisShape, best_shape
from tactile_lab.shape.gpis import Gpis
from tactile_lab.shape.model import FittedShape
from tactile_lab.shape.settings import GpisSettings
from tactile_lab.slam import SlamSettings, TactileSlam
from tactile_lab.tracking.contact_map import ContactMap, PlacedGrasp
from tactile_lab.tracking.contact_set import ContactSet
from tactile_lab.tracking.motion import compose, planar_motion

WITHOUT_GRAPH = "particle, no graph"
"""The calibrated filter whose poses the pose graph does not correct."""

SHAPE_MODELS: dict[str, GpisSettings] = {
    "SE, inside and outside points": GpisSettings(
        observations="offsurface", kernel="squared_exponential", prior_mean="zero"
    ),
    "TP, inside and outside points": GpisSettings(observations="offsurface", kernel="thin_plate", prior_mean="zero"),
    "SE, normals": GpisSettings(kernel="squared_exponential"),
    "TP, normals": GpisSettings(kernel="thin_plate"),
    "Matérn, normals": GpisSettings(),
    "chosen by evidence": GpisSettings(),
}
"""Shape models by the names of tables and plots; the first two are the thesis's."""

MOST_CONTACTS = 160
_LEAST_NOISE = 0.05
_DRIFT_SIGMAS = np.array([0.0015, 0.0015, np.deg2rad(1.7)])
_KERNEL_STEPS = 30


def track_in_plane(cell: Cell) -> dict[str, Any]:
    """A method on planar grasps. Cell: shape, noise (percent), outliers (percent), method, grasps, particles."""
    data = planar_data.simulate(
        cell["shape"],
        cell.seed,
        motion_scale=cell["noise"] / 100,
        count=cell["grasps"],
        outlier_share=cell["outliers"] / 100,
    )
    return _tracked(data, cell, dimension=2)


def track_on_table(cell: Cell) -> dict[str, Any]:
    """A method on grasps of a solid. Cell: as in the plane, without outliers."""
    scale = cell["noise"] / 100
    data = spatial_data.simulate(cell["shape"], cell.seed, motion_scale=scale, count=cell["grasps"])
    return _tracked(data, cell, dimension=3)


def _tracked(data: SimulatedGrasps, cell: Cell, dimension: int) -> dict[str, Any]:
    settings = _slam_settings(cell, dimension)
    slam = TactileSlam(settings, cell.seed, data.world_T_body if settings.method == "known-pose" else None)
    for grasp in data.grasps:
        slam.take(grasp)
    started = time.perf_counter()
    result = slam.finish()
    finishing_s = time.perf_counter() - started
    return {**slam_figures(data, result), "finish_ms": round(1e3 * finishing_s, 1)}


def _slam_settings(cell: Cell, dimension: int) -> SlamSettings:
    """The method is told the noise of the motion, as the thesis's simulations tell theirs."""
    scale, method = max(cell["noise"] / 100, _LEAST_NOISE), cell["method"]
    given: dict[str, Any] = {
        "method": "particle" if method == WITHOUT_GRAPH else method,
        "dimension": dimension,
        "motion": {"translation_m": scale * SLIP_SIGMA_m, "rotation_rad": scale * SLIP_SIGMA_rad},
    }
    if method == WITHOUT_GRAPH:
        given["back_end"] = {"enabled": False}
    if "particles" in dict(cell.setting):
        given["particles"] = cell["particles"]
    return SlamSettings.model_validate(given)


def contour_of_random_contacts(cell: Cell) -> dict[str, Any]:
    """A shape model on random contacts with known poses. Cell: shape, model, contacts."""
    data = planar_data.random_contacts(cell["shape"], MOST_CONTACTS, cell.seed)
    shape, seconds = _fitted(_first_contacts(data, cell["contacts"], 2), cell["model"])
    return {**contour_figures(shape.contour(), data.outline_m), "model": shape.name, "fit_ms": 1e3 * seconds}


def mesh_of_random_contacts(cell: Cell) -> dict[str, Any]:
    """As :func:`contour_of_random_contacts` for a solid on the table, whose height is known."""
    data = spatial_data.random_contacts(cell["shape"], MOST_CONTACTS, cell.seed)
    shape, seconds = _fitted(_first_contacts(data, cell["contacts"], 3), cell["model"])
    figures = mesh_figures(shape.mesh(floor_m=0.0), data.mesh)
    return {**figures, "model": shape.name, "fit_ms": 1e3 * seconds}


def _first_contacts(data: SimulatedGrasps, count: int, dimension: int) -> ContactSet:
    """The first contacts in the world, which for random contacts is the object's frame but for its height."""
    sets = [ContactSet.of_grasp(grasp, dimension, 0.0) for grasp in data.grasps]
    return ContactSet.concatenated(sets).selected(np.arange(count))


def _fitted(contacts: ContactSet, model: str) -> tuple[FittedShape, float]:
    """A shape model with its kernel optimised, and the seconds that took."""
    started = time.perf_counter()
    gpis = Gpis.fit(
        contacts.points_m, contacts.normals, contacts.point_sigma_m, contacts.normal_sigma_rad, SHAPE_MODELS[model]
    ).optimise(max_iterations=_KERNEL_STEPS)
    shape = best_shape(gpis) if model == "chosen by evidence" else GpisShape(gpis)
    return shape, time.perf_counter() - started


def correct_by_loops(cell: Cell) -> dict[str, Any]:
    """Drifting poses corrected by a pose graph with some of its loops. Cell: shape, constraints, grasps.

    The drift is a random walk of 1.5 mm per axis and 1.7 degrees a grasp, what a filter that works leaves.
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
    try:
        contour = GpisShape(corrected.with_best_kernel(_KERNEL_STEPS).fit()).contour()
    except ShapeError:  # poses that fit together so badly that they enclose nothing
        contour = None
    return {**contour_figures(contour, data.outline_m), "loops": len(chosen)}


def _drifting_map(data: planar_data.PlanarGrasps, rng: np.random.Generator) -> ContactMap:
    """The grasps at their true poses moved by a random walk in the object's frame; the first stays."""
    drift, placed = np.zeros(3), []
    for grasp, pose in zip(data.grasps, data.world_T_body, strict=True):
        row = compose(planar_motion(pose), drift)
        covariance = np.diag(_DRIFT_SIGMAS**2) if grasp.index else 1e-10 * np.eye(3)
        contacts = ContactSet.of_grasp(grasp, 2, 0.0)
        placed.append(PlacedGrasp(contacts, row, covariance, planar_motion(grasp.hand_motion_world)))
        drift = compose(drift, _DRIFT_SIGMAS * rng.normal(size=3))
    return ContactMap(tuple(placed), GpisSettings())


def solve_stressed_graph(cell: Cell) -> dict[str, Any]:
    """A solver on a pose graph with wrong loops. Cell: solver, one of gtsam's or "ours"."""
    graph = stress_graph(cell.seed)
    started = time.perf_counter()
    if cell["solver"] != OUR_SOLVER:
        rows = stock_solvers()[cell["solver"]](graph)
        verdicts = {}
    else:
        solution = solve_robustly(graph.odometry, graph.loops)
        rows, verdicts = solution.rows, _verdicts(graph, solution.accepted)
    seconds = time.perf_counter() - started
    metres, radians = trajectory_errors(rows, graph.rows)
    return {"error_mm": 1e3 * metres, "error_deg": float(np.rad2deg(radians)), "ms": 1e3 * seconds, **verdicts}


OUR_SOLVER = "ours"


def _verdicts(graph: StressGraph, accepted: Any) -> dict[str, Any]:
    return {
        "wrong_loops": int(graph.wrong.sum()),
        "wrong_accepted": int((accepted & graph.wrong).sum()),
        "right_refused": int((~accepted & ~graph.wrong).sum()),
    }
