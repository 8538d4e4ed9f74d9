"""Settings of a guided session, as written in a rig file."""

from __future__ import annotations

import math
from typing import Literal

from pydantic import Field

from drivers.core.configuration import StrictModel


class GuidedSettings(StrictModel):
    """How a person leads a session, and what the program does automatically.

    Attributes:
        led_by: "keys": the program moves the hand in steps on request; "hand": the person moves arm and fingers by hand
            (thesis section 3.6), and the program only measures.
        automatic: capture as soon as the contacts are steady.
        least_contacts: fingers that must touch for a steady grasp.
        steady_s: time for which the next three must stay within limits for a steady grasp.
        steady_force_N: range of each fingertip's force.
        steady_m: movement of the palm.
        steady_rad: movement of any joint.
        finger_step_m: travel of a fingertip per key press.
        jog_m, jog_rad: translation and rotation of the hand per key press.
        jog_m_s, jog_rad_s: its speeds.
        silent_s: a fingertip that sends nothing for this long counts as unplugged.
        attention_s: after this long without any input the session is closed properly.
        session_limit_s: longest session, replacing the limit of an autonomous session.
        panel_s: update interval of the panel.
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
