"""Plans in words for the operator."""

from __future__ import annotations

import math

from sessions.motion.grasp_plan import GraspPlan


def plan_in_words(plan: GraspPlan) -> str:
    """A grasp as an instruction for a person."""
    frame = plan.frame
    place = f"{1e3 * frame.x_m:+.0f}, {1e3 * frame.y_m:+.0f} mm"
    turn = math.degrees(frame.yaw_rad)
    text = f"{plan.closing} at {place}, turned {turn:+.0f}°, tips {1e3 * plan.height_m:.0f} mm high"
    return f"{text} ({plan.reason})" if plan.reason else text
