"""How round a held object is: whether normals at its contacts show a turn, and whether it may roll.

Where all normals go through one axis, an object turns about it without any fingertip entering or leaving it. Then only
friction at the fingertips turns it, and what the table takes from that is a guess.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from drivers.core.contacts import Array
from sessions.perception.carrying.friction_balance import Balance
from sessions.perception.carrying.tip_steps import HELD_BY, TipSteps

_ROUND_m = 0.007
"""Lever at which an object is half as loose as a round one; cylinders have 1 mm, prisms and boxes 8 to 17 mm."""
_LEAST_SHARE = 0.3
"""Of the steps in which a finger has to touch to say which way a side faces."""
_MOST_OVERHANG = 0.15
_LEAST_SPARE = 0.4
"""Friction at the edges of two contacts holds a turn a little, too."""
_RCOND = 1e-3


@dataclass(frozen=True)
class Roundness:
    """What the contacts of a carry show of the object.

    Attributes:
        turns: of each step 1 for an object whose turn no normal shows, towards 0 for one with corners, over the
            fingertips beyond the two that any object needs, at least 0.4; 0 where fewer than two held it. Shape (n,).
        overhang: sine of the angle by which its sides face down, at most 0.15: what gets narrower towards the table may
            have no flat underside, and is lifted by fingertips that press it.
    """

    turns: Array
    overhang: float

    @classmethod
    def of(cls, steps: TipSteps, balance: Balance) -> Roundness:
        """Of a carry; one in which two fingertips never held the object at once is not called round."""
        spare = steps.felt.sum(axis=1) - HELD_BY
        turns, held = np.zeros(len(steps)), spare >= 0
        if not held.any():
            return cls(turns, 0.0)
        loose = 1.0 / (1.0 + (_levers_m(balance.entering[held], balance.forces_N[held]) / _ROUND_m) ** 2)
        turns[held] = loose / np.maximum(spare[held], _LEAST_SPARE)
        return cls(turns, min(_overhang(steps), _MOST_OVERHANG))


def _levers_m(entering: Array, forces_N: Array) -> Array:
    """Mean lever of the normal forces about the axis that they turn the object least about, shape (n,)."""
    share = entering / forces_N.sum(axis=1)[:, None, None]
    values, axes = np.linalg.eigh(share[:, :2, :2])
    along_m = (share[:, 2:, :2] @ axes)[:, 0]
    shifts = np.where(values > _RCOND * values[:, 1:], along_m**2 / np.maximum(values, 1e-12), 0.0)
    return np.asarray(np.sqrt(np.maximum(share[:, 2, 2] - shifts.sum(axis=1), 0.0)))


def _overhang(steps: TipSteps) -> float:
    felt = steps.felt.astype(float)
    often = felt.mean(axis=0) > _LEAST_SHARE
    if not often.any():
        return 0.0
    upward = (felt * steps.normals[..., 2]).sum(axis=0)[often] / felt.sum(axis=0)[often]
    return float(np.sqrt(np.mean(np.minimum(upward, 0.0) ** 2)))
