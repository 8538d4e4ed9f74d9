"""Whether a held object resists: it is jammed, or more is asked of the fingertips than friction can hold.

What fingertips do to an object that is dragged over a table, the table's friction does to them. Force or moment beyond
it comes from something else that holds the object. And however little that is: fingertips that press lightly for what
they push may all slide the same way, and their motion does not tell the object's then.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Self

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import maximum_filter1d

from drivers.core.contacts import Array
from sessions.perception.carrying.friction_balance import Friction
from sessions.perception.carrying.tip_steps import TipSteps

_BEYOND_SHARES, _BEYOND_TURNS = (0.08, 0.2), (0.3, 0.7)
"""Net force, and net moment over the mean lever, beyond the table's friction, over the sum of normal forces: of 199
carries over a table 0 and 0.3 at most, of jammed objects 0.1 to 0.3 or 0.6 to 0.9.
"""
_CONE_SHARES = (0.3, 0.6)
"""Net force over the sum of normal forces: from where on fingertips may slide, and where all of them do."""
_RESISTS, _AROUND = 0.25, 11
"""Beyond this nothing is believed, nor in as many steps around it, in which the force builds up and fades."""
_LEAST_s = 0.05
_LEAST_LEVER_m = 0.01


@dataclass(frozen=True)
class Resistance:
    """How an object resisted in a carry.

    Attributes:
        doubt: how little the fingertips can be believed to stick in each step, 0 to 1, shape (n,).
        resisted_N: mean force with which they pushed or turned it while it resisted; 0 if it hardly did.
    """

    doubt: Array
    resisted_N: float

    @classmethod
    def of(cls, steps: TipSteps, table: Friction) -> Self:
        """Of the steps of a carry; ``table`` is what is known of the friction on it."""
        levers_m = np.maximum(steps.levers_m, _LEAST_LEVER_m)
        pushes_N = np.column_stack([steps.pushed_N, np.abs(steps.moments_Nm) / levers_m])
        usual_N = np.column_stack([np.ones(len(steps)), table.foot_m / levers_m])
        pressed_N = np.maximum(steps.forces_N.sum(axis=1), 1e-9)[:, None]
        beyond = np.maximum(pushes_N - max(table.table_N, Friction.table_N) * usual_N, 0.0) / pressed_N
        resistance = np.maximum(_doubt(beyond[:, 0], _BEYOND_SHARES), _doubt(beyond[:, 1], _BEYOND_TURNS))
        resists = _long_enough((resistance > _RESISTS) & (steps.felt.sum(axis=1) > 1), steps)
        near_cones = _doubt(steps.pushed_N / pressed_N[:, 0], _CONE_SHARES)
        doubt = np.maximum.reduce([resistance, maximum_filter1d(resists, _AROUND), near_cones])
        return cls(doubt, float(pushes_N.max(axis=1)[resists].mean()) if resists.any() else 0.0)


def _doubt(shares: Array, limits: tuple[float, float]) -> Array:
    low, high = limits
    return np.asarray(np.clip((shares - low) / (high - low), 0.0, 1.0) ** 2)


def _long_enough(flags: NDArray[np.bool_], steps: TipSteps) -> NDArray[np.bool_]:
    """The steps that are flagged; none where that is too short to tell."""
    return np.asarray(flags & bool(steps.step_s @ flags >= _LEAST_s))
