"""How long a step of the default method takes, grasp by grasp, and how that grows with the session."""

from __future__ import annotations

import numpy as np

from tactile_lab.evaluation.benchmark import Timing, TimingTable
from tactile_lab.experiments import planar_data, spatial_data
from tactile_lab.experiments.sensing import SimulatedGrasps
from tactile_lab.slam import SlamSettings, TactileSlam

PLANAR_SHAPES = ("rectangle", "ellipse", "L")
PLANAR_GRASPS, SPATIAL_GRASPS, LONG_SESSION = 16, 24, 100
_SEED = 0


def step_table(*, long_session: int = LONG_SESSION, planar_grasps: int = PLANAR_GRASPS) -> TimingTable:
    """Median and 95 % of the steps in the plane, in space, and of the last tenth of a long session.

    Compiled loops are warm: a short session runs first.

    Args:
        long_session: grasps of the long session.
        planar_grasps: grasps of each session in the plane.
    """
    _steps_ms(planar_data.simulate("rectangle", _SEED, count=4), 2)
    planar = np.concatenate(
        [_steps_ms(planar_data.simulate(shape, _SEED, count=planar_grasps), 2) for shape in PLANAR_SHAPES]
    )
    spatial_grasps = min(SPATIAL_GRASPS, long_session)
    spatial = _steps_ms(spatial_data.simulate("box-12x6x6", _SEED, count=spatial_grasps), 3)
    long = _steps_ms(planar_data.simulate("rectangle", _SEED, count=long_session), 2)
    tail = long[-max(1, len(long) // 10) :]
    return TimingTable(
        "A step of the default method",
        (
            _line(f"plane, {planar_grasps} grasps, median", np.median(planar), len(planar), ", ".join(PLANAR_SHAPES)),
            _line(f"plane, {planar_grasps} grasps, 95 %", np.quantile(planar, 0.95), len(planar), "the same steps"),
            _line(f"space, {spatial_grasps} grasps, median", np.median(spatial), len(spatial), "box 12x6x6"),
            _line(f"space, {spatial_grasps} grasps, 95 %", np.quantile(spatial, 0.95), len(spatial), "the same steps"),
            _line(f"plane, last of {long_session} grasps, median", np.median(tail), len(tail), "rectangle"),
        ),
    )


def _steps_ms(data: SimulatedGrasps, dimension: int) -> np.ndarray[tuple[int], np.dtype[np.float64]]:
    """Computing time of each step but the first, milliseconds."""
    slam = TactileSlam(SlamSettings.model_validate({"dimension": dimension}), _SEED)
    return np.array([1e3 * slam.take(grasp).seconds for grasp in data.grasps][1:])


def _line(name: str, ms: np.floating, repeats: int, note: str) -> Timing:
    return Timing(name, float(ms), repeats, None, note)
