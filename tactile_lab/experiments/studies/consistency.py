"""Experiment on what results say of themselves: whether stated regions hold the truth, and bad results say so."""

from __future__ import annotations

from typing import Any

import numpy as np
import trimesh

from tactile_lab.evaluation.consistency.surfaces import mesh_errors, outline_errors
from tactile_lab.evaluation.registration import FAILURE_LIMIT_MM
from tactile_lab.evaluation.truth.rotational_symmetry import stands
from tactile_lab.experiments.cells import Cell, Setting, grid
from tactile_lab.experiments.data import planar_data, second_family, spatial_data
from tactile_lab.experiments.data.planar_data import PlanarGrasps
from tactile_lab.experiments.data.sensing import (
    SimulatedGrasps,
    SLIP_SIGMA_m,
    SLIP_SIGMA_rad,
    by_biased_fingers,
    without_paths,
)
from tactile_lab.experiments.data.spatial_data import SpatialGrasps
from tactile_lab.experiments.experiment import Experiment
from tactile_lab.experiments.groups import Column
from tactile_lab.experiments.run_metrics import slam_figures
from tactile_lab.experiments.studies.columns import (
    HAUSDORFF,
    POSES_INSIDE,
    REGISTRATION,
    SIZES_INSIDE,
    SURFACE_INSIDE,
)
from tactile_lab.experiments.studies.plots import ranges
from tactile_lab.slam.result import SlamResult
from tactile_lab.slam.shape.metrics.alignment import align_contours, align_meshes
from tactile_lab.slam.slam_settings import SlamSettings
from tactile_lab.slam.tactile_slam import TactileSlam
from tactile_lab.slam.tracking.contacts.motion import MotionNoise

FIRST, SECOND, FINGERS, HELD = "first", "second", "fingers", "held"
"""The families of simulated contacts: :mod:`planar_data` and :mod:`spatial_data`; :mod:`second_family`; the first with
an error that each finger has throughout a session, as the simulated rig's have; and the first on solids held free in
space, with six degrees of freedom, as in experiment ``methods-6dof``.
"""

PLANAR_SHAPES = ("rectangle", "triangle", "ellipse", "L", "hexagon", "trapezoid", "pentagon", "stadium")
SOLIDS = ("box-12x6x6", "l-block", "cylinder", "ellipsoid")
HELD_SOLIDS = ("box-12x6x6", "triangular-prism", "l-block", "ellipsoid")
_HELD_MOTION = 0.5
_MORE_GRASPS_IN_SPACE = 1.5
_FAR_SIGMAS, _FAR_SHARE = 5.0, 0.01
"""A shape is off if more than this share of it is farther from the truth than so many stated standard deviations."""


def _settings(grasps: int) -> list[Setting]:
    shapes = {(FIRST, 2): PLANAR_SHAPES, (FIRST, 3): SOLIDS, (SECOND, 2): second_family.SHAPES}
    shapes[SECOND, 3] = second_family.SHAPES
    shapes |= {(FINGERS, 2): PLANAR_SHAPES, (FINGERS, 3): SOLIDS, (HELD, 3): HELD_SOLIDS}
    return [
        setting
        for (family, dimension), names in shapes.items()
        for wrong in ((0, 10) if family in (FIRST, SECOND) else (0,))
        for setting in grid(family=[family], dimension=[dimension], wrong=[wrong], shape=names, grasps=[grasps])
    ]


def assessed_run(cell: Cell) -> dict[str, Any]:
    """Judge a run of the default method and what it says of itself. Cell: family, dimension, wrong (percent), shape,
    grasps (in the plane; in space half as many again).

    Approach paths are unknown where contacts are wrong.
    """
    data = _data(cell)
    slam = TactileSlam(_slam_settings(cell), cell.seed)
    for grasp in data.grasps:
        slam.add_grasp(grasp)
    result = slam.finish()
    figures = slam_figures(data, result)
    far_mm = (figures["registration_mm"], figures["hausdorff_mm"])
    off = any(mm is None or mm > FAILURE_LIMIT_MM for mm in far_mm) or _far_share(data, result) > _FAR_SHARE
    told = result.status != "complete"
    return {
        **figures,
        "known_share": result.known_share,
        "doubts": [doubt.name for doubt in result.doubts],
        "off": int(off),
        "off_told": int(off and told),
        "good": int(not off),
        "good_told": int(not off and told),
    }


