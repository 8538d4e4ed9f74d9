"""What a look at a rig's devices gives."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

TOLERATED_LOSS = 0.01
"""A driver bridges single lost cycles; a device that loses a larger share is not fit to work."""

LOSSY = "more than 1 % of its cycles are lost: close other programs on this computer, then check its cable"


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


def told_losses(health: Sequence[str], share: float, losses: Sequence[str] = ()) -> tuple[tuple[str, ...], list[str]]:
    """What speaks against a device, and what is only told: losses so rare that its driver bridges them.

    Args:
        health: the device's words about itself.
        share: of its cycles that were lost.
        losses: which of these words are about losses, besides those that count lost cycles.
    """
    minor = [words for words in health if share < TOLERATED_LOSS and (words in losses or words.endswith("cycles lost"))]
    wrong = tuple(words for words in health if words not in minor)
    return (*wrong, LOSSY) if share >= TOLERATED_LOSS else wrong, minor
