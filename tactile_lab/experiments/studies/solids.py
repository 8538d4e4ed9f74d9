"""Experiments on tracking and shape of solids, on a table and held free."""

from __future__ import annotations

from drivers.core.errors import ConfigurationError
from tactile_lab.experiments.cells import Cell, Setting, grid
from tactile_lab.experiments.data.household import HOUSEHOLD
from tactile_lab.experiments.data.solids import FURTHER_SHAPES, MORE_YCB_NAMES, YCB_NAMES, YCB_PREFIX, ycb_path
from tactile_lab.experiments.experiment import Experiment
from tactile_lab.experiments.groups import Column
from tactile_lab.experiments.runs import tracking_runs
from tactile_lab.experiments.runs.limits import contact_limit, known_shape, solid_limit
from tactile_lab.experiments.studies import everyday_shape
from tactile_lab.experiments.studies.columns import (
    AGAINST_KNOWN,
    FINISH,
    MEAN_DISTANCE,
    REGISTRATION,
    STEP,
    TRACKING_COLUMNS,
)
from tactile_lab.experiments.studies.planar import FELT_NOISE, METHODS
from tactile_lab.experiments.studies.plots import HAUSDORFF_LABEL, ranges

FACETED_SOLIDS = ("box-12x6x6", "triangular-prism", "hexagonal-prism", "l-block")
CURVED_SOLIDS = ("ellipsoid", "cylinder", "sphere", "mug", "bottle")
SCANNED_SOLIDS = tuple(YCB_PREFIX + name for name in YCB_NAMES)
EVERYDAY_SCANS = tuple(YCB_PREFIX + name for name in (*YCB_NAMES, *MORE_YCB_NAMES))
SPATIAL_GRASPS = 24


def scans_left_out(scans: tuple[str, ...] = SCANNED_SOLIDS) -> str:
    """Why scanned solids are left out, "" if they are available."""
    try:
        for name in scans:
            ycb_path(name.removeprefix(YCB_PREFIX))
    except ConfigurationError as error:
        return f"scanned solids are left out: {error}"
    return ""


def _solids() -> tuple[str, ...]:
    return (*FACETED_SOLIDS, *CURVED_SOLIDS, *(() if scans_left_out() else SCANNED_SOLIDS))


def _methods_on_table(grasps: int) -> list[Setting]:
    return grid(noise=[100], shape=_solids(), method=METHODS, grasps=[grasps])


def _everyday_scans_left_out() -> str:
    return scans_left_out(EVERYDAY_SCANS)


