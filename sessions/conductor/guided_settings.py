"""Settings of a guided session, as they stand in a rig file."""

from __future__ import annotations

import math
from typing import Literal

from pydantic import Field

from drivers.core.configuration import StrictModel


class GuidedSettings(StrictModel):
    """What a guided session asks of the person, and when it acts by itself.

    Attributes:
        led_by: "keys": the hand has to be driven, in steps, on request; "hand": the person guides arm and fingers
            with his own hands (thesis section 3.6), and the program only watches.
        automatic: capture as soon as the contacts are steady.
        least_contacts: fingers that have to touch before a grasp can be steady.
        steady_s: how long everything has to stay within the next three before a grasp is steady.
        steady_force_N: range of each fingertip's force.
        steady_m: movement of the palm.
        steady_rad: movement of any joint.
        finger_step_m: way of a fingertip for one key.
        jog_m, jog_rad: way and turn of the hand for one key.
        jog_m_s, jog_rad_s: its speeds.
        silent_s: a fingertip that sends nothing for so long counts as unplugged.
        attention_s: without any sign of the person for so long the session is closed in order.
        session_limit_s: the longest session, in place of the one of an autonomous session.
        panel_s: how often the panel is renewed.
    """

    led_by: Literal["keys", "hand"] = "keys"
    automatic: bool = False
    least_contacts: int = Field(default=3, ge=1)
    steady_s: float = Field(default=0.5, gt=0.0)
    steady_force_N: float = Field(default=0.15, gt=0.0)
    steady_m: float = Field(default=0.002, gt=0.0)
    steady_rad: float = Field(default=math.radians(2.0), gt=0.0)
    finger_step_m: float = Field(default=0.003, gt=0.0, le=0.01)
    jog_m: float = Field(default=0.005, gt=0.0, le=0.05)
    jog_rad: float = Field(default=math.radians(5.0), gt=0.0, le=0.5)
    jog_m_s: float = Field(default=0.05, gt=0.0)
    jog_rad_s: float = Field(default=0.5, gt=0.0)
    silent_s: float = Field(default=0.5, gt=0.0)
    attention_s: float = Field(default=3600.0, gt=0.0)
    session_limit_s: float = Field(default=12 * 3600.0, gt=0.0)
    panel_s: float = Field(default=0.2, gt=0.0)
