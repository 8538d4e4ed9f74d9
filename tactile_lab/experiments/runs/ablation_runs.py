"""Method "joint" with one mechanism left out at a time, on the same grasps.

Some mechanisms report whether they changed anything. If such a mechanism changed nothing, a run without it gives the
same result and is not repeated, except for seeds that check exactly this and measure its time.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping
from functools import lru_cache, partial
from types import MappingProxyType
from typing import Any, TypeAlias, TypeVar

import numpy as np
from gtsam import Pose3, Rot3

from tactile_lab.experiments.cells import Cell, Row, Setting, grid
from tactile_lab.experiments.data import left_in_place, planar_data, spatial_data
from tactile_lab.experiments.data.carried_off import carried_off
from tactile_lab.experiments.data.sensing import SimulatedGrasps, by_biased_fingers
from tactile_lab.experiments.data.spatial_data import SpatialGrasps
from tactile_lab.experiments.run_metrics import slam_figures
from tactile_lab.experiments.touched_metrics import touched_figures
from tactile_lab.slam.slam_settings import SlamSettings
from tactile_lab.slam.tactile_slam import TactileSlam
from tactile_lab.slam.tracking.contacts.motion import UNHELD

Overlay: TypeAlias = Mapping[str, Mapping[str, Any]]
_Result = TypeVar("_Result")

NOTHING = "nothing"
PLANE, WRONG, CARRIED, LONG, SPACE = "in the plane", "wrong contacts", "carried off", "long session", "in space"
LEFT, THINGS, BIASED = "left in place", "everyday things", "biased fingers"
_OUTLINES = ("L", "triangle", "rectangle", "ellipse", "hexagon")
SHAPES: Mapping[str, tuple[str, ...]] = MappingProxyType(
    {
        PLANE: _OUTLINES,
        WRONG: _OUTLINES,
        CARRIED: _OUTLINES,
        LEFT: _OUTLINES,
        LONG: ("L", "ellipse"),
        SPACE: ("box-12x6x6", "triangular-prism", "ellipsoid", "cylinder", "hexagonal-prism", "l-block"),
        BIASED: _OUTLINES,
        THINGS: ("cup", "cup-with-handle", "tin", "wedge", "hammer", "t-block"),
    }
)
GRASPS: Mapping[str, int] = MappingProxyType(
    {PLANE: 12, WRONG: 12, CARRIED: 12, LEFT: 12, LONG: 60, SPACE: 12, THINGS: 12, BIASED: 12}
)
CARRIED_BEFORE, FARTHEST_m = 8, 0.15
"""Grasp before which somebody puts the object elsewhere, and by how much at most per axis; it is also turned."""
CHECK_EVERY = 5
"""Seeds that are divisible by this are run again even where a mechanism changed nothing."""


def _joint(*names: str) -> Overlay:
    return {"joint": {"without": list(names)}}


def _shape(*names: str) -> Overlay:
    return {"shape": {"without": list(names)}}


WITHOUT: Mapping[str, Overlay] = MappingProxyType(
    {
        NOTHING: {},
        "backward reading": {"joint": {"backwards": False}},
        "several trajectories": {"joint": {"hypotheses": 1}},
        "valleys": _joint("valleys"),
        "stiff slips": {"motion": {"gripped": False}},
        "free space": _joint("free space"),
        "splicing": _joint("splicing"),
        "relocation": _joint("relocation"),
        "pushes": _joint("pushes"),
        "surprises": _joint("surprises"),
        "deferred association": _joint("deferred association"),
        "faces": _joint("faces"),
        "doubts": _joint("doubts"),
        "without one": _joint("without one"),
        "placing on the object": _joint("placing on the object"),
        "regular faces": _joint("regular faces"),
        "finger errors": _joint("finger errors"),
        "right angles": _shape("right angles"),
        "round sides": _shape("round sides"),
        "face extents": _shape("face extents"),
        "corners": _shape("corners"),
        "contradictions": _shape("contradictions"),
        "held-out contacts": _shape("held-out contacts"),
        "field": _shape("field"),
        "polygon": _shape("polygon"),
        "polyhedron": _shape("polyhedron"),
        "prism": _shape("prism"),
        "turned": _shape("turned"),
        "standing field": _shape("standing field"),
        "sections": _shape("sections"),
        "parts": _shape("parts"),
        "strays": _shape("strays"),
        "pose uncertainty": _joint("pose uncertainty"),
        "fixed lag": {"joint": {"window": 1000}},
    }
)
"""Settings that switch a mechanism off, by its name."""

_BRANCHES_IN_SPACE = (
    "polyhedron",
    "prism",
    "turned",
    "standing field",
    "sections",
    "parts",
    "strays",
    "held-out contacts",
)
_IN_SPACE_ONLY = (*_BRANCHES_IN_SPACE, "pose uncertainty")
_IN_PLANE_ONLY = ("corners", "without one")
_LONG_ONLY = ("fixed lag",)
_NOWHERE_ELSE = ("pushes", "surprises", "finger errors")
_FEW: Mapping[str, tuple[str, ...]] = MappingProxyType(
    {
        LONG: (NOTHING, "fixed lag"),
        CARRIED: (NOTHING, "relocation", "deferred association", "backward reading"),
        LEFT: (NOTHING, "pushes", "deferred association"),
        BIASED: (NOTHING, "finger errors"),
        THINGS: (NOTHING, "pushes", "surprises", "contradictions", "field", *_BRANCHES_IN_SPACE),
    }
)
"""What is left out in conditions that were made for some mechanisms."""
_TELLING: Mapping[str, frozenset[str]] = MappingProxyType(
    {
        name: frozenset({name, *further})
        for name, further in {
            "splicing": (),
            "relocation": ("deferred association",),
            "pushes": ("deferred association",),
            "surprises": (),
            "finger errors": (),
            "deferred association": (),
            "doubts": (),
            "without one": (),
            "placing on the object": (),
            "regular faces": (),
        }.items()
    }
)
"""Mechanisms, and the reports of changes: without a mechanism a run stays the same if none of these occurred in the
full run.
"""


_COMPARED = ("registration_mm", "hausdorff_mm", "within_2_sigma")
_SAME = 1e-3
"""Tolerances, in millimetres and as a share: optimizers with different starts differ by less."""


def settings(grasps: int) -> list[Setting]:
    """Every condition with every mechanism that applies to it; 0 grasps means each condition's own number."""
    return [
        setting
        for condition, shapes in SHAPES.items()
        for setting in grid(
            condition=[condition],
            shape=shapes,
            grasps=[min(grasps, GRASPS[condition]) or GRASPS[condition]],
            without=_left_out_in(condition),
        )
    ]