def _everyday_things(grasps: int) -> list[Setting]:
    shapes, counts = (*HOUSEHOLD, *(() if _everyday_scans_left_out() else EVERYDAY_SCANS)), {grasps, grasps * 3 // 2}
    return grid(noise=[100, FELT_NOISE], shape=shapes, method=("known-pose", "joint"), grasps=sorted(counts))


def _everyday_sections(grasps: int) -> list[Setting]:
    return [(("height", 50), *setting) for setting in _everyday_things(grasps)]


def _everyday_shapes(grasps: int) -> list[Setting]:
    scans = () if _everyday_scans_left_out() else EVERYDAY_SCANS
    left_out, counts = (everyday_shape.NOTHING, "turned", "sections"), sorted({grasps, grasps * 3 // 2})
    return grid(shape=(*HOUSEHOLD, *FURTHER_SHAPES, *scans), without=left_out, grasps=counts)


def _known_on_table(grasps: int) -> list[Setting]:
    return grid(noise=[100], shape=_solids(), grasps=[grasps], particles=[known_shape.PARTICLES])


def _limits_on_table(grasps: int) -> list[Setting]:
    methods = contact_limit.METHODS
    return grid(noise=[100], sides=contact_limit.SIDES, shape=FACETED_SOLIDS, method=methods, grasps=[grasps])


def _felt_on_table(grasps: int) -> list[Setting]:
    return grid(noise=[FELT_NOISE], shape=FACETED_SOLIDS, method=("known-pose", "joint"), grasps=[grasps])


def _felt_limits(grasps: int) -> list[Setting]:
    methods = contact_limit.METHODS
    return grid(noise=[FELT_NOISE], sides=contact_limit.SIDES, shape=FACETED_SOLIDS, method=methods, grasps=[grasps])


def _methods_in_space(grasps: int) -> list[Setting]:
    solids = ("box-12x6x6", "triangular-prism", "l-block", "ellipsoid")
    return grid(noise=[50], shape=solids, method=("known-pose", "joint", "icp", "odometry"), grasps=[grasps])


def _kind_of_solid(cell: Cell) -> str:
    kinds = {"flat faces": FACETED_SOLIDS, "curved": CURVED_SOLIDS, "scanned": SCANNED_SOLIDS}
    return next(kind for kind, names in kinds.items() if cell["shape"] in names)


def _followable(cell: Cell) -> str:
    """Separates mugs from other solids: contacts cannot determine the angle of a handle that hardly any of them
    touches.
    """
    return "mugs" if str(cell["shape"]).endswith("mug") else _kind_of_solid(cell)


METHODS_3D = Experiment(
    "methods-3d",
    "All methods on solids moved on a table at 100 % motion noise.",
    _methods_on_table,
    tracking_runs.track_on_table,
    TRACKING_COLUMNS,
    ranges("method", HAUSDORFF_LABEL, "hausdorff_mm", _kind_of_solid),
    pooled=("shape",),
    kind=_followable,
    grasps=SPATIAL_GRASPS,
    left_out=scans_left_out,
)

_TOUCHED_COLUMNS = (
    Column("Hausdorff where touched, mm", "touched_hausdorff_mm", 2, versus=True),
    Column("mean distance there, mm", "touched_mean_mm", 2, kind="median"),
    Column("within 2 sigma there", "touched_within_2_sigma", 0, kind="percent"),
)

EVERYDAY = Experiment(
    "everyday-3d",
    "Everyday things on a table, grasped at all heights: known poses against estimated ones, where they were touched.",
    _everyday_things,
    tracking_runs.track_everyday_thing,
    (
        *_TOUCHED_COLUMNS,
        Column("surface touched", "touched_share", 0, kind="percent"),
        REGISTRATION,
        STEP,
        FINISH,
    ),
    ranges("method", "Hausdorff distance where touched, mm", "touched_hausdorff_mm", lambda cell: str(cell["shape"])),
    pooled=("shape",),
    grasps=SPATIAL_GRASPS,
    left_out=_everyday_scans_left_out,
)

EVERYDAY_2D = Experiment(
    "everyday-2d",
    "Outlines of everyday things at half their height, grasped in the plane: known poses against estimated ones, where "
    "they were touched.",
    _everyday_sections,
    tracking_runs.track_everyday_section,
    EVERYDAY.columns,
    EVERYDAY.plot,
    pooled=("shape",),
    grasps=SPATIAL_GRASPS,
    left_out=_everyday_scans_left_out,
)

EVERYDAY_SHAPE = Experiment(
    "everyday-shape",
    "Shapes of everyday things on a table from grasps at all heights and known poses, with and without solids of "
    "revolution and sections along edges.",
    _everyday_shapes,
    everyday_shape.shape_at_known_poses,
    (
        *_TOUCHED_COLUMNS,
        Column("Hausdorff, mm", "hausdorff_mm", 2, kind="median"),
        Column("within 2 sigma", "within_2_sigma", 0, kind="percent"),
        FINISH,
    ),
    ranges("without", "Hausdorff distance where touched, mm", "touched_hausdorff_mm", lambda cell: str(cell["shape"])),
    pooled=("shape",),
    grasps=SPATIAL_GRASPS,
    left_out=_everyday_scans_left_out,
)

KNOWN_SHAPE = Experiment(
    "known-shape",
    "How well solids on a table can be followed if their shape is known.",
    _known_on_table,
    known_shape.follow_known_shape,
    (REGISTRATION,),
    ranges("shape", "Registration error, mm", "registration_mm", _kind_of_solid),
    pooled=("shape",),
    grasps=SPATIAL_GRASPS,
    left_out=scans_left_out,
)

SOLID_LIMIT = Experiment(
    "solid-limit",
    "The best that any estimate of a flat-faced solid can reach from these grasps, with poses known or estimated.",
    _limits_on_table,
    solid_limit.limit_of_solid,
    (AGAINST_KNOWN, MEAN_DISTANCE, REGISTRATION),
    ranges("method", HAUSDORFF_LABEL, "hausdorff_mm", lambda cell: f"sides {cell['sides']}"),
    pooled=("shape",),
    grasps=SPATIAL_GRASPS,
)

FELT_3D = Experiment(
    "felt-3d",
    "Solids moved on a table at 10 % motion noise, which odometry in the hand stays below.",
    _felt_on_table,
    tracking_runs.track_on_table,
    TRACKING_COLUMNS,
    ranges("method", HAUSDORFF_LABEL, "hausdorff_mm", lambda cell: str(cell["shape"])),
    pooled=("shape",),
    grasps=SPATIAL_GRASPS,
)

FELT_LIMIT = Experiment(
    "felt-limit",
    "The best that any estimate of a flat-faced solid can reach from these grasps at 10 % motion noise.",
    _felt_limits,
    solid_limit.limit_of_solid,
    (AGAINST_KNOWN, MEAN_DISTANCE, REGISTRATION),
    ranges("method", HAUSDORFF_LABEL, "hausdorff_mm", lambda cell: f"sides {cell['sides']}"),
    pooled=("shape",),
    grasps=SPATIAL_GRASPS,
)

METHODS_6DOF = Experiment(
    "methods-6dof",
    "Methods on solids held free in space, six degrees of freedom, at 50 % motion noise.",
    _methods_in_space,
    tracking_runs.track_in_space,
    TRACKING_COLUMNS,
    ranges("method", HAUSDORFF_LABEL, "hausdorff_mm", lambda cell: str(cell["shape"])),
    pooled=("shape",),
    grasps=SPATIAL_GRASPS,
)
