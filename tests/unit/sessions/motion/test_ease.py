"""Fingers press less and less before they open."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from sessions.motion.cycle_settings import CycleSettings
from sessions.motion.grasp_fingers import GraspFingers

WAYS = {"RF": -1.0, "TH": 1.0}


class Held:
    """A motion in which the fingertips feel the same in every cycle."""

    def __init__(self, loads_N: dict[str, float]) -> None:
        self._loads_N, self.cycle_s = loads_N, 0.01

    def loads_N(self) -> dict[str, float]:
        return self._loads_N

    def bent(self, least_rad: float) -> tuple[str, ...]:
        return ()

    def shares(self, duration_s: float) -> tuple[float, ...]:
        return (0.1, 0.2)

    def set_fingers(self, closing: object, progress: dict[str, float]) -> None:
        """Ignored."""

    def tick(self) -> None:
        """Ignored."""


class Fingers(GraspFingers):
    """A finger and the thumb on straight paths, opposite each other and far apart."""

    def __init__(self, loads_N: dict[str, float]) -> None:
        paths: dict[str, Any] = {
            name: SimpleNamespace(direction=np.array([way, 0.0, 0.0]), length_m=0.1, valid=(0.0, 1.0))
            for name, way in WAYS.items()
        }
        self._motion: Any = Held(loads_N)
        self.settings, self._closing = CycleSettings(), SimpleNamespace(path=paths.__getitem__)  # type: ignore[assignment]
        self.progress = dict.fromkeys(WAYS, 0.5)

    def _nears(self, finger: str, to: float) -> bool:
        return False


def eased(loads_N: dict[str, float]) -> dict[str, float]:
    """How far each finger has moved on, of its path."""
    fingers = Fingers(loads_N)
    fingers.ease(frozenset(WAYS), 0.8)
    return {finger: progress - 0.5 for finger, progress in fingers.progress.items()}


@pytest.mark.parametrize(("hard_N", "presses"), [(1.5, True), (2.6, False)])
def test_the_thumb_presses_no_tip_harder_that_is_pressed_hard_already(hard_N: float, presses: bool) -> None:
    moved = eased({"RF": hard_N, "TH": 0.3})
    assert moved["RF"] < 0.0
    assert (moved["TH"] > 0.0) == presses


def test_both_give_way_where_both_press_too_hard() -> None:
    assert max(eased({"RF": 1.0, "TH": 1.0}).values()) < 0.0
