"""How hard an object is held while it is carried, by what was measured of its friction."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace

import numpy as np
from pydantic import Field

from drivers.core.configuration import StrictModel
from sessions.perception.carrying.carry import CarryOdometry
from sessions.perception.carrying.forecast import Forecast, IntendedCarry


class HoldingSettings(StrictModel):
    """The force of each finger for an object whose friction on the table was measured.

    Attributes:
        forces_N: that may be chosen, ascending.
        slip_m, slip_rad: the first of them is chosen with which the object is foretold to slip no farther, its friction
            taken two standard deviations larger than measured.
        pressed_share: more than the usual force is chosen only if no fingertip is told more than this share of
            ``cycle.pressed_N``.
    """

    forces_N: tuple[float, ...] = Field(default=(0.5, 0.8, 1.0, 1.2, 1.5), min_length=1)
    slip_m: float = Field(default=0.004, gt=0.0)
    slip_rad: float = Field(default=float(np.deg2rad(3.0)), gt=0.0)
    pressed_share: float = Field(default=0.9, gt=0.0, le=1.0)


@dataclass(frozen=True)
class HoldingForces:
    """Chooses how hard the fingers hold.

    Attributes:
        balanced_N: the force of every fingertip, by that of each finger beside the thumb.
        settings: see there.
        usual_N: force of each finger for an object of which nothing is known.
        pressed_N: force on a fingertip above which none presses harder.
    """

    balanced_N: Callable[[float], Mapping[str, float]]
    settings: HoldingSettings
    usual_N: float
    pressed_N: float

    def choose(self, intended: IntendedCarry, odometry: CarryOdometry) -> Forecast:
        """The least force that holds the object; the largest that is allowed if none does."""
        friction, measured = odometry.friction, odometry.measured
        slippery = replace(friction, table_N=measured.most_table_N or friction.table_N)
        allowed = self._allowed_N()
        for force_N in allowed:
            worst = intended.forecast(force_N, self.balanced_N(force_N), slippery, measured.weight_N)
            if worst.slip_m <= self.settings.slip_m and worst.slip_rad <= self.settings.slip_rad:
                break
        return intended.forecast(force_N, self.balanced_N(force_N), friction, measured.weight_N)

    def _allowed_N(self) -> tuple[float, ...]:
        most_N = self.settings.pressed_share * self.pressed_N
        tried = sorted({*self.settings.forces_N, self.usual_N})
        return tuple(each for each in tried if each <= self.usual_N or max(self.balanced_N(each).values()) <= most_N)
