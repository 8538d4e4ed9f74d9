"""What a rig file says of an arm of Universal Robots: limits, tool, payload, and how it is watched."""

from __future__ import annotations

import math
from typing import Literal

from pydantic import Field, field_validator, model_validator

from drivers.core.configuration import StrictModel
from drivers.positioner.settings import PositionerSettings, Range

Vector = tuple[float, float, float]
_FARTHEST_m = 1.0


class UrSettings(PositionerSettings):
    """Limits of the arm, in addition to those of every positioner. The mount's frame is the arm's base frame.

    Attributes:
        payload_kg: mass of everything on the flange: hand, forearm, adapter and cables. It has to be stated.
        centre_of_gravity_m: of that mass, in the flange's frame.
        flange_T_forearm: the forearm in the flange's frame, as the pendant shows a tool centre point: metres, and a
            rotation vector in radians. It has to be stated.
        acceleration_m_s2, acceleration_rad_s2: largest change of speed of the tool centre.
        reach_m: least and largest distance of the tool centre from the arm's first axis and from its base.
        lost_limit: as for every positioner; the arm itself stops sooner, see ``watchdog_hz``.
        force_limit_N: the arm brakes when it feels this force at the tool centre.
        rest_force_N: more than this at rest before a session means that the payload is wrong.
        speed_slider: the pendant's speed slider must stand at this share or higher.
        watchdog_hz: the arm stops by itself after 1 / ``watchdog_hz`` seconds without a command.
        cycle_s: period of the stream of targets to the arm.
        lookahead_s, gain: how hard the arm follows the stream (URScript's ``servoj``).
        patience_s: after so long without a command from the session the arm brakes.
        unheard_s: after so long without news of the arm its connection counts as lost.
    """

    payload_kg: float | None = Field(default=None, gt=0.0, le=40.0)
    centre_of_gravity_m: Vector = (0.0, 0.0, 0.0)
    flange_T_forearm: tuple[float, float, float, float, float, float] | None = None
    speed_m_s: float = Field(default=0.3, gt=0.0, le=1.0)
    speed_rad_s: float = Field(default=1.2, gt=0.0, le=3.2)
    acceleration_m_s2: float = Field(default=2.0, gt=0.0, le=5.0)
    acceleration_rad_s2: float = Field(default=6.0, gt=0.0, le=20.0)
    ranges: tuple[Range, Range, Range, Range, Range, Range] = (
        (-1.3, 1.3),
        (-1.3, 1.3),
        (-0.3, 1.3),
        (-6.2, 6.2),
        (-1.0, 1.9),
        (-2.2, 2.2),
    )
    reach_m: Range = (0.2, 0.85)
    lost_limit: int = Field(default=50, ge=1)
    force_limit_N: float = Field(default=60.0, gt=0.0, le=250.0)
    rest_force_N: float = Field(default=20.0, gt=0.0)
    speed_slider: float = Field(default=1.0, gt=0.0, le=1.0)
    watchdog_hz: float = Field(default=10.0, ge=2.0, le=50.0)
    cycle_s: float = Field(default=0.008, ge=0.002, le=0.02)
    lookahead_s: float = Field(default=0.05, ge=0.03, le=0.2)
    gain: float = Field(default=400.0, ge=100.0, le=2000.0)
    patience_s: float = Field(default=0.5, gt=0.0, le=5.0)
    unheard_s: float = Field(default=0.2, gt=0.0, le=5.0)

    @field_validator("centre_of_gravity_m", "flange_T_forearm")
    @classmethod
    def _metres_and_radians(cls, stated: tuple[float, ...] | None) -> tuple[float, ...] | None:
        """Millimetres and degrees are the usual mistake; an arm would take them."""
        if stated is not None and math.hypot(*stated[:3]) > _FARTHEST_m:
            raise ValueError(f"must be metres, within {_FARTHEST_m:g} of the flange")
        if stated is not None and math.hypot(*stated[3:]) > 2.0 * math.pi:
            raise ValueError("must turn by radians, one turn at most")
        return stated

    @model_validator(mode="after")
    def _reach_is_not_empty(self) -> UrSettings:
        if not 0.0 <= self.reach_m[0] < self.reach_m[1]:
            raise ValueError("reach_m: the least distance must be below the largest")
        return self


class UrWiring(StrictModel):
    """The arm's control box on the network. Its ports are fixed: 29999 (dashboard), 30003 (programs), 30004 (RTDE)."""

    wire: Literal["ur"]
    host: str = Field(min_length=1)
