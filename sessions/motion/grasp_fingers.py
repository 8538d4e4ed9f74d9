"""The fingers of a grasp: they close until they touch, hold with a force, and open again."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from drivers.shadow.closing.closing import Closing
from drivers.shadow.closing.posture import HandShape
from sessions.motion.cycle_settings import CycleSettings
from sessions.motion.finger_gaps import is_near, nears
from sessions.motion.finger_opening import FingerOpening
from sessions.motion.motion import Motion

_HASTE_N, _FLIGHT_N = 1.0, 3.0
"""Limits of the force error in force control: toward the object, and away from it."""

CLEAR_m = 0.02
"""So far the hand rises where a fingertip is over the object."""

_FOLLOWS_s = 0.25
"""A finger that nothing holds has followed its target by then."""

_RESISTED_N = 1.0
"""A fingertip that is pressed so much more than before the hand moved is in the object's way, and not held by it."""


class GraspFingers:
    """Moves the fingers along the paths of a closing, by position and by force.

    Args:
        motion: supervised motion.
        settings: speeds, forces, times.
        hand: its form, and the shape of its fingertips.
    """

    def __init__(self, motion: Motion, settings: CycleSettings, hand: HandShape) -> None:
        self._motion, self.settings, self._hand = motion, settings, hand
        self._closing: Closing | None = None
        self.progress = dict.fromkeys(self._fingers, 0.0)
        """How far along its path each finger is."""
        self.touching: frozenset[str] = frozenset()
        """The fingers that touched when they last closed."""

    @property
    def _fingers(self) -> tuple[str, ...]:
        return self._hand.form.fingers

    @property
    def table(self) -> Closing:
        """The closing whose paths the fingers follow."""
        assert self._closing is not None
        return self._closing

    def open_for(self, closing: Closing) -> None:
        """Move to the open ends of a closing's paths, straight in joint space."""
        self._closing = closing
        self.set_open()
        self._motion.blend_fingers(closing, self.progress, self.settings.finger_rad_s)

    def set_open(self) -> None:
        """Take the open hand as the present progress."""
        self.progress = _open(self.table)

    def close(self, stays_open: frozenset[str] = frozenset()) -> None:
        """Close every finger but these along its path until it touches, meets the thumb, or reaches the path's end.

        Links above the fingertips have no sensors. A finger that one of them holds up stops, and all stop if the object
        is pushed hard against a fingertip.
        """
        s, table = self.settings, self.table
        step_m = s.closing_m_s * self._motion.supervisor.speed_scale * self._motion.cycle_s
        moving, touched = set(self._fingers) - stays_open, dict.fromkeys(self._fingers, 0)
        self._motion.runtime.begin_closing()
        while moving and not self.pressed(s.closing_most_N):
            loads_N = self._motion.loads_N()
            for finger in moving:
                touched[finger] = touched[finger] + 1 if loads_N.get(finger, 0.0) > s.touch_force_N else 0
            held_up = self._motion.bent(s.held_up_rad)
            moving = {
                f for f in moving if touched[f] < s.touch_cycles and f not in held_up and self.may_close(f, step_m)
            }
            for finger in sorted(moving):
                self.progress[finger] += step_m / table.path(finger).length_m
            self._motion.set_fingers(table, self.progress)
            self._motion.tick()
        self.touching = frozenset(finger for finger in self._fingers if touched[finger] >= s.touch_cycles)

    def may_close(self, finger: str, step_m: float) -> bool:
        """Whether a finger may close by a step without leaving its path or hitting the thumb or a neighbour."""
        path = self.table.path(finger)
        on = self.progress[finger] + step_m / path.length_m
        return self.progress[finger] < path.valid[1] and not (self._meets_thumb(finger) or self._nears(finger, on))

    def _meets_thumb(self, finger: str) -> bool:
        """Whether this tip and the thumb's (any other's, for the thumb) are about to touch each other."""
        others = self._hand.form.long_fingers if finger == "TH" else ("TH",)
        return is_near(self.table, self.progress, finger, others, self.settings.finger_gap_m)

    def _nears(self, finger: str, to: float) -> bool:
        """Whether this tip would touch another on its way to a progress."""
        return nears(self.table, self.progress, finger, to, 2 * self._hand.radius_m)

    def settle(self, force_N: float) -> None:
        """Bring the fingers that touch to a force, then let hand and object come to rest."""
        self.build_up(self.balanced_forces_N(self.touching, force_N), self.settings.settle_s)
        self._motion.wait(self.settings.rest_s)

    def ease(self, touching: frozenset[str], from_N: float) -> None:
        """Press less and less, all fingers together, while the object is still felt.

        The fingers open at different speeds and leave one after the other: the last ones then push the object. And a
        tip that the others hold too hard is not pressed harder still by one that holds less than it should.
        """
        s = self.settings
        for share in self._motion.shares(s.ease_s):
            force_N = from_N + share * (s.ease_force_N - from_N)
            self.servo_forces(self.balanced_forces_N(touching, force_N), hard_N=s.closing_most_N)
            self._motion.tick()

    def balanced_forces_N(self, touching: frozenset[str], force_N: float) -> dict[str, float]:
        """Force of each finger; the thumb balances the others' forces along the grasp's x axis."""
        table = self.table
        forces_N = dict.fromkeys(sorted(touching - {"TH"}), force_N)
        if "TH" in touching:
            pushed_N = sum(-force_N * float(table.path(finger).direction[0]) for finger in forces_N)
            forces_N["TH"] = max(force_N, pushed_N)
        return forces_N

    def build_up(self, targets_N: dict[str, float], duration_s: float) -> None:
        """Force control for a time, without other motion."""
        for _ in range(self._motion.cycles(duration_s)):
            self.servo_forces(targets_N)
            self._motion.tick()

    def servo_forces(self, targets_N: dict[str, float], slack: float = 0.0, hard_N: float = np.inf) -> None:
        """One cycle of force control: a fingertip moves along its path in proportion to its force error.

        It retreats faster than it presses. A fingertip that is held up presses no further, and none does while another
        is pressed hard. Overloaded fingers without a target force retreat.

        Args:
            targets_N: by finger.
            slack: a force that is off by no more than this share of its target is right.
            hard_N: more than this is hard, if it is less than usual.
        """
        s, table, loads_N = self.settings, self.table, self._motion.loads_N()
        pressed, held_up = self.pressed(min(s.pressed_N, hard_N)), self._motion.bent(s.held_up_rad)
        errors_N = dict.fromkeys((*pressed, *held_up), -_HASTE_N)
        for finger, target_N in targets_N.items():
            most_N = 0.0 if pressed or finger in held_up else _HASTE_N
            error_N = target_N - loads_N.get(finger, 0.0)
            error_N -= float(np.clip(error_N, -slack * target_N, slack * target_N))
            errors_N[finger] = float(np.clip(error_N, -_FLIGHT_N, most_N))
        for finger, error_N in errors_N.items():
            path = table.path(finger)
            step = s.squeeze_gain * error_N * self._motion.cycle_s / path.length_m
            to = float(np.clip(self.progress[finger] + step, *path.valid))
            if step < 0.0 or not self._nears(finger, to):
                self.progress[finger] = to
        self._motion.set_fingers(table, self.progress)

    def pressed(self, force_N: float) -> tuple[str, ...]:
        """The fingertips with more than this force."""
        return tuple(finger for finger, load_N in self._motion.loads_N().items() if load_N > force_N)

    def _overloaded_fingers(self) -> set[str]:
        """The fingers whose tips are pressed hard, or that are held up."""
        return {*self.pressed(self.settings.pressed_N), *self._held_up()}

    def _held_up(self) -> set[str]:
        return set(self._motion.bent(self.settings.held_up_rad))

    def release(self) -> None:
        """Open the hand, every tip back along its path: a straight joint motion would dip into the table.

        A finger that is pressed as it opens, or does not follow, is over the object or in its way: the hand rises once,
        and that finger opens last (:class:`FingerOpening`).
        """
        begun_N, begun_bent, has_risen = self._motion.loads_N(), self._held_up(), False
        opening = self._opening()
        while still_closed := opening.still_closed:
            opening.on_late(self._held_up() - begun_bent)
            resisted = self._resisted(begun_N) | opening.held_back
            if resisted and not has_risen:
                self.rise()
                has_risen = True
            free = {finger for finger in still_closed if not self._nears(finger, opening.next_place(finger))}
            opening.open_next(free, self._overloaded_fingers(), resisted)
            self.progress = opening.progress
            self._motion.set_fingers(self.table, self.progress)
            self._motion.tick()

    def _opening(self) -> FingerOpening:
        opened = _open(self.table)
        duration_s = self._motion.finger_time_s(self.table, opened, self.settings.finger_rad_s)
        step = next(iter(self._motion.shares(duration_s)))
        return FingerOpening(self.progress, opened, step, self._motion.cycles(_FOLLOWS_s))

    def rise(self) -> None:
        """Up from over or beside the object, until it holds a fingertip back."""
        begun_N = self._motion.loads_N()
        up = self._motion.raised(CLEAR_m)
        self._motion.probe_base(up, self.settings.approach_m_s, lambda: bool(self._resisted(begun_N)))

    def _resisted(self, begun_N: Mapping[str, float]) -> set[str]:
        """The fingertips that are pressed, and harder than they were."""
        pressed, loads_N = self.pressed(self.settings.closing_most_N), self._motion.loads_N()
        return {finger for finger in pressed if loads_N[finger] > begun_N.get(finger, 0.0) + _RESISTED_N}


def _open(closing: Closing) -> dict[str, float]:
    """Progress of the open hand."""
    return {finger: closing.path(finger).valid[0] for finger in closing.fingers}
