"""Questions to a session's service that tests ask; its own process finds them here by name."""

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
    """Stands in for a service: it counts what it was asked."""

    slam: TactileSlam
    asked: int = 0


def counted(service: Counting, after_s: float = 0.0) -> int:
    """How many such questions there have been, answered after a while."""
    time.sleep(after_s)
    service.asked += 1
    return service.asked


def stumbled(service: SlamService) -> None:
    """Fails for a reason nobody foresaw."""
    raise ZeroDivisionError("a bug")


def refused(service: SlamService) -> None:
    """Fails as the program says it may."""
    raise ShapeError("it has a hole", where="mesh", hint="Mend it")


def algebra_threads(service: SlamService) -> list[int]:
    """Of the libraries of linear algebra."""
    return [library["num_threads"] for library in threadpool_info() if library["user_api"] == "blas"]


class StumblingSlam(TactileSlam):
    """Fails in its second step."""

    def add_grasp(self, grasp: Grasp) -> SlamStep:
        if self.step_count == 1:
            raise ZeroDivisionError("a bug")
        return super().add_grasp(grasp)
