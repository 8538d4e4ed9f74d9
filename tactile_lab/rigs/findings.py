"""What a look at a rig's devices gives."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field


@dataclass(frozen=True)
class Finding:
    """What one device said.

    Attributes:
        device: which.
        ok: whether it is fit to work.
        detail: found or not, what is wrong and what to do, and the figures, in words.
        figures: the same figures for programs; names carry the unit.
    """

    device: str
    ok: bool
    detail: str
    figures: Mapping[str, float | str] = field(default_factory=dict)
