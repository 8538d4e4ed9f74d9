"""The thumb balances what the other fingers push along the grasp."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from sessions.motion.grasp_fingers import GraspFingers

DIRECTIONS = {"FF": (-1.0, 0.0, 0.0), "MF": (-0.8, 0.6, 0.0), "RF": (0.1, 1.0, 0.0), "TH": (1.0, 0.0, 0.0)}


class Fingers(GraspFingers):
    """Fingers whose paths have the directions above."""

    def __init__(self) -> None:
        paths: dict[str, Any] = {name: SimpleNamespace(direction=np.array(way)) for name, way in DIRECTIONS.items()}
        self._closing: Any = SimpleNamespace(path=paths.__getitem__)


@pytest.mark.parametrize(
    ("touching", "forces_N"),
    [
        ({"FF", "MF", "TH"}, {"FF": 2.0, "MF": 2.0, "TH": 3.6}),
        ({"MF", "TH"}, {"MF": 2.0, "TH": 2.0}),  # never less than the others
        ({"RF", "TH"}, {"RF": 2.0, "TH": 2.0}),
        ({"FF", "MF"}, {"FF": 2.0, "MF": 2.0}),
        ({"TH"}, {"TH": 2.0}),
        (set(), {}),
    ],
)
def test_the_thumb_holds_against_the_others_together(touching: set[str], forces_N: dict[str, float]) -> None:
    assert Fingers().balanced_forces_N(frozenset(touching), 2.0) == pytest.approx(forces_N)
