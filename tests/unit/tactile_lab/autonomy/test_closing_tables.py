"""Closings are in memory before the devices of a real rig are connected."""

from __future__ import annotations

from typing import Any

import pytest

from drivers.core.clock import Clock, MonotonicClock, VirtualClock
from drivers.core.configuration import validate
from drivers.core.errors import ConfigurationError
from drivers.shadow.closing.posture import HandShape
from tactile_lab.autonomy import closing_tables
from tactile_lab.autonomy.closing_tables import solve_closings
from tactile_lab.autonomy.settings import SessionSettings


@pytest.fixture
def solved(monkeypatch: pytest.MonkeyPatch) -> list[tuple[str, float]]:
    """The tables that are asked for."""
    asked: list[tuple[str, float]] = []
    monkeypatch.setattr(closing_tables, "closing", lambda name, height_m, tip: asked.append((name, height_m)))
    return asked


def solve(clock: Clock, dimension: int, **settings: Any) -> None:
    """Of a session that begins at once, unless its settings say what is felt first."""
    content = {"probing": {"top": False}, **settings}
    solve_closings(clock, validate(content, SessionSettings, where="test"), HandShape(), dimension)


def test_a_contour_needs_every_closing_at_its_height(solved: list[tuple[str, float]]) -> None:
    solve(MonotonicClock(), 2)
    assert solved == [("pinch", 0.034), ("radial", 0.034)]


def test_a_surface_needs_every_height_and_the_taps(solved: list[tuple[str, float]]) -> None:
    plan = {"closings": ["pinch"], "surface_heights_m": [0.018, 0.026]}
    solve(MonotonicClock(), 3, plan=plan, exploration={"policy": None})
    assert solved == [("pinch", 0.018), ("pinch", 0.026), ("radial", 0.022)]


def test_a_policy_may_have_the_hand_lean_where_a_surface_is_wanted(solved: list[tuple[str, float]]) -> None:
    solve(MonotonicClock(), 3, plan={"closings": ["pinch"], "surface_heights_m": [0.018]}, exploration={"policy": "kl"})
    assert solved == [("aside", 0.026), ("aside", 0.034), ("pinch", 0.018), ("radial", 0.022)]
    with pytest.raises(ConfigurationError, match=r"unknown closings \['flat'\]; choose from aside"):
        solve(MonotonicClock(), 3, exploration={"side_closings": ["flat"]})


def test_a_bounding_box_needs_the_row_of_fingers_too(solved: list[tuple[str, float]]) -> None:
    solve(MonotonicClock(), 2, probing={"enabled": True}, cycle={"touch": {"rake_height_m": 0.03}})
    assert ("pinch", 0.03) in solved


def test_what_is_felt_first_and_grasped_from_the_side_needs_the_tables_that_are_turned(
    solved: list[tuple[str, float]],
) -> None:
    solve(MonotonicClock(), 2, probing={"top": True})
    assert solved == [("pinch", 0.028), ("pinch", 0.034), ("radial", 0.022), ("radial", 0.034)]


def test_simulated_time_waits_until_a_table_is_needed(solved: list[tuple[str, float]]) -> None:
    solve(VirtualClock(), 3)
    assert solved == []
