"""Times of the costly parts of a step, compared with the obvious alternative and with the thesis's own figure.

All numbers of a table are measured in one run on one machine; only the thesis's are quoted.
"""

from __future__ import annotations

import tracemalloc
from collections.abc import Callable
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from drivers.core.clock import Clock, MonotonicClock
from drivers.core.contacts import Array
from drivers.core.errors import ConfigurationError
from tactile_lab.slam.shape.fields.field_grid import Field, FieldGrid
from tactile_lab.slam.shape.fields.gpis import Gpis
from tactile_lab.slam.shape.fields.settings import GpisSettings
from tactile_lab.slam.tracking.contacts.contact_set import ContactSet
from tactile_lab.slam.tracking.filter.measurement import (
    CalibratedMeasurement,
    CalibratedSettings,
    GateSettings,
    Known,
    Measurement,
    ThesisMeasurement,
)

PARTICLES = 20_000
MAP_CONTACTS = 100
GRASP_CONTACTS = 5
THESIS_WEIGHTING_ms = 6000.0
"""The thesis gives 6 seconds on average for 20 000 particles (section 3.4)."""
SHAPE_SIZES = ((2, 80), (2, 320), (3, 80), (3, 160))
"""Dimensions and numbers of contacts."""
QUERIES = 10_000
LARGE_MAP, FIELD_NODES, VARIANCE_STEP = 500, 64, 3
"""Contacts of the largest map, nodes along each axis of its field, nodes from one variance to the next."""
SEMI_AXES_m = (0.050, 0.030)
_POINT_SIGMA_m, _NORMAL_SIGMA_rad = 0.001, 0.0873


@dataclass(frozen=True)
class Timing:
    """One line of a benchmark.

    Attributes:
        name: what was timed.
        ms: median duration, milliseconds.
        repeats: number of runs; 0 for a quoted figure.
        peak_MB: largest additional memory, megabytes; None if not measured.
        note: what was computed, with sizes.
    """

    name: str
    ms: float
    repeats: int
    peak_MB: float | None
    note: str


@dataclass(frozen=True)
class TimingTable:
    """A benchmark: its title, its lines, and the line that the ratios refer to."""

    title: str
    timings: tuple[Timing, ...]
    reference: int = 0

    def rows(self) -> list[tuple[str, str, str, str, str]]:
        """Name, milliseconds, ratio to the reference line, peak memory, note; ready for printing."""
        base = self.timings[self.reference].ms
        return [
            (
                timing.name,
                f"{timing.ms:.4g}",
                f"{timing.ms / base:.3g}",
                "" if timing.peak_MB is None else f"{timing.peak_MB:.1f}",
                timing.note,
            )
            for timing in self.timings
        ]

    def as_json(self) -> dict[str, Any]:
        """Title and lines as plain data."""
        return {"title": self.title, "timings": [asdict(timing) for timing in self.timings]}


def run_benchmarks(clock: Clock | None = None) -> list[TimingTable]:
    """Run all benchmarks. Raises ConfigurationError, see :func:`weighting_table`."""
    return [weighting_table(clock), shape_table(clock)]


@dataclass(frozen=True)
class WeightingCase:
    """Particles, a grasp and a map, the same for all methods compared."""

    rows: Array
    grasp: ContactSet
    previous: ContactSet
    contacts: ContactSet
    field: Gpis


