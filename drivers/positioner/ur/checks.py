"""What an arm's state means, and what forbids it to move; with the remedy, for people.

Numbers and bits are those of RTDE (protocols: Universal Robots).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from drivers.core.contacts import Array
from drivers.positioner.settings import AXES
from drivers.positioner.ur.codec import ArmFlags, ArmState
from drivers.positioner.ur.settings import UrSettings

READY_MODE = 7
PLAYING = 2
_FIRST_MINOR = {3: 11, 5: 6}
"""First minor version of PolyScope that is known, by the major one: CB3, and e-Series."""

ROBOT_MODES = {
    -1: "NO CONTROLLER",
    0: "DISCONNECTED",
    1: "CONFIRM SAFETY",
    2: "BOOTING",
    3: "POWER OFF",
    4: "POWER ON",
    5: "IDLE, brakes on",
    6: "BACKDRIVE",
    7: "RUNNING",
    8: "UPDATING FIRMWARE",
}

_UNLOCK = "Clear what the arm ran into, release it on the pendant, then start again"
_SAFETY = (
    (0b1000000, "emergency stop at the arm", "Release the switch, then switch the arm on at the pendant"),
    (0b0100000, "emergency stop of the system", "Release the switch, then switch the arm on at the pendant"),
    (0b10000000, "emergency stop", "Release the switch, then switch the arm on at the pendant"),
    (0b0000100, "protective stop", _UNLOCK),
    (0b0010000, "safeguard stop", "Close the safeguard and reset it, then start again"),
    (0b0001000, "recovery mode", "Move the arm back within its safety limits by the pendant"),
    (0b100000000, "safety violation", "Restart the safety system at the pendant"),
    (0b1000000000, "safety fault", "Restart the safety system at the pendant"),
    (0b10000000000, "stopped by its safety system", "Look at the pendant"),
)


@dataclass(frozen=True)
class Refusal:
    """Why an arm may not move, one clause, and what to do next."""

    what: str
    remedy: str


UNHEARD = Refusal("the arm has stopped answering; it stops by itself", "Check its cable and its power")


def wrong_version(version: str) -> Refusal | None:
    """Why an arm with this version of PolyScope is none for this program, such as 3.5.1 or 10.7; None if it is."""
    major, minor = (int(part) for part in version.split(".")[:2])
    if minor >= _FIRST_MINOR.get(major, minor + 1):
        return None
    hint = "CB3 arms need PolyScope 3.11 or a later 3, e-Series arms 5.6 or a later 5; PolyScope X is not supported"
    return Refusal(f"PolyScope {version} is not known to this program", hint)


def safety_stop(arm: ArmState) -> Refusal | None:
    """The safety system's stop, if there is one."""
    for bit, what, remedy in _SAFETY:
        if arm.safety_bits & bit:
            return Refusal(f"{what} (safety status 0x{arm.safety_bits:x})", remedy)
    return None


def not_ready(arm: ArmState, settings: UrSettings) -> Refusal | None:
    """Why an arm cannot move now, whatever it is doing; None if it can."""
    if stop := safety_stop(arm):
        return stop
    if arm.robot_mode != READY_MODE:
        mode = ROBOT_MODES.get(arm.robot_mode, "unknown")
        return Refusal(f"the arm's mode is {mode} ({arm.robot_mode}), not RUNNING (7)", "Start it at the pendant")
    if arm.speed_fraction < settings.speed_slider - 0.005:
        what = f"the speed slider is at {100 * arm.speed_fraction:.0f} %, not {100 * settings.speed_slider:.0f} %"
        return Refusal(what, "Move the slider on the pendant, or state base.speed_slider in the rig file")
    return None


def before_program(arm: ArmState, settings: UrSettings) -> Refusal | None:
    """Why a session may not take the arm over; None if it may.

    Where it stands is for :func:`before_motion`: until then it is told with the tool of the pendant.
    """
    if settings.payload_kg is None:
        return Refusal("no payload is stated", "Weigh hand and adapter: base: {payload_kg: ...} in the rig file")
    if settings.flange_T_forearm is None:
        return Refusal("no tool centre is stated", "State base: {flange_T_forearm: [...]} in the rig file")
    if refusal := not_ready(arm, settings):
        return refusal
    if arm.runtime_state == PLAYING:
        return Refusal("a program is running on the arm", "Stop it on the pendant, or end the program that sent it")
    return None


def before_motion(arm: ArmState, q: Array, settings: UrSettings) -> Refusal | None:
    """What forbids motion of an arm whose tool has been set; None if nothing does."""
    return not_ready(arm, settings) or outside(q, settings) or wrong_payload(arm, settings)


def outside(q: Array, settings: UrSettings) -> Refusal | None:
    """Whether a place, shape (6,), lies outside the stated workspace."""
    for axis, value, (lower, upper) in zip(AXES, q, settings.ranges, strict=True):
        if not lower <= value <= upper:
            what = f"the tool centre's {axis} is {value:.3f}, outside {lower:g} to {upper:g}"
            return Refusal(what, "Move the arm there by the pendant, or correct base.ranges in the rig file")
    if not is_reachable(q, settings):
        distance_m = float(np.linalg.norm(q[:3]))
        what = (
            f"the tool centre is {distance_m:.3f} m from the arm's base, {float(np.hypot(*q[:2])):.3f} m from its axis"
        )
        least_m, most_m = settings.reach_m
        return Refusal(f"{what}: not within {least_m:g} to {most_m:g} m", "Move the arm, or correct base.reach_m")
    return None


def is_reachable(q: Array, settings: UrSettings) -> bool:
    """Whether a place, shape (6,), is within reach and not too close to the arm's first axis."""
    least_m, most_m = settings.reach_m
    return bool(np.hypot(q[0], q[1]) >= least_m and np.linalg.norm(q[:3]) <= most_m)


def wrong_payload(arm: ArmState, settings: UrSettings) -> Refusal | None:
    """A force that an arm with the right payload does not feel at rest."""
    force_N = float(np.linalg.norm(arm.force_N))
    if force_N <= settings.rest_force_N:
        return None
    what = f"the arm feels {force_N:.0f} N at rest with a payload of {settings.payload_kg} kg"
    return Refusal(what, "Weigh again: base.payload_kg; zero the force sensor; see that nothing touches the hand")


def stop_cause(arm: ArmState, settings: UrSettings) -> Refusal | None:
    """Why a session with this arm must stop; None if it can continue."""
    if not arm.flags & ArmFlags.HEARD:
        return UNHEARD
    if refusal := not_ready(arm, settings):
        return refusal
    force_N = float(np.linalg.norm(arm.force_N))
    if force_N > settings.force_limit_N and not arm.flags & ArmFlags.FREE:  # a person pushes harder
        what = f"force {force_N:.0f} N at the tool centre is over the limit of {settings.force_limit_N:.0f} N"
        return Refusal(what, "Check what the hand ran into before continuing")
    if not arm.flags & ArmFlags.PROGRAM:
        return Refusal("the program on the arm was stopped", "See why it was stopped on the pendant, then start again")
    if arm.flags & ArmFlags.BRAKED:
        return Refusal("the arm was braked and takes no more targets", "Look at the pendant, then start again")
    return None
