"""Whether the table holds the object while fingertips slide along it.

An object that is dragged over a table is pushed as hard as the table's friction resists; pushed less, by force and
moment together, it stays where it is (the limit surface of Howe and Cutkosky 1996). The balance of friction does not
know with what force the fingertips push, and lets those that press lightly take the object along.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from sessions.perception.carrying.friction_balance import Friction
from sessions.perception.carrying.tip_steps import TipSteps

_HELD_BELOW = 0.8
"""Share of the table's friction. Fingertips also push up and down, so that the table presses more and less."""
_LIGHTLY = 0.5
"""Share of the carry's usual squeeze. A firm one takes the object along with less: its links may push as well."""
_MOST = 0.95
_DRAGGED = 0.9
"""Quantiles of the carry: its squeeze, and the force with which it drags the object. What is light resists less than
is assumed.
"""


def at_rest(steps: TipSteps, friction: Friction) -> NDArray[np.bool_]:
    """In which steps the object stays where it is, shape (n,): pressed lightly, and pushed with less than the table
    resists.
    """
    pushed_N = np.hypot(steps.pushed_N, steps.moments_Nm / friction.foot_m)
    pressed_N = steps.forces_N.sum(axis=1)
    resisted_N = min(friction.table_N, float(np.quantile(pushed_N, _DRAGGED)))
    return np.asarray((pushed_N < _HELD_BELOW * resisted_N) & (pressed_N < _LIGHTLY * np.quantile(pressed_N, _MOST)))
