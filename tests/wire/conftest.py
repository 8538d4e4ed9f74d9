"""Hands and boxes on wires: their processes begin as copies of the test's."""

from __future__ import annotations

import pytest


@pytest.fixture(autouse=True)
def children(quick_children: None) -> None:
    """All of them."""
