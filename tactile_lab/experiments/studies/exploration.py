"""Experiments on the choice of the next grasp: tables of the thesis, and the simulated hand."""

from __future__ import annotations

from collections.abc import Callable

from tactile_lab.experiments.cells import Cell, Setting, Work
from tactile_lab.experiments.experiment import Experiment
from tactile_lab.experiments.groups import Column
from tactile_lab.experiments.runs import exploration_runs, hand_exploration, kinematic_exploration
from tactile_lab.experiments.studies.columns import HAUSDORFF, REGISTRATION
from tactile_lab.experiments.studies.plots import ranges

EXPLORATION_COLUMNS = (
    Column("actions by B", "actions_B", 1, kind="estimate"),
    Column("actions by A", "actions_A", 1, kind="estimate"),
    Column("by B: median / p90 / max", "actions_B", 0),
    Column("by A: median / p90 / max", "actions_A", 0),
    Column("decision, ms: median / p95", "decision_ms", 0, kind="pooled"),
    Column("correlation of promised and realised share", "promises", 2, kind="correlation"),
)
HAND_COLUMNS = (
    Column("actions by A, budget where not reached", "at_most_A", 1, kind="estimate"),
    Column("by A: median / p90 / max", "actions_A", 0),
    Column("actions by B, budget where not reached", "at_most_B", 1, kind="estimate"),
    Column("mean share over the actions by A", "area_A", 3, kind="estimate"),
    Column("touched", "area_touched", 3, kind="estimate"),
    Column("touched at the end", "share_touched", 0, kind="percent"),
    Column("simulated minutes by A", "minutes_A", 1),
    Column("times carried", "carried", 1, kind="mean"),
    HAUSDORFF,
    REGISTRATION,
    Column("correlation of promised and touched share", "promises", 2, kind="correlation"),
)
_ACTIONS_LABEL = "actions until 90 % of the contour is explored (definition B)"


def _hand_condition(cell: Cell) -> str:
    return f"{cell['object']}, {cell['dimension']}-D"


TABLE_4_2 = Experiment(
    "table-4.2",
    "Thesis, table 4.2: actions until 90 % of a fixed rectangle's contour is explored, policies and bounds.",
    exploration_runs.fixed_settings,
    exploration_runs.explore_fixed,
    EXPLORATION_COLUMNS,
    ranges("policy", _ACTIONS_LABEL, "actions_B", lambda cell: f"{cell['candidates']} candidates", columns=1),
    grasps=exploration_runs.MOST_GRASPS,
)

TABLE_4_3 = Experiment(
    "table-4.3",
    "Thesis, table 4.3: the same of a rectangle that every grasp pushes aside, at full motion noise.",
    exploration_runs.moving_settings,
    exploration_runs.explore_moving,
    (*EXPLORATION_COLUMNS, REGISTRATION),
    ranges("policy", _ACTIONS_LABEL, "actions_B", lambda cell: f"followed by {cell['tracking']}", columns=1),
    grasps=exploration_runs.MOST_GRASPS,
)


def _by_the_hand(
    name: str,
    sentence: str,
    settings: Callable[[int], list[Setting]],
    run: Work,
    by: str = "policy",
) -> Experiment:
    """An experiment whose candidates are the hand's own."""
    label = "actions until 90 % is explored (definition A)"
    plot = ranges(by, label, "actions_A", _hand_condition, columns=2)
    return Experiment(
        name, sentence, settings, run, HAND_COLUMNS, plot, pooled=("object",), grasps=hand_exploration.ACTIONS
    )


EXPLORATION_HAND = _by_the_hand(
    "exploration-hand",
    "The simulated hand's own candidates, 72 and more: actions until 90 % of an object is explored, by policy.",
    hand_exploration.settings,
    hand_exploration.explore_by_hand,
)

EXPLORATION_KINEMATIC = _by_the_hand(
    "exploration-kinematic",
    "The same candidates, policies and estimation without physics: kinematics on the true surface, measured noise.",
    kinematic_exploration.settings,
    kinematic_exploration.explore_by_kinematics,
)

EXPLORATION_FELT = _by_the_hand(
    "exploration-felt",
    "Exploration without physics where the hand feels how a carried object moved, beside a hand that does not.",
    kinematic_exploration.felt_settings,
    kinematic_exploration.explore_felt,
    by="odometry",
)
