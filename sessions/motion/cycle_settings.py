"""Speeds, forces and times of the grasp cycle, as written in a rig file."""

from __future__ import annotations

import numpy as np
from pydantic import Field

from drivers.core.configuration import StrictModel
from sessions.motion.holding import HoldingSettings
from sessions.motion.weighing import WeighingSettings


class TouchSettings(StrictModel):
    """How the hand touches without grasping.

    Attributes:
        tap_m_s: speed of the hand coming down on the top; a thumb, stiff in that direction, reaches 0.8 N, at 18
            mm/s 1.1 N, at 35 mm/s 1.5 N.
        near_m: from so far above a top that is known on the hand comes down slowly.
        met_N: force on a fingertip that ends the approach.
        force_N: force that every fingertip is then brought to.
        most_N: force on any fingertip at which the hand stops moving.
        reach_m: how far a fingertip moves to reach that force.
        search_m_s: its speed until it feels something.
        gain: its speed per force error from then on, m/s per N.
        sink_m: how far the hand itself keeps moving.
        press_s: time for both.
        capture_s: length of the capture.
        rake_height_m: height of the fingertips' centres in a rake.
        rake_m_s: speed of a rake.
        rake_N: force that fingertips are brought to on a side: the sum must not move the object.
        alone_N: the same where a single fingertip touches: less is not always felt.
        row_m: x of the fingertips in the row's own grasp frame.
        beyond_m: how far beyond the middle a rake goes.
        past_side_m: how far behind the side of which it is known where it is, a touch goes: a finger that passes beside
            it would push with a link.
        lowest_m: height of the fingertips over the table where a tap has missed the object.
        below_top_m: a tap without a grasp goes no farther below the top: what stands between the fingers, a neck or a
            rim, must not reach the knuckles.
        side_m_s: speed toward an object's side and along it, palm upright; a stiff fingertip reaches 0.45 N at 20 mm/s
            as it comes, and 1.1 N at 30 mm/s as it meets a rim on its way along.
        side_heights_m: height of the lowest fingertip in such a touch, the first finger down and up. The
            forearm lets it come no lower; from higher up it would tip objects over.
    """

    tap_m_s: float = Field(default=0.014, gt=0.0)
    near_m: float = Field(default=0.02, ge=0.0)
    met_N: float = Field(default=0.20, gt=0.0)
    force_N: float = Field(default=0.35, gt=0.0)
    most_N: float = Field(default=0.45, gt=0.0)
    reach_m: float = Field(default=0.010, ge=0.0)
    search_m_s: float = Field(default=0.012, gt=0.0)
    gain: float = Field(default=0.04, gt=0.0)
    sink_m: float = Field(default=0.004, ge=0.0)
    press_s: float = Field(default=0.9, ge=0.0)
    capture_s: float = Field(default=0.2, gt=0.0)
    rake_height_m: float = Field(default=0.028, gt=0.0)
    rake_m_s: float = Field(default=0.05, gt=0.0)
    rake_N: float = Field(default=0.15, gt=0.0)
    alone_N: float = Field(default=0.25, gt=0.0)
    row_m: float = Field(default=0.012, ge=0.0)
    beyond_m: float = Field(default=0.030, ge=0.0)
    past_side_m: float = Field(default=0.012, ge=0.0)
    lowest_m: float = Field(default=0.012, ge=0.0)
    below_top_m: float = Field(default=0.03, gt=0.0)
    side_m_s: float = Field(default=0.015, gt=0.0)
    side_heights_m: tuple[float, float] = (0.020, 0.032)