def weighting_table(clock: Clock | None = None, *, particles: int = PARTICLES, repeats: int = 5) -> TimingTable:
    """Time the weighting of particles with five contacts against a map of a hundred.

    Raises:
        ConfigurationError: scikit-learn, which is only needed here, is not installed.
    """
    watch = _Stopwatch(clock or MonotonicClock(), repeats)
    case = weighting_case(particles)
    grid = FieldGrid.around(case.field)
    calibrated = CalibratedMeasurement(CalibratedSettings())
    thesis = ThesisMeasurement(GateSettings(), label_distance_m=0.005)
    points = _particle_points(case)
    regressor = _regressor(case)
    sizes = f"{particles} particles, {GRASP_CONTACTS} contacts, map of {MAP_CONTACTS} contacts"
    return TimingTable(
        f"Weighting of {sizes}",
        (
            watch("ours, from the grid", lambda: _weigh(calibrated, case, grid), "distance, normal and variance"),
            watch("tabulating the grid", lambda: FieldGrid.around(case.field), _grid_note(grid)),
            watch(
                "ours, thesis's likelihood", lambda: _weigh(thesis, case, grid), "(3.9) behind the four-contact gate"
            ),
            watch("ours, without the grid", lambda: _weigh(calibrated, case, case.field), "the same from all contacts"),
            watch("scikit-learn", lambda: regressor(points), "GaussianProcessRegressor.predict, value alone"),
            Timing("thesis", THESIS_WEIGHTING_ms, 0, None, "as printed: MATLAB on a desktop PC"),
        ),
    )


def _grid_note(grid: FieldGrid) -> str:
    nodes = " x ".join(map(str, grid.values_m.shape))
    return f"once a grasp, {nodes} nodes of {1e3 * grid.spacing_m:g} mm, {grid.bytes_kept / 1e6:.2f} MB kept"


def weighting_case(particles: int = PARTICLES) -> WeightingCase:
    """An ellipse with a hundred contacts, and particles spread around the true pose by the motion noise."""
    rng = np.random.default_rng(0)
    contacts = ellipse_contacts(MAP_CONTACTS, rng)
    grasp, previous = ellipse_contacts(GRASP_CONTACTS, rng), ellipse_contacts(GRASP_CONTACTS, rng)
    rows = rng.normal(size=(particles, 3)) * [0.010, 0.010, np.radians(20.0)]
    settings = GpisSettings(kernel="squared_exponential", observations="normals")
    field = Gpis.fit(contacts.points_m, contacts.normals, contacts.point_sigma_m, contacts.normal_sigma_rad, settings)
    return WeightingCase(rows, grasp, previous, contacts, field)


def ellipse_contacts(count: int, rng: np.random.Generator) -> ContactSet:
    """Contacts on an ellipse of 10 x 6 cm with the thesis's noise, object frame."""
    angle = 2 * np.pi * (np.arange(count) + rng.random(count)) / count
    semi_axes = np.array(SEMI_AXES_m)
    circle = np.column_stack([np.cos(angle), np.sin(angle)])
    normals = circle / semi_axes
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    points = circle * semi_axes + _POINT_SIGMA_m * rng.normal(size=(count, 2))
    return ContactSet(points, normals, np.full(count, _POINT_SIGMA_m), np.full(count, _NORMAL_SIGMA_rad))


def _weigh(measurement: Measurement, case: WeightingCase, field: Field) -> Array:
    return measurement.log_likelihood(case.rows, case.grasp, Known(field, case.previous))


def _particle_points(case: WeightingCase) -> Array:
    """The grasp's contacts in every particle's object frame, shape (particles x contacts, 2)."""
    return np.concatenate([case.grasp.in_object_frame(row).points_m for row in case.rows])


def _regressor(case: WeightingCase) -> Callable[[Array], Array]:
    """scikit-learn's regression of the thesis's labels: 0 on the surface, -1 inside, +1 outside."""
    try:
        from sklearn.gaussian_process import GaussianProcessRegressor
        from sklearn.gaussian_process.kernels import RBF
    except ImportError as error:
        raise ConfigurationError(
            "scikit-learn is not installed", where="benchmark", hint="pip install 'tactile-lab[dev]'"
        ) from error
    points, labels = _label(case.contacts)
    model = GaussianProcessRegressor(RBF(0.040), alpha=1e-2, optimizer=None).fit(points, labels)
    return lambda queries: np.asarray(model.predict(queries))


def _label(contacts: ContactSet, distance_m: float = 0.010) -> tuple[Array, Array]:
    steps = distance_m * contacts.normals
    points = np.concatenate([contacts.points_m, contacts.points_m - steps, contacts.points_m + steps])
    return points, np.repeat([0.0, -1.0, 1.0], len(contacts))


