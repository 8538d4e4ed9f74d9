"""Experiments on tracking and shape in the plane."""

from __future__ import annotations

from tactile_lab.experiments.cells import Setting, grid
from tactile_lab.experiments.experiment import Experiment
from tactile_lab.experiments.runs import shape_runs, tracking_runs
from tactile_lab.experiments.runs.limits import contact_limit, contour_limit
from tactile_lab.experiments.studies.columns import (
    AGAINST_KNOWN,
    MEAN_DISTANCE,
    REGISTRATION,
    SHAPE_COLUMNS,
    TRACKING_COLUMNS,
)
from tactile_lab.experiments.studies.plots import HAUSDORFF_LABEL, condition, curves, ranges

METHODS = ("known-pose", "joint", "particle", "icp", "thesis-pf", "thesis-pf-graph", "odometry")
PLANAR_SHAPES = ("rectangle", "triangle", "ellipse", "L", "hexagon", "trapezoid", "pentagon", "stadium")
PLANAR_GRASPS = 16
FELT_NOISE = 10
"""Motion noise, percent, that odometry in the hand stays below: 1 mm and 2 degrees a step."""


def _methods_in_plane(grasps: int) -> list[Setting]:
    return [
        setting
        for noise, outliers in ((100, 0), (50, 0), (100, 10))
        for setting in grid(noise=[noise], outliers=[outliers], shape=PLANAR_SHAPES, method=METHODS, grasps=[grasps])
    ]


def _felt_in_plane(grasps: int) -> list[Setting]:
    return grid(
        noise=[FELT_NOISE], outliers=[0, 10], shape=PLANAR_SHAPES, method=("known-pose", "joint"), grasps=[grasps]
    )


def _limits_in_plane(grasps: int) -> list[Setting]:
    shapes, methods = contour_limit.POLYGONS, contact_limit.METHODS
    return grid(noise=[100, 50], sides=contact_limit.SIDES, shape=shapes, method=methods, grasps=[grasps])


METHODS_2D = Experiment(
    "methods-2d",
    "All methods on all planar shapes, at 100 % and 50 % motion noise and with 10 % outliers.",
    _methods_in_plane,
    tracking_runs.track_in_plane,
    TRACKING_COLUMNS,
    ranges("method", HAUSDORFF_LABEL, "hausdorff_mm", condition),
    pooled=("shape",),
    grasps=PLANAR_GRASPS,
)

FELT_2D = Experiment(
    "felt-2d",
    "Planar shapes at 10 % motion noise, which odometry in the hand stays below.",
    _felt_in_plane,
    tracking_runs.track_in_plane,
    TRACKING_COLUMNS,
    ranges("method", HAUSDORFF_LABEL, "hausdorff_mm", condition),
    pooled=("shape",),
    grasps=PLANAR_GRASPS,
)

CONTOUR_LIMIT = Experiment(
    "contour-limit",
    "The best that any estimate of a polygon can reach from these grasps, with poses known or estimated.",
    _limits_in_plane,
    contour_limit.limit_of_contour,
    (AGAINST_KNOWN, MEAN_DISTANCE, REGISTRATION),
    ranges("method", HAUSDORFF_LABEL, "hausdorff_mm", lambda cell: f"{cell['noise']} %, sides {cell['sides']}"),
    pooled=("shape",),
    grasps=PLANAR_GRASPS,
)

RANDOM_CONTACTS = Experiment(
    "random-contacts",
    "Shape models on random contacts of planar shapes whose pose is known.",
    lambda grasps: grid(
        shape=("rectangle", "square", "ellipse", "hexagon", "L"),
        model=list(shape_runs.SHAPE_MODELS),
        contacts=[20, 40, 80],
    ),
    shape_runs.contour_of_random_contacts,
    SHAPE_COLUMNS,
    curves("contacts", "contacts", "shape", "model"),
)