class CycleSettings(StrictModel):
    """Speeds, forces and times of the grasp cycle.

    Attributes:
        lift_m: how far above a grasp the hand travels.
        travel_m_s, turn_rad_s: speeds above the object.
        clearance_m: how far the hand stays above the tallest thing on the table while it travels.
        standoff_m: how far before a grasp from the side the hand comes down.
        descent_m_s: speed of the guarded descent, as far as the object's top.
        landing_m_s: and next to the object; on a thumb, stiff in that direction, 35 mm/s end with 1.6 N.
        links_landing_m_s: and where links may land on it, which are stiffer still: 18 mm/s end with 1.9 to 3.3 N.
        beside_m_s: the same where nothing is expected below.
        approach_m_s: speed of the guarded approach from the side, and up from beside an object.
        landing_force_N: a fingertip force during the descent that means the object is under it.
        landing_shift_m: how far the grasp moves toward the finger that landed.
        landing_tries: descents before the grasp is given up.
        closing_m_s: speed of the fingertips; it sets how far the object is pushed.
        touch_force_N: contact force at which a finger stops.
        touch_cycles: cycles in a row with that force: a single jerk of the finger's own mass is not a touch.
        held_up_rad: angle by which a joint falls behind if something holds the finger.
        closing_most_N: force on a fingertip at which all fingers stop: links without sensors may be pushing the object.
        contact_force_N: force that each touching finger settles to for the capture; the thumb takes the others' sum.
        gentle_force_N: the same for an object that leans easily: fingers and thumb are not level.
        settle_s: time for that.
        rest_s: rest after every motion that precedes a measurement.
        capture_s: length of the capture (20 samples at 100 Hz).
        squeeze_force_N: force of each finger while the object is carried; the thumb holds against their sum.
        holding: that force for an object whose friction on the table was measured.
        squeeze_s: time to build the squeeze up.
        squeeze_gain: fingertip speed per force error, m/s per N.
        ease_force_N: force of each finger when a carried object is let go; the thumb balances the others.
        ease_s: time in which the squeeze goes down to it.
        pressed_N: force on a fingertip above which no other finger presses harder.
        pressed_cycles: cycles with that force after which re-orientation stops; one without it makes up for one with.
        carry_turn_rad_s, carry_m_s: speeds while the object is held.
        carry_slack: share by which the forces may be off meanwhile: fingers that yield to each newton with which the
            table pulls let the object slip.
        finger_rad_s: speed of the fastest joint when the hand opens; motors that fall behind would leave the path.
        carry_slip_m, carry_slip_rad: slip of the object at which a carry ends where it is, as the fingertips feel it.
        slip_check_s: how often they are asked, on average; evenly along the hand's way.
        touch: taps on the top and probes from the side.
        weighing: how a held object is weighed.
        finger_gap_m: the thumb stops at this distance from another tip's centre, before they touch each other.
    """

    lift_m: float = Field(default=0.10, gt=0.0)
    travel_m_s: float = Field(default=0.25, gt=0.0)
    turn_rad_s: float = Field(default=1.5, gt=0.0)
    clearance_m: float = Field(default=0.03, ge=0.0)
    standoff_m: float = Field(default=0.13, gt=0.0)
    descent_m_s: float = Field(default=0.05, gt=0.0)
    landing_m_s: float = Field(default=0.014, gt=0.0)
    links_landing_m_s: float = Field(default=0.006, gt=0.0)
    beside_m_s: float = Field(default=0.05, gt=0.0)
    approach_m_s: float = Field(default=0.03, gt=0.0)
    landing_force_N: float = Field(default=0.25, gt=0.0)
    landing_shift_m: float = Field(default=0.018, gt=0.0)
    landing_tries: int = Field(default=4, ge=1)
    closing_m_s: float = Field(default=0.030, gt=0.0)
    touch_force_N: float = Field(default=0.15, gt=0.0)
    touch_cycles: int = Field(default=2, ge=1)
    held_up_rad: float = Field(default=0.12, gt=0.0)
    closing_most_N: float = Field(default=2.0, gt=0.0)
    contact_force_N: float = Field(default=0.4, gt=0.0)
    gentle_force_N: float = Field(default=0.2, gt=0.0)
    settle_s: float = Field(default=0.3, ge=0.0)
    rest_s: float = Field(default=0.2, gt=0.0)
    capture_s: float = Field(default=0.2, gt=0.0)
    squeeze_force_N: float = Field(default=0.8, gt=0.0)
    holding: HoldingSettings = HoldingSettings()
    squeeze_s: float = Field(default=0.5, gt=0.0)
    squeeze_gain: float = Field(default=0.02, gt=0.0)
    ease_force_N: float = Field(default=0.15, gt=0.0)
    ease_s: float = Field(default=0.4, gt=0.0)
    pressed_N: float = Field(default=3.5, gt=0.0)
    pressed_cycles: int = Field(default=2, ge=1)
    carry_turn_rad_s: float = Field(default=0.6, gt=0.0)
    carry_m_s: float = Field(default=0.06, gt=0.0)
    carry_slack: float = Field(default=0.6, ge=0.0, lt=1.0)
    carry_slip_m: float = Field(default=0.004, gt=0.0)
    carry_slip_rad: float = Field(default=float(np.deg2rad(5.0)), gt=0.0)
    slip_check_s: float = Field(default=0.25, gt=0.0)
    finger_rad_s: float = Field(default=1.8, gt=0.0)
    touch: TouchSettings = TouchSettings()
    weighing: WeighingSettings = WeighingSettings()
    finger_gap_m: float = Field(default=0.021, ge=0.0)