def shape_table(clock: Clock | None = None, *, repeats: int = 5) -> TimingTable:
    """Time fitting and querying the shape model as it grows, in the plane and in space, with its memory."""
    watch = _Stopwatch(clock or MonotonicClock(), repeats)
    timings = [line for size in SHAPE_SIZES for line in _shape_timings(watch, *size)]
    timings += _large_timings(watch, _Stopwatch(clock or MonotonicClock(), 1))
    return TimingTable("Shape model", tuple(timings))


def _shape_timings(watch: _Stopwatch, dimension: int, count: int) -> tuple[Timing, Timing]:
    contacts = ball_contacts(count, dimension)
    field = _fit(contacts)
    queries = np.random.default_rng(1).uniform(-0.06, 0.06, (QUERIES, dimension))
    size = f"{dimension}-D, {count} contacts"
    return (
        watch(f"fit, {size}", lambda: _fit(contacts), f"{_size(field)} observations"),
        watch(
            f"query, {size}",
            lambda: field.predict(queries, gradient=True, variance=True),
            f"{QUERIES} points with gradient and variance",
        ),
    )


def _large_timings(watch: _Stopwatch, once: _Stopwatch) -> list[Timing]:
    """Times with a map of very many contacts in space: adding a grasp, and evaluating the whole field around it."""
    contacts = ball_contacts(LARGE_MAP, 3)
    is_last = np.arange(LARGE_MAP) >= LARGE_MAP - GRASP_CONTACTS
    field, grasp = _fit(contacts.select(~is_last)), contacts.select(is_last)
    corner, spacing_m = np.full(3, 0.06), 0.12 / (FIELD_NODES - 1)
    size = f"3-D, {LARGE_MAP} contacts"

    def extend() -> Gpis:
        return field.extend(grasp.points_m, grasp.normals, grasp.point_sigma_m, grasp.normal_sigma_rad)

    def tabulate() -> FieldGrid:
        return FieldGrid.tabulate(field, -corner, corner, spacing_m, variance=True, variance_step=VARIANCE_STEP)

    return [
        watch(f"update, {size}", extend, f"{GRASP_CONTACTS} contacts appended to {_size(field)} observations"),
        once(
            f"field, {size}",
            tabulate,
            f"{FIELD_NODES}^3 nodes, variance on a grid {VARIANCE_STEP} times coarser",
        ),
    ]


def _fit(contacts: ContactSet) -> Gpis:
    return Gpis.fit(contacts.points_m, contacts.normals, contacts.point_sigma_m, contacts.normal_sigma_rad)


def _size(field: Gpis) -> int:
    return len(field.observations.values_m) + field.observations.gradients.size


def ball_contacts(count: int, dimension: int) -> ContactSet:
    """Contacts all over a sphere (disc) of 4 cm radius, object frame."""
    normals = np.random.default_rng(2).normal(size=(count, dimension))
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    sigma = np.full(count, _POINT_SIGMA_m)
    return ContactSet(0.040 * normals, normals, sigma, np.full(count, _NORMAL_SIGMA_rad))


class _Stopwatch:
    """Measures the median duration of repeated runs, and the memory of one more run."""

    def __init__(self, clock: Clock, repeats: int) -> None:
        self._clock, self._repeats = clock, repeats

    def __call__(self, name: str, work: Callable[[], object], note: str) -> Timing:
        ms = median_ms(work, self._clock.now_ns, self._repeats)
        return Timing(name, ms, self._repeats, _peak_MB(work), note)


def median_ms(work: Callable[[], object], now_ns: Callable[[], int], repeats: int) -> float:
    """Median duration of repeated runs, milliseconds. One more run before them, which may compile, is not counted.

    Args:
        work: what is timed.
        now_ns: the clock, nanoseconds: of elapsed or of processor time.
        repeats: how often.
    """
    work()
    durations_ns = []
    for _ in range(repeats):
        begun_ns = now_ns()
        work()
        durations_ns.append(now_ns() - begun_ns)
    return 1e-6 * float(np.median(durations_ns))


def _peak_MB(work: Callable[[], object]) -> float:
    tracemalloc.start()
    try:
        work()
        return tracemalloc.get_traced_memory()[1] / 1e6
    finally:
        tracemalloc.stop()
