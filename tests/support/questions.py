"""Requests of tests to a session's estimator service, whose process imports them from here by name."""

from __future__ import annotations

import time
from dataclasses import dataclass

from threadpoolctl import threadpool_info

from drivers.core.contacts import Grasp
from drivers.core.errors import ShapeError
from tactile_lab.autonomy.slam_service import SlamService
from tactile_lab.slam.result import SlamStep
from tactile_lab.slam.tactile_slam import TactileSlam


@dataclass
class Counting:
    """Replaces a service: it counts its requests."""

    slam: TactileSlam
    asked: int = 0


def counted(service: Counting, after_s: float = 0.0) -> int:
    """The number of such requests so far, answered after a while."""
    time.sleep(after_s)
    service.asked += 1
    return service.asked


def stumbled(service: SlamService) -> None:
    """Fails for an unforeseen reason."""
    raise ZeroDivisionError("a bug")


def refused(service: SlamService) -> None:
    """Fails with one of the program's own errors."""
    raise ShapeError("it has a hole", where="mesh", hint="Mend it")


def algebra_threads(service: SlamService) -> list[int]:
    """Numbers of threads of the linear algebra libraries."""
    return [library["num_threads"] for library in threadpool_info() if library["user_api"] == "blas"]


class StumblingSlam(TactileSlam):
    """An estimator that fails in its second step."""

    def add_grasp(self, grasp: Grasp) -> SlamStep:
        if self.step_count == 1:
            raise ZeroDivisionError("a bug")
        return super().add_grasp(grasp)