def _left_out_in(condition: str) -> list[str]:
    if condition in _FEW:
        return list(_FEW[condition])
    impossible = (*_LONG_ONLY, *_NOWHERE_ELSE, *(_IN_PLANE_ONLY if condition == SPACE else _IN_SPACE_ONLY))
    return [name for name in WITHOUT if name not in impossible]


def track_without(cell: Cell) -> dict[str, Any]:
    """The figures of a run, and whether the mechanism changed nothing in it. Cell: condition, shape, grasps,
    without.
    """
    full, changed = _full(cell["condition"], cell["shape"], cell["grasps"], cell.seed)
    name = cell["without"]
    if name == NOTHING:
        return {**full, "changed": sorted(changed)}
    idle = name in _TELLING and not changed & _TELLING[name]
    if idle and cell.seed % CHECK_EVERY:
        return {**full, "same": True, "rerun": False}
    found, _ = _tracked(_data(cell["condition"], cell["shape"], cell["grasps"], cell.seed), WITHOUT[name], cell)
    return {**found, "same": all(_nearly(found[key], full[key]) for key in _COMPARED), "rerun": True}


def _nearly(one: float | None, other: float | None) -> bool:
    return one is other is None or (one is not None and other is not None and abs(one - other) < _SAME)


@lru_cache(maxsize=2)
def _full(condition: str, shape: str, grasps: int, seed: int) -> tuple[dict[str, Any], frozenset[str]]:
    """Figures of the full method, and the mechanisms that changed something; cached, since all other runs need them."""
    cell = Cell((("condition", condition),), seed)
    return _tracked(_data(condition, shape, grasps, seed), {}, cell)


def _data(condition: str, shape: str, grasps: int, seed: int) -> SimulatedGrasps:
    if condition == SPACE:
        return spatial_data.simulate(shape, seed, count=grasps)
    if condition == LEFT:
        return left_in_place.simulate(shape, seed, count=grasps)
    if condition == THINGS:
        return left_in_place.simulate_thing(shape, seed, count=grasps)
    data = planar_data.simulate(shape, seed, count=grasps, outlier_share=0.1 if condition == WRONG else 0.0)
    if condition == BIASED:
        return by_biased_fingers(data, seed)
    return carried_off(data, CARRIED_BEFORE, _jump(seed)) if condition == CARRIED else data


def _jump(seed: int) -> Pose3:
    rng = np.random.default_rng([seed, 5021])
    x, y = rng.uniform(-FARTHEST_m, FARTHEST_m, 2)
    return Pose3(Rot3.Rz(rng.uniform(-np.pi, np.pi)), np.array([x, y, 0.0]))


def _tracked(data: SimulatedGrasps, overlay: Overlay, cell: Cell) -> tuple[dict[str, Any], frozenset[str]]:
    given = {"dimension": 3 if cell["condition"] in (SPACE, THINGS) else 2, **overlay}
    if cell["condition"] in (LEFT, THINGS):
        given["motion"] = {"unheld": UNHELD}
    slam = TactileSlam(SlamSettings.model_validate(given), cell.seed)
    steps_ms = [_processor_ms(partial(slam.add_grasp, grasp))[0] for grasp in data.grasps]
    finish_ms, result = _processor_ms(slam.finish)
    figures = {**slam_figures(data, result), "step_ms": steps_ms[1:], "finish_ms": finish_ms}
    if isinstance(data, SpatialGrasps) and cell["condition"] == THINGS:
        figures |= _where_touched(touched_figures(data, result))
    figures["failed"] = float(bool(Row(cell, figures).failure))
    return figures, slam.mechanisms_that_acted


def _where_touched(touched: Mapping[str, Any]) -> dict[str, Any]:
    """Figures of the shape near the contacts, in place of those of all of it: much of a thing is never touched."""
    return {key: touched[f"touched_{key}"] for key in ("hausdorff_mm", "within_2_sigma")}


def _processor_ms(work: Callable[[], _Result]) -> tuple[float, _Result]:
    """Processor time and outcome; elapsed time would depend on the load by other programs."""
    started = time.process_time()
    found = work()
    return round(1e3 * (time.process_time() - started), 1), found
