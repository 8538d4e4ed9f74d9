"""Settings of the hand, as they stand in a rig file."""

from __future__ import annotations

from pydantic import Field

from drivers.shadow.motor_polling import PollingRates
from drivers.shadow.motor_watch import HeatLimits
from drivers.shadow.motors import GainTable
from drivers.shadow.palm_images import PalmName
from drivers.shadow.tactile_requests import TactileKind
from tactile_lab.strict_yaml import StrictModel


class HandSettings(StrictModel):
    """How the host drives the hand.

    Attributes:
        palm: which palm the hand has.
        cycle_s: period of the exchanges while connecting and closing, seconds.
        gains: position control.
        polling: how often the motors are asked for what.
        tactile: kind of fingertip asked for data through the palm.
        lost_limit: so many cycles in a row without a valid status stop the hand.
        blind_after: so many lost cycles in a row already take the demands away, until a status comes again.
        soft_start_s: after connecting, a resume or a loss the duty cycle limit rises from zero in this time.
        demand_grace_s: after a pause in the demands motors may report for so long that they had halted.
        heat: temperature limits of the motors.
        connect_tries: exchanges until the palm must have answered.
        close_cycles: exchanges with zero demands before the link is closed.
    """

    palm: PalmName = "0220"
    cycle_s: float = Field(default=0.01, gt=0.0)
    gains: GainTable = GainTable()
    polling: PollingRates = PollingRates()
    tactile: TactileKind = "none"
    lost_limit: int = Field(default=10, ge=1)
    blind_after: int = Field(default=2, ge=1)
    soft_start_s: float = Field(default=0.5, ge=0.0)
    demand_grace_s: float = Field(default=0.3, ge=0.0)
    heat: HeatLimits = HeatLimits()
    connect_tries: int = Field(default=20, ge=1)
    close_cycles: int = Field(default=5, ge=1)
