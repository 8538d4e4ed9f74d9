"""Reproduces figures of the thesis's chapters 2 and 3."""

from __future__ import annotations

from tactile_lab.experiments.cells import Setting, grid
from tactile_lab.experiments.experiment import Experiment
from tactile_lab.experiments.groups import Column
from tactile_lab.experiments.runs import shape_runs, tracking_runs
from tactile_lab.experiments.studies.columns import (
    HAUSDORFF,
    MEAN_DISTANCE,
    REGISTRATION,
    SHAPE_COLUMNS,
    STEP,
    TRACKING_COLUMNS,
)
from tactile_lab.experiments.studies.planar import PLANAR_GRASPS
from tactile_lab.experiments.studies.plots import HAUSDORFF_LABEL, condition, curves, ranges
from tactile_lab.experiments.thesis import rig_sessions
from tactile_lab.experiments.thesis.readings import READINGS, track_as_read

THREE_SHAPES = ("rectangle", "ellipse", "hexagon")
"""The thesis does not name its three planar objects; these stand for them."""


def _noise_levels(grasps: int) -> list[Setting]:
    methods = ("known-pose", "joint", "particle", "thesis-pf")
    return grid(shape=THREE_SHAPES, method=methods, noise=[0, 25, 50, 75, 100], outliers=[0], grasps=[grasps])


def _particle_numbers(grasps: int) -> list[Setting]:
    numbers = (500, 1000, 2000, 5000, 10_000, 20_000)
    methods = ("thesis-pf", "particle")
    return grid(
        noise=[25, 50, 100], shape=THREE_SHAPES, method=methods, particles=numbers, outliers=[0], grasps=[grasps]
    )


def _graph_or_not(grasps: int) -> list[Setting]:
    methods = ("thesis-pf", "thesis-pf-graph", tracking_runs.WITHOUT_GRAPH, "particle", "joint")
    return grid(noise=[50, 100], shape=THREE_SHAPES, method=methods, outliers=[0], grasps=[grasps])


FIGURE_2_7 = Experiment(
    "figure-2.7",
    "Thesis, figure 2.7: two shapes and two kernels, error against the number of contacts.",
    lambda grasps: grid(
        shape=("rectangle", "ellipse"),
        model=list(shape_runs.SHAPE_MODELS),
        contacts=[5, 10, 15, 20, 30, 40, 60, 80],
    ),
    shape_runs.contour_of_random_contacts,
    SHAPE_COLUMNS,
    curves("contacts", "contacts", "shape", "model"),
)

FIGURE_2_12 = Experiment(
    "figure-2.12",
    "Thesis, figure 2.12: the box 12x6x6 cm, error against the number of contacts.",
    lambda grasps: grid(
        shape=["box-12x6x6"],
        model=["SE, inside and outside points", "Matérn, normals", "chosen by evidence"],
        contacts=[10, 20, 30, 40, 60, 80, 120],
    ),
    shape_runs.mesh_of_random_contacts,
    SHAPE_COLUMNS,
    curves("contacts", "contacts", "shape", "model", columns=1),
)

FIGURE_3_12 = Experiment(
    "figure-3.12",
    "Thesis, figure 3.12: error against the motion noise, three planar shapes.",
    _noise_levels,
    tracking_runs.track_in_plane,
    TRACKING_COLUMNS,
    curves("noise", "motion noise, %", "shape", "method"),
    pooled=("shape",),
    grasps=PLANAR_GRASPS,
)

FIGURE_3_14 = Experiment(
    "figure-3.14",
    "Thesis, figure 3.14: error and success of the particle filters against the number of particles.",
    _particle_numbers,
    tracking_runs.track_in_plane,
    (HAUSDORFF, REGISTRATION, Column("grasps not placed", "untracked", 0, kind="spread"), STEP),
    curves("particles", "particles", "noise", "method"),
    pooled=("shape",),
    grasps=PLANAR_GRASPS,
)

FIGURE_3_15 = Experiment(
    "figure-3.15",
    "Thesis, figure 3.15: error of drifting poses against the number of constraints in the pose graph.",
    lambda grasps: grid(shape=("rectangle", "hexagon", "L"), constraints=[0, 1, 2, 4, 8, 16, 32], grasps=[grasps]),
    tracking_runs.correct_by_loops,
    (HAUSDORFF, REGISTRATION, MEAN_DISTANCE, Column("constraints there were", "loops", 0, kind="spread")),
    curves("constraints", "constraints", "grasps", "shape", columns=1),
    pooled=("shape",),
    grasps=PLANAR_GRASPS,
)

THESIS_READINGS = Experiment(
    "thesis-readings",
    "The thesis's filter in every reading of its gate, its likelihood and its noise that the text allows.",
    lambda grasps: [
        setting
        for part, readings in READINGS.items()
        for setting in grid(
            part=[part], reading=list(readings), noise=[0, 25, 50, 100], shape=THREE_SHAPES, grasps=[grasps]
        )
    ],
    track_as_read,
    (
        HAUSDORFF,
        Column("below 9 mm", "below_9_mm", 0, kind="percent"),
        REGISTRATION,
        Column("grasps not placed", "untracked", 0, kind="spread"),
    ),
    curves("noise", "motion noise, %", "part", "reading"),
    pooled=("shape",),
    grasps=PLANAR_GRASPS,
)

FIGURE_3_16 = Experiment(
    "figure-3.16",
    "Thesis, figure 3.16: particle filters with and without the pose graph, three planar shapes.",
    _graph_or_not,
    tracking_runs.track_in_plane,
    TRACKING_COLUMNS,
    ranges("method", HAUSDORFF_LABEL, "hausdorff_mm", lambda cell: f"{cell['shape']}, {condition(cell)}"),
    pooled=("shape",),
    grasps=PLANAR_GRASPS,
)

_RIG_COLUMNS = (
    HAUSDORFF,
    MEAN_DISTANCE,
    REGISTRATION,
    Column("grasps not placed", "untracked", 0, kind="spread"),
)

FIGURE_3_20 = Experiment(
    "figure-3.20",
    "Thesis, figure 3.20: contours on the simulated rig, by the filter alone and with the pose graph.",
    lambda grasps: rig_sessions.settings(rig_sessions.PLANAR_OBJECTS, 2, grasps),
    rig_sessions.estimate_on_rig,
    _RIG_COLUMNS,
    ranges("method", HAUSDORFF_LABEL, "hausdorff_mm", lambda cell: cell["object"], columns=3),
    pooled=("object",),
    grasps=rig_sessions.GRASPS,
)

FIGURE_3_21 = Experiment(
    "figure-3.21",
    "Thesis, figure 3.21: surfaces on the simulated rig, by the filter alone and with the pose graph.",
    lambda grasps: rig_sessions.settings(rig_sessions.SOLID_OBJECTS, 3, grasps),
    rig_sessions.estimate_on_rig,
    _RIG_COLUMNS,
    ranges("method", HAUSDORFF_LABEL, "hausdorff_mm", lambda cell: cell["object"], columns=3),
    pooled=("object",),
    grasps=rig_sessions.GRASPS,
)
