"""Memory and time of the estimator's process, grasp by grasp: neither may grow with the length of a session."""

from __future__ import annotations

import os
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import cast

import numpy as np

from tactile_lab.autonomy.planner import Planner
from tactile_lab.autonomy.slam_service import SlamService
from tactile_lab.autonomy.variance_planner import ExplorationSettings, KnownShape, known_shape
from tactile_lab.experiments.data import planar_data
from tactile_lab.slam.doubt.assessment import Assessment
from tactile_lab.slam.slam_settings import SlamSettings
from tactile_lab.slam.tactile_slam import TactileSlam

GRASPS, BEGINNING = 200, 20
"""Of the session, and after how many memory should stay what it is."""

SHAPE, SEED = "rectangle", 1000
_PAGE_BYTES = os.sysconf("SC_PAGE_SIZE")


@dataclass(frozen=True)
class Stretch:
    """Some grasps of a session, one after the other.

    Attributes:
        last: number of grasps at their end.
        memory_MB: resident memory of the process, its maximum after one of them.
        step_ms: median processor time of a step with all that a session asks for after it.
    """

    last: int
    memory_MB: float
    step_ms: float


def measure_memory(
    grasps: int = GRASPS, every: int = BEGINNING, waiting: Callable[[float], None] = lambda share: None
) -> tuple[Stretch, ...]:
    """Estimate a long session in the plane with the default method, as the service does in a session: with copies for
    undo, poses with faces, and the shape that the planner measures after each grasp.

    Args:
        grasps: their number.
        every: length of a stretch.
        waiting: called after each grasp with the share that is done.
    """
    slam = TactileSlam(SlamSettings(), SEED)
    service = SlamService(slam, cast(Planner, _ShapeAlone(slam)))
    figures: list[tuple[float, float]] = []
    for number, grasp in enumerate(planar_data.simulate(SHAPE, SEED, count=grasps).grasps, start=1):
        begun = time.process_time()
        service.estimate(grasp, number - 1)
        figures.append((_resident_MB(), 1e3 * (time.process_time() - begun)))
        waiting(number / grasps)
    stretches = [np.array(figures[first : first + every]) for first in range(0, grasps, every)]
    return tuple(
        Stretch(min((index + 1) * every, grasps), float(found[:, 0].max()), float(np.median(found[:, 1])))
        for index, found in enumerate(stretches)
    )


class _ShapeAlone:
    """In a planner's place: only the shape is measured."""

    def __init__(self, slam: TactileSlam) -> None:
        self._slam, self._settings = slam, ExplorationSettings()
        self._known: KnownShape | None = None

    def on_estimate(self, index: int, is_placed: bool) -> None:
        """Nothing is planned."""

    def known_shape(self) -> KnownShape | None:
        """As the planner's."""
        field, height_m = self._slam.surface, self._slam.origin_height_m
        self._known = None if field is None else known_shape(field, 2, height_m, self._settings)
        return self._known

    def assessment(self) -> Assessment:
        """As the planner's, of the shape that was measured last."""
        return self._slam.assess(None if self._known is None else self._known.extracted)


def _resident_MB() -> float:
    pages = int(Path("/proc/self/statm").read_text(encoding="ascii").split()[1])
    return pages * _PAGE_BYTES / 1e6
