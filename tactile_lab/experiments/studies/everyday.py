"""Objects that a hand can hold: everyday things, as a user would try them."""

from __future__ import annotations

from tactile_lab.experiments.cells import Cell, Setting
from tactile_lab.experiments.experiment import Experiment
from tactile_lab.experiments.groups import Column
from tactile_lab.experiments.studies import everyday_sessions
from tactile_lab.experiments.studies.columns import HAUSDORFF, MEAN_DISTANCE, REGISTRATION, SIZES_INSIDE
from tactile_lab.experiments.studies.plots import HAUSDORFF_LABEL, ranges
from tactile_lab.experiments.studies.solids import scans_left_out


def _settings(grasps: int) -> list[Setting]:
    everything = everyday_sessions.settings(grasps)
    return [one for one in everything if not _scans_left_out() or dict(one)["object"] not in everyday_sessions.SCANS]


def _scans_left_out() -> str:
    return scans_left_out(everyday_sessions.SCANS)


def _panel(cell: Cell) -> str:
    return f"{cell['pose']}, {cell['dimension']}-D"


HANDS = Experiment(
    "hands",
    "Whole sessions of a left hand and of a Lite hand, compared with the right hand with five fingers.",
    everyday_sessions.settings_of_hands,
    everyday_sessions.explore_everyday,
    (
        Column("ended complete or partial", "in_order", 0, kind="percent"),
        Column("contacts", "contacts", 0, kind="median"),
        HAUSDORFF,
        MEAN_DISTANCE,
        REGISTRATION,
        Column("highest force outside a grasp, N", "outside_N", 2),
    ),
    ranges("rig", HAUSDORFF_LABEL, "hausdorff_mm", lambda cell: str(cell["object"]), columns=1),
    grasps=6,
)

EVERYDAY_OBJECTS = Experiment(
    "everyday-objects",
    "Sessions on everyday objects, standing and lying: how they end, with what force, and what model.",
    _settings,
    everyday_sessions.explore_everyday,
    (
        Column("ended complete or partial", "in_order", 0, kind="percent"),
        Column("grasps", "grasps_done", 0, kind="median"),
        Column("contacts", "contacts", 0, kind="median"),
        Column("highest force outside a grasp, N", "outside_N", 2),
        Column("of a link outside a grasp, N", "link_N", 1),
        Column("in a grasp, N", "grasp_N", 1),
        Column("object moved, mm", "moved_mm"),
        HAUSDORFF,
        MEAN_DISTANCE,
        Column("Hausdorff where touched, mm", "touched_hausdorff_mm"),
        Column("touched share", "touched_share", 0, kind="percent"),
        Column("share in reach known to 5 mm", "known_share", 0, kind="percent"),
        Column("Hausdorff in reach, mm", "reach_hausdorff_mm"),
        REGISTRATION,
        SIZES_INSIDE,
        Column("simulated minutes", "minutes", 1, kind="median"),
        Column("processor minutes", "cpu_minutes", 1, kind="median"),
    ),
    ranges("object", HAUSDORFF_LABEL, "hausdorff_mm", _panel, columns=1),
    pooled=("object", "pose"),
    grasps=everyday_sessions.GRASPS,
    left_out=_scans_left_out,
)
