"""Times of a step of the default method, grasp by grasp, and their growth during a session.

Also timed is the computation that follows a step on request: the trajectory with flat faces, which the planner and the
web page use.
"""

from __future__ import annotations

import time

import numpy as np

from drivers.core.contacts import Array, Grasp
from tactile_lab.benchmarks.components import Timing, TimingTable
from tactile_lab.experiments.data import planar_data, spatial_data
from tactile_lab.experiments.data.sensing import SimulatedGrasps
from tactile_lab.slam.slam_settings import SlamSettings
from tactile_lab.slam.tactile_slam import TactileSlam

PLANAR_SHAPES = ("rectangle", "ellipse", "L")
PLANAR_GRASPS, SPATIAL_GRASPS, LONG_SESSION = 16, 24, 100
_SEED = 0


def step_table(*, long_session: int = LONG_SESSION, planar_grasps: int = PLANAR_GRASPS) -> TimingTable:
    """Median and 95 % quantile of steps in the plane, in space, and in the last tenth of a long session.

    A short session runs first, so that loops are compiled.

    Args:
        long_session: grasps of the long session.
        planar_grasps: grasps of each session in the plane.
    """
    _session(planar_data.simulate("rectangle", _SEED, count=4), 2)
    planar_runs = [_session(planar_data.simulate(name, _SEED, count=planar_grasps), 2) for name in PLANAR_SHAPES]
    planar, planar_told = np.concatenate(planar_runs).T
    spatial_grasps = min(SPATIAL_GRASPS, long_session)
    spatial, spatial_told = _session(spatial_data.simulate("box-12x6x6", _SEED, count=spatial_grasps), 3).T
    long, _ = _session(planar_data.simulate("rectangle", _SEED, count=long_session), 2).T
    tail = long[-max(1, len(long) // 10) :]
    shapes = ", ".join(PLANAR_SHAPES)
    return TimingTable(
        "A step of the default method",
        (
            _line(f"plane, {planar_grasps} grasps, median", np.median(planar), len(planar), shapes),
            _line(f"plane, {planar_grasps} grasps, 95 %", np.quantile(planar, 0.95), len(planar), "the same steps"),
            _line("plane, poses with faces between grasps, median", np.median(planar_told), len(planar), shapes),
            _line(f"space, {spatial_grasps} grasps, median", np.median(spatial), len(spatial), "box 12x6x6"),
            _line(f"space, {spatial_grasps} grasps, 95 %", np.quantile(spatial, 0.95), len(spatial), "the same steps"),
            _line("space, poses with faces between grasps, median", np.median(spatial_told), len(spatial), "the same"),
            _line(f"plane, last of {long_session} grasps, median", np.median(tail), len(tail), "rectangle"),
        ),
    )


def _session(data: SimulatedGrasps, dimension: int) -> Array:
    """Times of each step but the first, and of the trajectory after it; ms, shape (n, 2)."""
    slam = TactileSlam(SlamSettings.model_validate({"dimension": dimension}), _SEED)
    return np.array([_measure_step(slam, grasp) for grasp in data.grasps][1:])


def _measure_step(slam: TactileSlam, grasp: Grasp) -> tuple[float, float]:
    step_ms, begun = 1e3 * slam.add_grasp(grasp).seconds, time.perf_counter()
    assert slam.trajectory
    return step_ms, 1e3 * (time.perf_counter() - begun)


def _line(name: str, ms: np.floating, repeats: int, note: str) -> Timing:
    return Timing(name, float(ms), repeats, None, note)
