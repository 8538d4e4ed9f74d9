"""Settings of the hand, as they stand in a rig file."""

from __future__ import annotations

from collections.abc import Mapping
from typing import ClassVar, Literal

from pydantic import Field, model_validator

from drivers.core.configuration import StrictModel
from drivers.shadow.device.joint_watch import SensorLimits
from drivers.shadow.device.motor_load import LoadLimits
from drivers.shadow.device.motor_polling import PollingRates
from drivers.shadow.device.motor_watch import HeatLimits
from drivers.shadow.device.tactile_requests import TactileKind
from drivers.shadow.model.gains import GainTable
from drivers.shadow.model.motors import DRIVEN_JOINTS
from drivers.shadow.protocol.motor_data import MAX_PWM, MOTOR_PATIENCE_s
from drivers.shadow.protocol.palm_images import USUAL_PALM, PalmName, Side

WIRE_CYCLE_s = 0.002
"""Period of a hand on its cable that nobody has stated; Shadow's own host has 1 ms."""


class HandSettings(StrictModel):
    """How the host drives the hand.

    Attributes:
        palm: which palm the hand has; on a cable the product code decides if this is left out (:attr:`palm_stated`).
        side: which hand it is; its own files decide if this is left out, and must not contradict it.
        fingers: that it has; the same.
        cycle_s: period of the exchanges, seconds; below the 20 ms after which motors halt for want of a demand. On a
            cable it is :data:`WIRE_CYCLE_s` where it is left out (:attr:`on_wire`).
        demand: what is commanded to the motors: a duty cycle, or a torque that they keep by themselves at 5 kHz.
        gains: position control, in counts of that demand.
        polling: how often each type is requested from the motors.
        tactile: kind of fingertip asked for data through the palm.
        tactile_names: ask the fingertips, after connecting, who they are as well; ``rig check`` does.
        link_patience_s: the hand stops after this time without a valid status; before that it recovers by itself.
        blind_after: after this many lost cycles in a row demands are zero until the next status.
        soft_start_s: after connecting, a resume or a loss the duty cycle limit rises from zero in this time.
        demand_grace_s: after a pause in the demands motors may report for so long that they had halted.
        heat: temperature limits of the motors.
        load: limits of torque and duty cycle.
        sensors: what the joint sensors of driven joints may say.
        connect_tries: exchanges until the palm must have answered.
        close_cycles: exchanges with zero demands before the transport is closed.
        reset_motors: reset the motor boards when connecting; they then need ``reset_wait_s`` to come back.
    """

    retired: ClassVar[Mapping[str, str]] = {"lost_limit": "link_patience_s, in seconds, takes its place"}

    palm: PalmName = USUAL_PALM
    side: Side | None = None
    fingers: tuple[str, ...] | None = None
    cycle_s: float = Field(default=0.01, gt=0.0, lt=MOTOR_PATIENCE_s)
    demand: Literal["pwm", "torque"] = "pwm"
    gains: GainTable = GainTable()
    polling: PollingRates = PollingRates()
    tactile: TactileKind = "none"
    tactile_names: bool = False
    link_patience_s: float = Field(default=2.0, gt=0.0, le=10.0)
    blind_after: int = Field(default=2, ge=1)
    soft_start_s: float = Field(default=0.5, ge=0.0)
    demand_grace_s: float = Field(default=0.3, ge=0.0)
    heat: HeatLimits = HeatLimits()
    load: LoadLimits = LoadLimits()
    sensors: SensorLimits = SensorLimits()
    connect_tries: int = Field(default=20, ge=1)
    close_cycles: int = Field(default=5, ge=1)
    reset_motors: bool = False
    reset_wait_s: float = Field(default=3.2, ge=0.0, le=30.0)

    @property
    def palm_stated(self) -> bool:
        """Whether someone named the palm, so that another one is refused."""
        return "palm" in self.model_fields_set

    @property
    def on_wire(self) -> HandSettings:
        """The same on a cable, where the hand keeps a quicker cycle by itself unless another is stated."""
        if "cycle_s" in self.model_fields_set:
            return self
        return self.model_copy(update={"cycle_s": WIRE_CYCLE_s})

    @model_validator(mode="after")
    def _duty_cycles_exist(self) -> HandSettings:
        largest = max(self.gains.of(joint).max_pwm for joint in DRIVEN_JOINTS)
        if self.demand == "pwm" and largest > MAX_PWM:
            raise ValueError(f"a duty cycle of {largest:g} counts is more than the maximum, {MAX_PWM}")
        return self
