"""Findings of a rig check."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

TOLERATED_LOSS = 0.01
"""A driver bridges single lost cycles; a device that loses a larger share is not ready."""

LOSSY = "more than 1 % of its cycles are lost: close other programs on this computer, then check its cable"


@dataclass(frozen=True)
class Finding:
    """The state of one device.

    Attributes:
        device: its name.
        ok: whether it is ready.
        detail: what was found, what is wrong and what to do, with figures, as text.
        figures: the same figures for programs; names carry the unit.
        first: the first problem alone, where the detail goes on after it.
    """

    device: str
    ok: bool
    detail: str
    figures: Mapping[str, float | str] = field(default_factory=dict)
    first: str = ""


def told(
    device: str, problems: Sequence[str], words: Sequence[str], figures: Mapping[str, float | str], place: str = ""
) -> Finding:
    """A device with its problems first, then what else there is to say, all behind the place where it is connected.

    It is ready if there are no problems.
    """
    before = f"{place}: " if place else ""
    detail = before + "; ".join([*problems, *filter(None, words)])
    return Finding(device, not problems, detail, figures, before + problems[0] if problems else "")


def told_losses(health: Sequence[str], share: float, losses: Sequence[str] = ()) -> tuple[tuple[str, ...], list[str]]:
    """Problems of a device, and minor remarks: losses so rare that its driver bridges them.

    Args:
        health: problems reported by the device.
        share: of its cycles that were lost.
        losses: which of the problems are losses, besides lost cycles.
    """
    minor = [words for words in health if share < TOLERATED_LOSS and (words in losses or words.endswith("cycles lost"))]
    wrong = tuple(words for words in health if words not in minor)
    return (*wrong, LOSSY) if share >= TOLERATED_LOSS else wrong, minor
