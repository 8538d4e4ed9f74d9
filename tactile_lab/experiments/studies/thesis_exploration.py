"""Reproduces the figures of the thesis's chapter 4, on exploration; its tables are in a module of their own."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from tactile_lab.experiments.cells import Cell, Row, grid
from tactile_lab.experiments.experiment import Experiment
from tactile_lab.experiments.groups import Column
from tactile_lab.experiments.plot_data import DrawingPanel, Plot, Stroke
from tactile_lab.experiments.studies.columns import HAUSDORFF, MEAN_DISTANCE
from tactile_lab.experiments.studies.thesis_drawings import points_of
from tactile_lab.experiments.thesis import explored_cube, pose_actions
from tactile_lab.experiments.thesis.facets import surfaces

_MARKS = "lines: edges of the true cube; dots: contacts"


def _grasps(cell: Cell) -> str:
    return f"{cell['after']} grasp" + ("" if cell["after"] == 1 else "s")


FIGURE_4_1 = Experiment(
    "figure-4.1",
    "Thesis, figure 4.1: three measures of uncertainty over the surface of a cube after a single grasp.",
    lambda grasps: grid(measure=list(explored_cube.MEASURES)),
    explored_cube.mapped,
    (
        Column("within 10 mm of a contact", "near", 2, kind="median"),
        Column("10 to 30 mm", "between", 2, kind="median"),
        Column("beyond 30 mm", "far", 2, kind="median"),
        Column("rank correlation with the variance", "with_variance", 2, kind="median"),
    ),
    surfaces(
        lambda cell: cell["measure"],
        f"shade: the measure from its smallest value (light) to its largest (dark); {_MARKS}",
    ),
)

FIGURE_4_3 = Experiment(
    "figure-4.3",
    "Thesis, figure 4.3: the unexplored surface of a cube divided into regions, by either weighting of features.",
    lambda grasps: grid(weighting=["text", "appendix"], after=[1, 3, 6]),
    explored_cube.divided,
    (
        Column("surface unexplored", "unexplored", 0, kind="percent"),
        Column("regions", "regions", 0, kind="spread"),
        Column("extent of a region, mm: median / p95", "extents_mm", 0, kind="pooled"),
    ),
    surfaces(
        lambda cell: f"{_grasps(cell)}, weights of the {cell['weighting']}",
        f"lightest: explored; numbers: regions, the largest first; {_MARKS}",
    ),
)

FIGURE_4_4 = Experiment(
    "figure-4.4",
    "Thesis, figures 4.4 and 4.5: a cube is explored, by region, by the largest variance and at random.",
    lambda grasps: grid(policy=["clusters", "variance", "random"], after=[1, 2, 3, 33]),
    explored_cube.progress,
    (
        HAUSDORFF,
        MEAN_DISTANCE,
        Column("surface touched", "touched", 0, kind="percent"),
        Column("contacts", "contacts", 0, kind="median"),
    ),
    surfaces(
        lambda cell: f"{cell['policy']}, {_grasps(cell)}",
        f"shade: standard deviation of the surface, 0 mm (light) to 10 mm and more (dark); {_MARKS}",
        columns=4,
    ),
)


def _possible_outlines(rows: Sequence[Row]) -> Plot:
    lowest = min(row.cell.seed for row in rows)
    shown = [row for row in rows if row.cell.seed == lowest and row.figures is not None]
    return Plot(tuple(_action(row.cell["action"], (row.figures or {})["drawing"]) for row in shown), 2, _ACTIONS_KEY)


def _action(title: str, drawing: Mapping[str, Any]) -> DrawingPanel:
    possible = [Stroke("possible after the action", points_of(points)) for points in drawing["possible"]]
    return DrawingPanel(
        title, (*possible, Stroke("estimate", points_of(drawing["estimate"]))), points_of(drawing["contacts"])
    )


_ACTIONS_KEY = "twelve poses drawn from the particles, weighted by the contacts that are expected (dots); axes in mm"

FIGURE_4_6 = Experiment(
    "figure-4.6",
    "Thesis, figures 4.6 and 4.7: three grasps to localize a rectangle, and what they find.",
    lambda grasps: grid(action=[pose_actions.NOTHING, *pose_actions.ACTIONS]),
    pose_actions.try_action,
    (
        Column("KL divergence, nats", "kl", 2, kind="median"),
        Column("by det, nats", "det", 2, kind="median"),
        Column("KL chooses it", "kl_chooses", 0, kind="percent"),
        Column("det chooses it", "det_chooses", 0, kind="percent"),
        Column("is the best", "is_best", 0, kind="percent"),
        Column("position afterwards, mm", "position_mm"),
        Column("rotation, °", "rotation_deg"),
    ),
    _possible_outlines,
)

ALL = (FIGURE_4_1, FIGURE_4_3, FIGURE_4_4, FIGURE_4_6)
