"""How far a held object has slipped so far, while it is carried."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from drivers.core.fingertip import ContinuousFingertip
from drivers.shadow.protocol.palm_images import Side
from sessions.perception.carrying.carry_record import CarrySamples
from sessions.perception.carrying.friction_balance import Balance, Friction, compose_steps
from sessions.perception.carrying.planar_motions import displacements, planar_matrices
from sessions.perception.carrying.resting import at_rest
from sessions.perception.carrying.tip_steps import tip_steps

_ITERATIONS = 5
"""Eight change the slip by less than 0.1 mm and 0.02 degrees."""


@dataclass(frozen=True)
class Slip:
    """Motion of an object relative to the palm that holds it.

    Attributes:
        far_m: of the middle of its contacts.
        turned_rad: its turn, without sign.
    """

    far_m: float
    turned_rad: float

    def in_words(self) -> str:
        """The slip in words, for people."""
        return f"{1e3 * self.far_m:.0f} mm, {np.degrees(self.turned_rad):.0f} degrees"


def slip(
    samples: CarrySamples, fingertips: Mapping[str, ContinuousFingertip], side: Side, friction: Friction
) -> Slip | None:
    """The slip during these samples, without its uncertainty; None for too few."""
    steps = tip_steps(samples, fingertips, side)
    if not len(steps):
        return None
    balance = Balance.of(steps)
    motions = balance.solve([friction], _ITERATIONS)[0]
    motions[at_rest(steps, friction)] = 0.0
    moved = compose_steps(motions, balance.centres_m)
    palm = planar_matrices(steps.world_T_palm[[0, -1]])[0]
    far_x, far_y, turned = displacements(np.linalg.inv(palm) @ moved, balance.centres_m[0])
    return Slip(float(np.hypot(far_x, far_y)), float(abs(turned)))
