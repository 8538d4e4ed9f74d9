"""Reproduces the thesis's pictures of shapes, with their errors over seeds, and compares the shape models of chapter 2.

A drawing shows the lowest seed; the tables have all. Pictures of solids are drawn as horizontal sections.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

from tactile_lab.experiments.cells import Cell, Row, grid
from tactile_lab.experiments.experiment import Experiment, PlotOf
from tactile_lab.experiments.groups import Column
from tactile_lab.experiments.plot_data import DrawingPanel, Plot, Stroke
from tactile_lab.experiments.studies.columns import HAUSDORFF, MEAN_DISTANCE, SURFACE_INSIDE
from tactile_lab.experiments.studies.plots import HAUSDORFF_LABEL, ranges
from tactile_lab.experiments.thesis import progress, shape_drawings, shape_models

THREE_SHAPES = ("rectangle", "triangle", "ellipse")
KERNELS = ("SE kernel", "TP kernel")
_TRUTH = "true"
_ERRORS = (HAUSDORFF, MEAN_DISTANCE)
_BESIDE = Column("within 10 mm of contacts, mm", "beside_mm")
"""Of a shape that is touched on one side only: elsewhere it is open, and cut off 60 mm beyond the contacts."""


def drawings(panel_of: Callable[[Cell], str], line: str, *, columns: int = 3) -> PlotOf:
    """The lowest seed's outlines: a panel for each title, a line for each value of the setting ``line``."""

    def plot(rows: Sequence[Row]) -> Plot:
        lowest = min(row.cell.seed for row in rows)
        panels: dict[str, list[Row]] = {}
        for row in rows:
            if row.cell.seed == lowest and row.figures is not None:
                panels.setdefault(panel_of(row.cell), []).append(row)
        return Plot(tuple(_panel(title, found, line) for title, found in panels.items()), columns)

    return plot


def _panel(title: str, rows: Sequence[Row], line: str) -> DrawingPanel:
    drawn = [(str(row.cell[line]), (row.figures or {})["drawing"]) for row in rows]
    strokes = [Stroke(name, points_of(drawing["estimate"])) for name, drawing in drawn if drawing["estimate"]]
    first = drawn[0][1]
    dots = points_of(first["contacts"]) if len(rows) == 1 or _same_contacts(drawn) else ()
    return DrawingPanel(title, (Stroke(_TRUTH, points_of(first["truth"])), *strokes), dots)


def _same_contacts(drawn: Sequence[tuple[str, dict[str, list[list[float]]]]]) -> bool:
    return all(drawing["contacts"] == drawn[0][1]["contacts"] for _, drawing in drawn)


def points_of(found: Sequence[Sequence[float]]) -> tuple[tuple[float, float], ...]:
    """Points of a drawing in a row's figures, millimetres."""
    return tuple((x, y) for x, y in found)


FIGURE_2_5 = Experiment(
    "figure-2.5",
    "Thesis, figures 2.5 and 2.6: a rectangle grows with its contacts, by either kernel; places known.",
    lambda grasps: grid(shape=["rectangle"], contacts=[5, 10, 20, 40, 80], model=KERNELS),
    shape_drawings.random_places,
    _ERRORS,
    drawings(lambda cell: f"{cell['contacts']} contacts", "model"),
)

FIGURE_2_8 = Experiment(
    "figure-2.8",
    "Thesis, figure 2.8, in the plane: twelve contacts on one side, and what a prior makes of the other.",
    lambda grasps: grid(
        shape=["ellipse", "hexagon"], model=["prior outside", "prior zero", "prior sphere", "prior ellipsoid"]
    ),
    shape_drawings.one_side,
    (*_ERRORS, _BESIDE),
    drawings(lambda cell: cell["shape"], "model", columns=2),
)

FIGURE_2_9 = Experiment(
    "figure-2.9",
    "Thesis, figure 2.9: a corner from three contacts, by fields and by edge features.",
    lambda grasps: grid(shape=["rectangle"], model=[*KERNELS, shape_drawings.EDGE_FEATURES]),
    shape_drawings.corner,
    (Column("distance from the corner, mm", "corner_mm"),),
    drawings(lambda cell: cell["model"], "model"),
)

