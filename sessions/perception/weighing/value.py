"""A measured number with its standard deviation."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Value:
    """A measured number and its standard deviation."""

    value: float
    sigma: float
