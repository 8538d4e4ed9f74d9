"""Hands and boxes on wires: their processes begin as copies of the test's."""

from __future__ import annotations

import pytest

from drivers.ati.wires import can_wire, controller_wire, digital_wire
from drivers.ati.wires.wire import Turn


@pytest.fixture(autouse=True)
def children(quick_children: None) -> None:
    """All of them."""


@pytest.fixture
def patient(monkeypatch: pytest.MonkeyPatch) -> None:
    """Sensors on wires have two seconds for an answer: emulated ones answer late on a busy machine."""
    for module in (can_wire, controller_wire, digital_wire):
        monkeypatch.setattr(module, "_ANSWER_s", 2.0)
    for module in (can_wire, controller_wire):
        monkeypatch.setattr(module, "Turn", lambda patience_s: Turn(max(patience_s, 2.0)))
