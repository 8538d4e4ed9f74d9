"""What the hand feels while it moves things: how carried objects slip, and what held ones weigh."""

from __future__ import annotations

from drivers.simulation.objects import CATALOGUE
from tactile_lab.experiments.cells import Cell, Setting, grid
from tactile_lab.experiments.experiment import Experiment
from tactile_lab.experiments.groups import Column
from tactile_lab.experiments.runs.carried_objects import MASS_kg, carry_object
from tactile_lab.experiments.runs.carried_sessions import GRASPS, PALM, TOUCH, estimate_carried
from tactile_lab.experiments.runs.weighed_objects import weigh_object
from tactile_lab.experiments.studies.columns import HAUSDORFF, MEAN_DISTANCE, REGISTRATION
from tactile_lab.experiments.studies.plots import ranges
from tactile_lab.experiments.studies.solids import EVERYDAY_SCANS, scans_left_out

_OTHER_MASSES_kg = (0.05, 1.0, 2.0)
_WEIGHED_MASSES_kg = (0.05, 0.1, 0.2, 0.3, 0.4, 0.6)
_WEIGHINGS = 3


def _carried(grasps: int) -> list[Setting]:
    """Every object and scan as it is usual, and a box of other masses, which is first weighed or not."""
    scans = () if scans_left_out(EVERYDAY_SCANS) else EVERYDAY_SCANS
    return [
        *grid(object=[*CATALOGUE, *scans], mass_kg=[MASS_kg], weighed=[0], grasps=[grasps]),
        *grid(object=["box-10x6x4"], mass_kg=list(_OTHER_MASSES_kg), weighed=[0, 1], grasps=[grasps]),
    ]


def _kind(cell: Cell) -> str:
    return "of the catalogue" if cell["object"] in CATALOGUE else "scans, lying"


CARRIES = Experiment(
    "carries",
    "Carried objects: how they slipped, and how far off odometry in the hand is, as measured and with a worse hand.",
    _carried,
    carry_object,
    (
        Column("carries", "carries", 0, kind="sum"),
        Column("foretold to slip", "foretold", 0, kind="sum"),
        Column("slipped, mm: median / p95", "palm_carry_mm", 2, kind="pooled"),
        Column("slipped, °", "palm_carry_deg", 1, kind="pooled"),
        Column("odometry off, mm", "as_measured_carry_mm", 2, kind="pooled"),
        Column("odometry off, °", "as_measured_carry_deg", 2, kind="pooled"),
        Column("worse hand, mm", "all_of_these_carry_mm", 2, kind="pooled"),
        Column("worse hand, °", "all_of_these_carry_deg", 2, kind="pooled"),
        Column("gains, mm", "joint_gains_carry_mm", 2, kind="pooled"),
        Column("play, mm", "play_carry_mm", 2, kind="pooled"),
        Column("bending, mm", "bending_carry_mm", 2, kind="pooled"),
        Column("crosstalk, mm", "crosstalk_carry_mm", 2, kind="pooled"),
        Column("late forces, mm", "late_forces_carry_mm", 2, kind="pooled"),
        Column("palm, next capture, mm rms", "palm_step_axis_mm", 2, kind="rms"),
        Column("palm, next capture, ° rms", "palm_step_deg", 2, kind="rms"),
        Column("odometry, next capture, mm rms", "as_measured_step_axis_mm", 2, kind="rms"),
        Column("odometry, next capture, ° rms", "as_measured_step_deg", 2, kind="rms"),
        Column("worse hand, next capture, mm rms", "all_of_these_step_axis_mm", 2, kind="rms"),
        Column("worse hand, next capture, ° rms", "all_of_these_step_deg", 2, kind="rms"),
        Column("odometry, next capture, mm", "as_measured_step_mm", 2, kind="pooled"),
        Column("odometry, next capture, °", "as_measured_step_deg", 2, kind="pooled"),
        Column("within 1 / 2 / 3 sigma of their law, mm", "law_z_mm", 0, kind="within"),
        Column("within 1 / 2 / 3 sigma of their law, °", "law_z_deg", 0, kind="within"),
        Column("within 1 / 2 / 3 standard deviations, mm", "stated_z_mm", 0, kind="within"),
        Column("within 1 / 2 / 3 standard deviations, °", "stated_z_deg", 0, kind="within"),
    ),
    ranges("object", "odometry off at the next capture, mm", "worst_step_mm", lambda cell: f"{cell['mass_kg']} kg"),
    pooled=("object",),
    kind=_kind,
    grasps=5,
    left_out=lambda: scans_left_out(EVERYDAY_SCANS),
)

CARRIED_3D = Experiment(
    "carried-3d",
    "Sessions in space in which the hand carries the object after every grasp, with and without odometry in the hand.",
    lambda grasps: grid(object=list(CATALOGUE), dimension=[3], grasps=[grasps], odometry=[PALM, TOUCH]),
    estimate_carried,
    (
        REGISTRATION,
        Column("registration above 5 mm", "lost", 0, kind="sum"),
        HAUSDORFF,
        MEAN_DISTANCE,
        Column("grasps not placed", "untracked", 0, kind="sum"),
        Column("grasps", "grasps_done", 0, kind="sum"),
        Column("slid farthest, mm", "slid_mm", 1),
        Column("odometry said, mm", "said_mm", 1),
        Column("off by, mm", "said_off_mm", 1),
        Column("stated, mm", "said_sigma_mm", 1),
    ),
    ranges("odometry", "Registration error, mm", "registration_mm", lambda cell: str(cell["object"])),
    pooled=("object",),
    grasps=GRASPS,
)

WEIGHING = Experiment(
    "weighing",
    "Held objects that are dragged, lifted and set down: mass, centre and friction against the truth.",
    lambda grasps: grid(object=list(CATALOGUE), mass_kg=list(_WEIGHED_MASSES_kg), grasps=[grasps]),
    weigh_object,
    (
        Column("weighed", "weighed", 0, kind="percent"),
        Column("mass off, %: median / p95", "mass_off", 1, kind="pooled"),
        Column("mass within 1 / 2 / 3 sigma", "mass_z", 0, kind="within"),
        Column("weighed on an edge", "tipped", 0, kind="percent"),
        Column("their mass off, %", "tipped_mass_off", 1, kind="pooled"),
        Column("their mass within", "tipped_mass_z", 0, kind="within"),
        Column("centre off, mm", "centre_off_mm", 1, kind="pooled"),
        Column("centre within", "centre_z", 0, kind="within"),
        Column("table's friction off", "table_off", 3, kind="pooled"),
        Column("friction within", "table_z", 0, kind="within"),
        Column("fingertips' friction at least", "tips_at_least", 2, kind="pooled"),
    ),
    ranges("object", "mass off, %", "worst_mass_off", lambda cell: f"{cell['mass_kg']} kg"),
    pooled=("object",),
    grasps=_WEIGHINGS,
)
