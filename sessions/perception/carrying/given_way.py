"""Whether the object gave way while fingertips touched it, or was pushed against them.

A fingertip that presses the side of something at rest stays where it is, but for sinking in. Where it moves on along
the normal of its contact, or is moved back, the object moves. One that touches the object again while the hand opens,
in the corner of an L-block say, pushes it aside as far as it goes on.
"""

from __future__ import annotations

import numpy as np

from drivers.core.contacts import Array
from sessions.perception.carrying.friction_balance import Friction
from sessions.perception.carrying.tip_steps import TipSteps

_PRESSED_N, _PUSHES_N = 0.1, 0.3
_LET_GO_s = 0.12
"""Fingertips that open are off the object by then."""
_AT_REST_m = 0.0015
"""Up to here a hand's own play and a rolling fingertip explain it: 1.1 mm at most in 90 closings on things at rest."""


def given_way_m(steps: TipSteps) -> float:
    """How far the object moved at the fingertip that was moved most, along the normal there; 0 for one at rest."""
    moved_m = np.abs(np.sum(_outward_m(steps) * (steps.forces_N > _PRESSED_N), axis=0)).max(initial=0.0)
    return float(moved_m) if moved_m > _AT_REST_m else 0.0


def pushed_open_m(opening: TipSteps) -> float:
    """How far the fingertip that went farthest pushed the object while the hand opened; 0 if all just let go."""
    pushes = (opening.forces_N > _PUSHES_N) & (np.cumsum(opening.step_s) > _LET_GO_s)[:, None]
    return float(np.sum(-_outward_m(opening) * pushes, axis=0).max(initial=0.0))


def _outward_m(steps: TipSteps) -> Array:
    """Motion of each fingertip along the normal out of the object, but for sinking in, shape (n, 5)."""
    return np.asarray(np.sum(steps.moves_m * steps.normals, axis=-1) + Friction.give_m * steps.sinking)
