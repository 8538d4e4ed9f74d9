"""Limits of the positioner, and its counters."""

from __future__ import annotations

from dataclasses import dataclass

from pydantic import Field, model_validator

from drivers.core.configuration import StrictModel
from drivers.core.contacts import Array

AXES = ("x", "y", "z", "yaw", "pitch", "roll")

Range = tuple[float, float]


class PositionerSettings(StrictModel):
    """Limits of the positioner.

    Attributes:
        speed_m_s: largest speed of each linear axis.
        speed_rad_s: largest speed of each rotation.
        ranges: lower and upper end of each axis, metres and radians; a target beyond them is refused.
        lost_limit: the positioner stops after this many cycles in a row without a status.
        following_m: a linear axis this far from where it was sent stops the positioner: something is in its way.
        following_rad: the same for the rotations.
        cycle_s: period of the questions while connecting.
        connect_tries: questions until the positioner must have answered.
    """

    speed_m_s: float = Field(default=0.5, gt=0.0)
    speed_rad_s: float = Field(default=2.5, gt=0.0)
    ranges: tuple[Range, Range, Range, Range, Range, Range] = (
        (-1.0, 1.0),
        (-1.0, 1.0),
        (-0.3, 1.3),
        (-12.5, 12.5),
        (-1.0, 1.9),
        (-2.2, 2.2),
    )
    lost_limit: int = Field(default=10, ge=1)
    following_m: float = Field(default=0.1, gt=0.0)
    following_rad: float = Field(default=0.5, gt=0.0)
    cycle_s: float = Field(default=0.01, gt=0.0)
    connect_tries: int = Field(default=20, ge=1)

    @model_validator(mode="after")
    def _ranges_are_not_empty(self) -> PositionerSettings:
        for axis, (lower, upper) in zip(AXES, self.ranges, strict=True):
            if lower >= upper:
                raise ValueError(f"the range of {axis} is empty")
        return self


@dataclass(frozen=True, eq=False)
class PositionerSample:
    """Where the positioner stands.

    Attributes:
        stamp_ns: arrival, session clock.
        q: measured axes, shape (6,), metres and radians.
        fresh: False for the last sample repeated after a lost cycle.
    """

    stamp_ns: int
    q: Array
    fresh: bool = True


@dataclass
class PositionerCounters:
    """Cycles since connecting.

    Attributes:
        cycles: exchanges.
        lost: commands whose status never came; until a later status shows that, cycles in which one is overdue.
        lost_in_a_row: the present run of such cycles.
        malformed: messages that were no status.
        late: statuses that came behind newer ones, and were left alone.
    """

    cycles: int = 0
    lost: int = 0
    lost_in_a_row: int = 0
    malformed: int = 0
    late: int = 0
