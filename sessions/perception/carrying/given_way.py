"""Whether the object gave way while fingertips touched it, or was pushed against them.

A fingertip that presses the side of something at rest stays where it is, but for sinking in. Where it moves on along
the normal of its contact, or is moved back, the object moves.
"""

from __future__ import annotations

import numpy as np

from sessions.perception.carrying.friction_balance import Friction
from sessions.perception.carrying.tip_steps import TipSteps

_PRESSED_N = 0.1
_AT_REST_m = 0.0015
"""Up to here a hand's own play and a rolling fingertip explain it: 1.1 mm at most in 90 closings on things at rest."""


def given_way_m(steps: TipSteps) -> float:
    """How far the object moved at the fingertip that was moved most, along the normal there; 0 for one at rest."""
    along_m = np.sum(steps.moves_m * steps.normals, axis=-1) + Friction.give_m * steps.sinking
    moved_m = np.abs(np.sum(along_m * (steps.forces_N > _PRESSED_N), axis=0)).max(initial=0.0)
    return float(moved_m) if moved_m > _AT_REST_m else 0.0
