"""What tests of the hand's reach share."""

from __future__ import annotations

import pytest

from tactile_lab.experiments.reach import reachable


@pytest.fixture(autouse=True)
def few_postures(monkeypatch: pytest.MonkeyPatch) -> None:
    """Those of a third of the heights and of the turns: each costs a look at the whole hand."""
    monkeypatch.setattr(reachable, "_HEIGHTS_m", reachable._HEIGHTS_m[1::3])
    monkeypatch.setattr(reachable, "_AROUND_m", 3 * reachable._AROUND_m)
    monkeypatch.setattr(reachable, "_YAWS", 8)
