"""All experiments by name: what is varied, what one run does, and how the outcome is shown.

Seeds: those reported are 1000 to 1029, those for development 0 to 99; nothing is ever tuned on the former.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import TypeAlias

from tactile_lab.errors import ConfigurationError
from tactile_lab.experiments import (
    calibration_runs,
    camera_runs,
    crash_runs,
    exploration_runs,
    graph_runs,
    hand_exploration,
    shape_runs,
    tracking_runs,
)
from tactile_lab.experiments.cells import Cell, Row, Setting, Value, Work, grid, planned_cells
from tactile_lab.experiments.graph_stress import stock_solvers
from tactile_lab.experiments.plots import CurvePanel, RangePanel, curve_of, curves_svg, ranges_svg
from tactile_lab.experiments.solids import YCB_NAMES, YCB_PREFIX, ycb_path
from tactile_lab.experiments.summary import Column, grouped

REPORTED_SEEDS = tuple(range(1000, 1030))
DEVELOPMENT_SEEDS = range(100)

METHODS = ("known-pose", "joint", "particle", "icp", "thesis-pf", "thesis-pf-graph", "odometry")
PLANAR_SHAPES = ("rectangle", "triangle", "ellipse", "L", "hexagon", "trapezoid", "pentagon", "stadium")
FACETED_SOLIDS = ("box-12x6x6", "triangular-prism", "hexagonal-prism", "l-block")
CURVED_SOLIDS = ("ellipsoid", "cylinder", "sphere", "mug", "bottle")
SCANNED_SOLIDS = tuple(YCB_PREFIX + name for name in YCB_NAMES)
THREE_SHAPES = ("rectangle", "ellipse", "hexagon")
"""The thesis does not name its three planar objects; these stand for them."""

PLANAR_GRASPS, SPATIAL_GRASPS = 16, 24
UNITS = {"noise": "%", "outliers": "%"}
LOGARITHMIC = {"particles"}

HAUSDORFF = Column("Hausdorff, mm", "hausdorff_mm")
MEAN_DISTANCE = Column("mean distance, mm", "mean_mm", kind="median")
REGISTRATION = Column("registration, mm", "registration_mm")
STEP = Column("step, ms: median / p95", "step_ms", 0, kind="pooled")
FINISH = Column("end, ms", "finish_ms", 0, kind="median")
COVERED = Column("within 2 sigma", "within_2_sigma", 0, kind="percent")
AGAINST_KNOWN = Column("Hausdorff, mm", "hausdorff_mm", 2, versus=True)
TRACKING_COLUMNS = (AGAINST_KNOWN, MEAN_DISTANCE, REGISTRATION, COVERED, STEP, FINISH)
SHAPE_COLUMNS = (HAUSDORFF, Column("mean Hausdorff, mm", "hausdorff_mm", 1, kind="mean"), MEAN_DISTANCE, COVERED)

EXPLORATION_COLUMNS = (
    Column("actions by B", "actions_B", 1, kind="estimate"),
    Column("actions by A", "actions_A", 1, kind="estimate"),
    Column("by B: median / p90 / max", "actions_B", 0),
    Column("by A: median / p90 / max", "actions_A", 0),
    Column("decision, ms: median / p95", "decision_ms", 0, kind="pooled"),
    Column("correlation of promised and realised share", "promises", 2, kind="correlation"),
)
HAND_COLUMNS = (
    Column("actions by B: median / p90 / max", "actions_B", 0),
    Column("by A", "actions_A", 0),
    Column("explored by B at the end", "share_B", 0, kind="percent"),
    Column("simulated minutes", "minutes", 1),
    HAUSDORFF,
    REGISTRATION,
    Column("correlation of promised and realised share", "promises", 2, kind="correlation"),
)
_ACTIONS_LABEL = "actions until 90 % of the contour is explored (definition B)"
_HAUSDORFF_LABEL = "Hausdorff at best fit, mm"

Plot: TypeAlias = Callable[[str, Sequence[Row]], str]


@dataclass(frozen=True)
class Experiment:
    """One experiment.

    Attributes:
        name: on the command line.
        sentence: what it shows.
        settings: what is varied; grasps is the number of grasps asked for.
        work: runs one cell.
        columns: figures of the tables.
        plot: draws the outcome as an SVG file, from a title and all rows.
        pooled: settings over which a second table takes all runs together.
        grasps: number of grasps of a run; None where there are none.
        left_out: what can not be run on this machine and why, "" if nothing.
    """

    name: str
    sentence: str
    settings: Callable[[int], list[Setting]]
    work: Work
    columns: tuple[Column, ...]
    plot: Plot
    pooled: tuple[str, ...] = ()
    grasps: int | None = None
    left_out: Callable[[], str] = str

    def cells(
        self,
        seeds: Sequence[int] = REPORTED_SEEDS,
        only: Mapping[str, Sequence[str]] | None = None,
        grasps: int | None = None,
    ) -> list[Cell]:
        """All runs.

        Args:
            seeds: of every setting.
            only: values, as texts, that some of the settings are limited to.
            grasps: number of grasps instead of the experiment's own.

        Raises:
            ConfigurationError: no such setting, or nothing is left.
        """
        settings = self.settings(grasps or self.grasps or 0)
        for name, values in (only or {}).items():
            settings = _limited(settings, name, values)
        return planned_cells(settings, seeds)


def experiment(name: str) -> Experiment:
    """The experiment called ``name``. Raises ConfigurationError if there is none."""
    if name not in EXPERIMENTS:
        hint = f"Experiments are {', '.join(EXPERIMENTS)}"
        raise ConfigurationError(f"no experiment called {name!r}", where="experiment", hint=hint)
    return EXPERIMENTS[name]


def _limited(settings: list[Setting], name: str, values: Sequence[str]) -> list[Setting]:
    if not any(name in dict(setting) for setting in settings):
        hint = f"Settings are {', '.join(dict(settings[0]))}"
        raise ConfigurationError(f"nothing called {name!r} is varied", where="--only", hint=hint)
    known = list(dict.fromkeys(str(dict(setting)[name]) for setting in settings))
    if unknown := [value for value in values if value not in known]:
        hint = f"There are {', '.join(known)}"
        raise ConfigurationError(f"no {name} {', '.join(map(repr, unknown))}", where="--only", hint=hint)
    return [setting for setting in settings if str(dict(setting)[name]) in values]


def _methods_in_plane(grasps: int) -> list[Setting]:
    return [
        setting
        for noise, outliers in ((100, 0), (50, 0), (100, 10))
        for setting in grid(noise=[noise], outliers=[outliers], shape=PLANAR_SHAPES, method=METHODS, grasps=[grasps])
    ]


def _scans_left_out() -> str:
    try:
        for name in YCB_NAMES:
            ycb_path(name)
    except ConfigurationError as error:
        return f"scanned solids are left out: {error}"
    return ""


def _methods_on_table(grasps: int) -> list[Setting]:
    scanned = () if _scans_left_out() else SCANNED_SOLIDS
    solids = (*FACETED_SOLIDS, *CURVED_SOLIDS, *scanned)
    return grid(noise=[100], shape=solids, method=METHODS, grasps=[grasps])


def _methods_in_space(grasps: int) -> list[Setting]:
    solids = ("box-12x6x6", "triangular-prism", "l-block", "ellipsoid")
    return grid(noise=[50], shape=solids, method=("known-pose", "joint", "icp", "odometry"), grasps=[grasps])


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


def _by(rows: Sequence[Row], name: str) -> dict[Value, list[Row]]:
    """Rows by a value of their setting, in order of appearance."""
    parts: dict[Value, list[Row]] = {}
    for row in rows:
        parts.setdefault(row.cell[name], []).append(row)
    return parts


def _curves(x: str, x_label: str, panel: str, line: str, *, columns: int = 2, key: str = "hausdorff_mm") -> Plot:
    """Error against the setting ``x``: a chart for each value of ``panel``, a curve for each of ``line``."""

    def plot(title: str, rows: Sequence[Row]) -> str:
        panels = []
        for name, part in _by(rows, panel).items():
            series = [
                curve_of(str(value), grouped(lines, over=_others(lines, x)), x, key)
                for value, lines in _by(part, line).items()
            ]
            panels.append(CurvePanel(_titled(panel, name), x_label, _HAUSDORFF_LABEL, series, x in LOGARITHMIC))
        return curves_svg(title, panels, columns)

    return plot


def _ranges(line: str, label: str, key: str, panel_of: Callable[[Cell], str], *, columns: int = 2) -> Plot:
    """Spreads: a chart for each panel, a line for each value of the setting ``line``."""

    def plot(title: str, rows: Sequence[Row]) -> str:
        parts: dict[str, list[Row]] = {}
        for row in rows:
            parts.setdefault(panel_of(row.cell), []).append(row)
        panels = []
        for name, part in parts.items():
            found = [(str(value), lines) for value, lines in _by(part, line).items()]
            groups = [(value, grouped(lines, over=_others(lines, line))[0]) for value, lines in found]
            panels.append(RangePanel(name, label, key, groups))
        return ranges_svg(title, panels, columns)

    return plot


def _others(rows: Sequence[Row], kept: str) -> list[str]:
    return [name for name, _ in rows[0].cell.setting if name != kept]


def _titled(name: str, value: Value) -> str:
    if name == "grasps":
        return f"{value} grasps"
    return f"{name} {value} {UNITS[name]}" if name in UNITS else str(value)


def _condition(cell: Cell) -> str:
    outliers = f", {cell['outliers']} % outliers" if cell["outliers"] else ""
    return f"{cell['noise']} % motion noise{outliers}"


def _hand_condition(cell: Cell) -> str:
    return f"{cell['object']}, {cell['dimension']}-D"


def _kind_of_solid(cell: Cell) -> str:
    kinds = {"flat faces": FACETED_SOLIDS, "curved": CURVED_SOLIDS, "scanned": SCANNED_SOLIDS}
    return next(kind for kind, names in kinds.items() if cell["shape"] in names)


EXPERIMENTS: Mapping[str, Experiment] = {
    study.name: study
    for study in (
        Experiment(
            "methods-2d",
            "All methods on all planar shapes, at 100 % and 50 % motion noise and with 10 % outliers.",
            _methods_in_plane,
            tracking_runs.track_in_plane,
            TRACKING_COLUMNS,
            _ranges("method", _HAUSDORFF_LABEL, "hausdorff_mm", _condition),
            pooled=("shape",),
            grasps=PLANAR_GRASPS,
        ),
        Experiment(
            "methods-3d",
            "All methods on solids moved on a table at 100 % motion noise.",
            _methods_on_table,
            tracking_runs.track_on_table,
            TRACKING_COLUMNS,
            _ranges("method", _HAUSDORFF_LABEL, "hausdorff_mm", _kind_of_solid),
            pooled=("shape",),
            grasps=SPATIAL_GRASPS,
            left_out=_scans_left_out,
        ),
        Experiment(
            "methods-6dof",
            "Methods on solids held free in space, six degrees of freedom, at 50 % motion noise.",
            _methods_in_space,
            tracking_runs.track_in_space,
            TRACKING_COLUMNS,
            _ranges("method", _HAUSDORFF_LABEL, "hausdorff_mm", lambda cell: str(cell["shape"])),
            pooled=("shape",),
            grasps=SPATIAL_GRASPS,
        ),
        Experiment(
            "random-contacts",
            "Shape models on random contacts of planar shapes whose pose is known.",
            lambda grasps: grid(
                shape=("rectangle", "square", "ellipse", "hexagon", "L"),
                model=list(shape_runs.SHAPE_MODELS),
                contacts=[20, 40, 80],
            ),
            shape_runs.contour_of_random_contacts,
            SHAPE_COLUMNS,
            _curves("contacts", "contacts", "shape", "model"),
        ),
        Experiment(
            "figure-2.7",
            "Thesis, figure 2.7: two shapes and two kernels, error against the number of contacts.",
            lambda grasps: grid(
                shape=("rectangle", "ellipse"),
                model=list(shape_runs.SHAPE_MODELS),
                contacts=[5, 10, 15, 20, 30, 40, 60, 80],
            ),
            shape_runs.contour_of_random_contacts,
            SHAPE_COLUMNS,
            _curves("contacts", "contacts", "shape", "model"),
        ),
        Experiment(
            "figure-2.12",
            "Thesis, figure 2.12: the box 12x6x6 cm, error against the number of contacts.",
            lambda grasps: grid(
                shape=["box-12x6x6"],
                model=["SE, inside and outside points", "Matérn, normals", "chosen by evidence"],
                contacts=[10, 20, 30, 40, 60, 80, 120],
            ),
            shape_runs.mesh_of_random_contacts,
            SHAPE_COLUMNS,
            _curves("contacts", "contacts", "shape", "model", columns=1),
        ),
        Experiment(
            "figure-3.12",
            "Thesis, figure 3.12: error against the motion noise, three planar shapes.",
            _noise_levels,
            tracking_runs.track_in_plane,
            TRACKING_COLUMNS,
            _curves("noise", "motion noise, %", "shape", "method"),
            pooled=("shape",),
            grasps=PLANAR_GRASPS,
        ),
        Experiment(
            "figure-3.14",
            "Thesis, figure 3.14: error and success of the particle filters against the number of particles.",
            _particle_numbers,
            tracking_runs.track_in_plane,
            (HAUSDORFF, REGISTRATION, Column("grasps not placed", "untracked", 0, kind="spread"), STEP),
            _curves("particles", "particles", "noise", "method"),
            pooled=("shape",),
            grasps=PLANAR_GRASPS,
        ),
        Experiment(
            "figure-3.15",
            "Thesis, figure 3.15: error of drifting poses against the number of constraints in the pose graph.",
            lambda grasps: grid(
                shape=("rectangle", "hexagon", "L"), constraints=[0, 1, 2, 4, 8, 16, 32], grasps=[grasps]
            ),
            tracking_runs.correct_by_loops,
            (HAUSDORFF, REGISTRATION, MEAN_DISTANCE, Column("constraints there were", "loops", 0, kind="spread")),
            _curves("constraints", "constraints", "grasps", "shape", columns=1),
            pooled=("shape",),
            grasps=PLANAR_GRASPS,
        ),
        Experiment(
            "figure-3.16",
            "Thesis, figure 3.16: particle filters with and without the pose graph, three planar shapes.",
            _graph_or_not,
            tracking_runs.track_in_plane,
            TRACKING_COLUMNS,
            _ranges("method", _HAUSDORFF_LABEL, "hausdorff_mm", lambda cell: f"{cell['shape']}, {_condition(cell)}"),
            pooled=("shape",),
            grasps=PLANAR_GRASPS,
        ),
        Experiment(
            "table-4.2",
            "Thesis, table 4.2: actions until 90 % of a fixed rectangle's contour is explored, policies and bounds.",
            exploration_runs.fixed_settings,
            exploration_runs.explore_fixed,
            EXPLORATION_COLUMNS,
            _ranges("policy", _ACTIONS_LABEL, "actions_B", lambda cell: f"{cell['candidates']} candidates", columns=1),
            grasps=exploration_runs.MOST_GRASPS,
        ),
        Experiment(
            "table-4.3",
            "Thesis, table 4.3: the same of a rectangle that every grasp pushes aside, at full motion noise.",
            exploration_runs.moving_settings,
            exploration_runs.explore_moving,
            (*EXPLORATION_COLUMNS, REGISTRATION),
            _ranges("policy", _ACTIONS_LABEL, "actions_B", lambda cell: f"followed by {cell['tracking']}", columns=1),
            grasps=exploration_runs.MOST_GRASPS,
        ),
        Experiment(
            "exploration-hand",
            "The simulated hand's own candidates, 72 and more: actions until 90 % of an object is explored, by policy.",
            hand_exploration.settings,
            hand_exploration.explore_by_hand,
            HAND_COLUMNS,
            _ranges("policy", "grasps until 90 % is explored (definition B)", "actions_B", _hand_condition, columns=2),
            pooled=("object",),
            grasps=hand_exploration.GRASPS,
        ),
        Experiment(
            "camera-truth",
            "The marker camera at 640 x 480 under ten conditions: error of the true pose, flips taken for valid.",
            lambda grasps: grid(condition=list(camera_runs.CONDITIONS)),
            camera_runs.see_object,
            (
                Column("position, mm: median / p95", "position_mm", 2, kind="pooled"),
                Column("angle, °: median / p95", "angle_deg", 3, kind="pooled"),
                Column("frames", "frames", 0, kind="sum"),
                Column("refused", "refused", 0, kind="sum"),
                Column("flips", "flips", 0, kind="sum"),
                Column("free: valid", "free_valid", 0, kind="sum"),
                Column("free: flips among them", "free_flips", 0, kind="sum"),
            ),
            _ranges("condition", "largest position error, mm", "worst_mm", lambda cell: "640 x 480 pixels", columns=1),
            pooled=("condition",),
        ),
        Experiment(
            "graph-stress",
            "Pose graphs of 50 grasps with 20 % wrong loops: gtsam's solvers, ours, and one told which are right.",
            lambda grasps: grid(solver=[*stock_solvers(), graph_runs.OUR_SOLVER]),
            graph_runs.solve_stressed_graph,
            (
                Column("position, mm", "error_mm"),
                Column("rotation, °", "error_deg"),
                Column("time, ms", "ms", 0),
                Column("wrong loops", "wrong_loops", 0, kind="sum"),
                Column("of them accepted", "wrong_accepted", 0, kind="sum"),
                Column("right ones refused", "right_refused", 0, kind="sum"),
            ),
            _ranges("solver", "position error, mm", "error_mm", lambda cell: "50 grasps, 20 % wrong loops", columns=1),
        ),
        Experiment(
            "calibrate-forearm",
            "Forearm to world by touch and by a board on the palm: joint bias 0.6°, contacts 1 mm, corners 0.15 px.",
            lambda grasps: (
                grid(method=[calibration_runs.TOUCH], poses=[20, 40])
                + grid(method=[calibration_runs.MARKER], poses=[10, 20])
            ),
            calibration_runs.calibrate_forearm,
            (
                Column("position, mm: median / p95", "errors_mm", 2, kind="pooled"),
                Column("rotation, °: median / p95", "errors_deg", 2, kind="pooled"),
                Column("inside the 95 % region", "inside", 1, kind="percent"),
                Column("noise found, of that stated", "noise", 2, kind="median"),
            ),
            _ranges("method", "position error, mm", "error_mm", lambda cell: f"{cell['poses']} poses"),
        ),
        Experiment(
            "crash-recovery",
            "Accidents of a recording at full load, at a random instant: what is lost of it.",
            lambda grasps: grid(fault=crash_runs.faults_here()),
            crash_runs.crash_and_recover,
            (
                Column("messages recovered", "recovered", 0),
                Column("messages lost", "lost", 0),
                Column("lost before the end, ms", "lost_ms", 0),
                Column("of the hand, ms", "hand_ms", 0),
                Column("of force sensors, ms", "ft_ms", 0),
                Column("of pictures, ms", "camera_ms", 0),
                Column("longest write, ms", "write_ms", 1),
                Column("late messages", "late", 0, kind="median"),
            ),
            _ranges("fault", "lost at the end, ms", "lost_ms", lambda cell: "full load", columns=1),
            left_out=crash_runs.needs_root,
        ),
    )
}
"""Every experiment by its name."""