def _slam_settings(cell: Cell) -> SlamSettings:
    if cell["family"] == HELD:
        motion = MotionNoise(translation_m=_HELD_MOTION * SLIP_SIGMA_m, rotation_rad=_HELD_MOTION * SLIP_SIGMA_rad)
        return SlamSettings(dimension=3, freedom="space", motion=motion)
    palm_m = second_family.PALM_SIGMA_m if cell["family"] == SECOND else 0.0
    return SlamSettings(dimension=cell["dimension"], motion=MotionNoise(palm_m=palm_m))


def _data(cell: Cell) -> PlanarGrasps | SpatialGrasps:
    flat, wrong = cell["dimension"] == 2, cell["wrong"] / 100
    count = cell["grasps"] if flat else round(_MORE_GRASPS_IN_SPACE * cell["grasps"])
    if cell["family"] == SECOND:
        found = second_family.simulate(
            cell["shape"], cell.seed, dimension=cell["dimension"], count=count, wrong_share=wrong, paths=not wrong
        )
        if flat:
            return PlanarGrasps(found.shape, found.grasps, found.world_T_body, found.body.outline_m)
        corners = found.body.triangles_m
        mesh = trimesh.Trimesh(corners.reshape(-1, 3), np.arange(3 * len(corners)).reshape(-1, 3))
        return SpatialGrasps(found.shape, found.grasps, found.world_T_body, mesh)
    if cell["family"] == HELD:
        return spatial_data.simulate(cell["shape"], cell.seed, motion="free", motion_scale=_HELD_MOTION, count=count)
    simulate = planar_data.simulate if flat else spatial_data.simulate
    data: PlanarGrasps | SpatialGrasps = simulate(cell["shape"], cell.seed, count=count, outlier_share=wrong)
    if cell["family"] == FINGERS:
        data = by_biased_fingers(data, cell.seed)
    return without_paths(data) if wrong else data


def _far_share(data: SimulatedGrasps, result: SlamResult) -> float:
    """Share of the estimated shape that is many stated standard deviations off, at the best fit; 1 without a shape."""
    if isinstance(data, PlanarGrasps) and result.contour is not None:
        outline, truth = result.contour, data.outline_m
        fit = align_contours(outline.points_m, truth)
        errors_m, sigma_m = outline_errors(outline.points_m, outline.sigma_m, truth, fit)
    elif isinstance(data, SpatialGrasps) and result.mesh is not None:
        upright = all(map(stands, data.world_T_body))
        fitted = align_meshes(result.mesh, data.mesh, upright=upright)
        errors_m, sigma_m = mesh_errors(result.mesh, result.mesh.sigma_m, data.mesh, fitted, upright=upright)
    else:
        return 1.0
    return float(np.mean(np.abs(errors_m) > _FAR_SIGMAS * sigma_m))


def _where(cell: Cell) -> str:
    if cell["family"] == HELD:
        return "held free"
    return "in the plane" if cell["dimension"] == 2 else "in space"


def _panel(cell: Cell) -> str:
    return f"{cell['family']} family, {_where(cell)}, {cell['wrong']} % wrong"


CONSISTENCY = Experiment(
    "consistency",
    "Whether the uncertainties that the default method states are true, on four families of simulated contacts.",
    _settings,
    assessed_run,
    (
        HAUSDORFF,
        REGISTRATION,
        POSES_INSIDE,
        Column("in the common frame", "common_poses_inside", 0, kind="shares"),
        SURFACE_INSIDE,
        SIZES_INSIDE,
        Column("touched", "known_share", 0, kind="percent"),
        Column("off by 5 mm or 5 sigma", "off", 0, kind="sum"),
        Column("told, of those off", "off_told", 0, kind="sum"),
        Column("good", "good", 0, kind="sum"),
        Column("told, of those good", "good_told", 0, kind="sum"),
    ),
    ranges("shape", "registration, mm", "registration_mm", _panel),
    pooled=("shape",),
    kind=_where,
    grasps=16,
)