FIGURE_2_11 = Experiment(
    "figure-2.11",
    "Thesis, figures 2.10 and 2.11: a cube from a few contacts, and the box 12x6x6 cm as contacts are added.",
    lambda grasps: [
        *grid(shape=["cube-6"], contacts=[5, 10], model=KERNELS),
        *grid(shape=["box-12x6x6"], contacts=[10, 20, 40, 80], model=KERNELS),
    ],
    shape_drawings.random_places_in_space,
    _ERRORS,
    drawings(lambda cell: f"{cell['shape']}, {cell['contacts']} contacts", "model"),
)

FIGURE_2_14 = Experiment(
    "figure-2.14",
    "Thesis, figure 2.14: outlines from a single grasp, by either kernel.",
    lambda grasps: grid(shape=THREE_SHAPES, model=KERNELS),
    shape_drawings.one_grasp,
    (*_ERRORS, _BESIDE),
    drawings(lambda cell: cell["shape"], "model"),
)

FIGURE_2_15 = Experiment(
    "figure-2.15",
    "Thesis, figure 2.15: a cube and a sphere from a single grasp, by either kernel.",
    lambda grasps: grid(shape=("cube-6", "sphere"), model=KERNELS),
    shape_drawings.one_grasp_in_space,
    _ERRORS,
    drawings(lambda cell: cell["shape"], "model", columns=2),
)

FIGURE_3_11 = Experiment(
    "figure-3.11",
    "Thesis, figure 3.11: three planar objects grow while they are tracked, at full motion noise.",
    lambda grasps: grid(
        shape=("rectangle", "ellipse", "hexagon"), after=[1, 4, 8, 16], noise=[100], method=["joint", "thesis-pf"]
    ),
    progress.outline_after,
    _ERRORS,
    drawings(lambda cell: f"{cell['shape']}, {cell['after']} grasps", "method", columns=4),
)

FIGURE_3_13 = Experiment(
    "figure-3.13",
    "Thesis, figure 3.13: three solids grow while they are tracked, at full motion noise.",
    lambda grasps: grid(shape=("box-12x6x6", "cylinder", "l-block"), after=[1, 4, 12], noise=[100], method=["joint"]),
    progress.surface_after,
    _ERRORS,
    drawings(lambda cell: f"{cell['shape']}, {cell['after']} grasps", "method", columns=3),
)

_MODEL_COLUMNS = (
    HAUSDORFF,
    MEAN_DISTANCE,
    Column("overlap", "iou", 2, kind="median"),
    SURFACE_INSIDE,
    Column("time, ms", "fit_ms", 0, kind="median"),
)

SHAPE_MODELS = Experiment(
    "shape-models",
    "All shape models of chapter 2 on the same contacts of planar shapes, places known.",
    lambda grasps: grid(shape=("rectangle", "ellipse", "L"), contacts=[20, 80], model=shape_models.MODELS),
    shape_models.in_plane,
    _MODEL_COLUMNS,
    ranges("model", HAUSDORFF_LABEL, "hausdorff_mm", lambda cell: f"{cell['contacts']} contacts"),
    pooled=("shape",),
)

SHAPE_MODELS_3D = Experiment(
    "shape-models-3d",
    "All shape models of chapter 2 on the same contacts of solids, places known.",
    lambda grasps: grid(shape=("box-12x6x6", "sphere", "l-block"), contacts=[40], model=shape_models.MODELS),
    shape_models.in_space,
    _MODEL_COLUMNS,
    ranges("model", HAUSDORFF_LABEL, "hausdorff_mm", lambda cell: f"{cell['contacts']} contacts"),
    pooled=("shape",),
)

ALL = (
    FIGURE_2_5,
    FIGURE_2_8,
    FIGURE_2_9,
    FIGURE_2_11,
    FIGURE_2_14,
    FIGURE_2_15,
    FIGURE_3_11,
    FIGURE_3_13,
    SHAPE_MODELS,
    SHAPE_MODELS_3D,
)
