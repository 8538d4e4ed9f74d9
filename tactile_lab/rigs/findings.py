"""What a look at a rig's devices gives."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Finding:
    """What one device said."""

    device: str
    ok: bool
    detail: str
