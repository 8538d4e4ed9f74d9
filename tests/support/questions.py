"""Questions to a session's thinker that tests ask; its own process finds them here by name."""

from __future__ import annotations

import time
from dataclasses import dataclass

from threadpoolctl import threadpool_info

from sessions.thinker import Thinker
from tactile_lab.errors import ShapeError
from tactile_lab.geometry.contacts import Grasp
from tactile_lab.slam import TactileSlam
from tactile_lab.slam_result import SlamStep


@dataclass
class Counting:
    """Stands in for a thinker: it counts what it was asked."""

    slam: TactileSlam
    asked: int = 0


def counted(thinker: Counting, after_s: float = 0.0) -> int:
    """How many such questions there have been, answered after a while."""
    time.sleep(after_s)
    thinker.asked += 1
    return thinker.asked


def stumbled(thinker: Thinker) -> None:
    """Fails for a reason nobody foresaw."""
    raise ZeroDivisionError("a bug")


def refused(thinker: Thinker) -> None:
    """Fails as the program says it may."""
    raise ShapeError("it has a hole", where="mesh", hint="Mend it")


def algebra_threads(thinker: Thinker) -> list[int]:
    """Of the libraries of linear algebra."""
    return [library["num_threads"] for library in threadpool_info() if library["user_api"] == "blas"]


class StumblingSlam(TactileSlam):
    """Fails in its second step."""

    def take(self, grasp: Grasp) -> SlamStep:
        if self.step_count == 1:
            raise ZeroDivisionError("a bug")
        return super().take(grasp)
