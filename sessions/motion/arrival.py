"""How the open hand arrives at a grasp: guarded, down around the object or from its side.

Whatever it meets on its way ends that way, and stays known as a landing.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from drivers.core.contacts import Array
from drivers.shadow.closing.closing import Closing, closing
from drivers.shadow.closing.hand_envelope import lowest_inside_m, open_hand
from drivers.shadow.closing.posture import HandShape
from sessions.motion.cycle_settings import CycleSettings
from sessions.motion.grasp_frame import GraspFrame
from sessions.motion.grasp_plan import GraspPlan
from sessions.motion.guard import Guard
from sessions.motion.motion import Motion
from sessions.motion.travel import top_at_most_m

_LINKS_NEAR_m = 0.005
"""Above a top that is known on: from there links may land on it."""


@dataclass(frozen=True)
class Place:
    """Where the hand arrives.

    Attributes:
        frame: the grasp frame.
        table: the closing whose open posture the hand has.
    """

    frame: GraspFrame
    table: Closing

    @classmethod
    def of(cls, plan: GraspPlan, hand: HandShape) -> Place:
        """That of a grasp."""
        return cls(plan.frame, closing(plan.closing, plan.height_m, hand))


class Arrival:
    """Moves the open hand to a grasp.

    Args:
        motion: supervised motion.
        settings: speeds and forces.
        hand: its form, and the shape of its fingertips.
    """

    def __init__(self, motion: Motion, settings: CycleSettings, hand: HandShape) -> None:
        self._motion, self._settings, self._hand = motion, settings, hand
        self._guard = Guard(motion, settings.touch.met_N, settings.held_up_rad)
        self._landing = Guard(motion, settings.landing_force_N, settings.held_up_rad)
        self.landings_world_m: list[Array] = []
        """Centres of the tips, (3,) each, at each landing on the object."""

    # --- from above --------------------------------------------------------------------------------------------

    def come_down(self, place: Place) -> tuple[str, ...]:
        """Guarded descent, slower from the object's top on, and slowest where links may land on it.

        Returns:
            What landed on something: fingers, or unidentified links.
        """
        s, guard, motion = self._settings, self._landing, self._motion
        inside_m = lowest_inside_m(place.table.name, place.table.height_m, self._hand)
        tips_m = self._tips_from_m(place.table)
        links_m = float(np.clip(top_at_most_m(motion) + _LINKS_NEAR_m - inside_m, 0.0, tips_m))
        tips_m, links_m = np.minimum((tips_m, links_m), self.short_of_m(place))
        for above_m, speed_m_s in ((tips_m, s.descent_m_s), (links_m, s.landing_m_s), (0.0, s.links_landing_m_s)):
            guard.restart()
            if not motion.probe_base(motion.base_joints(place.frame, place.table, above_m), speed_m_s, guard.is_met):
                motion.wait(s.rest_s)
                guard.is_met()
                self._note_from_above(place, inside_m)
                break
        return guard.met

    def come_up(self, place: Place) -> None:
        """As far as fingertips may be beside the object, slowly: one may be under a rim."""
        s, motion, tips_m = self._settings, self._motion, self._tips_from_m(place.table)
        if self.short_of_m(place) < tips_m:
            motion.move_base(motion.base_joints(place.frame, place.table, tips_m), s.approach_m_s, s.turn_rad_s)

    def _tips_from_m(self, table: Closing) -> float:
        """How far above the grasp the tips may meet the top."""
        opened = open_hand(table.name, table.height_m, self._hand)
        return max(0.0, top_at_most_m(self._motion) + self._settings.touch.near_m - opened.lowest_m)

    def short_of_m(self, place: Place) -> float:
        """How far the hand is from there."""
        there = self._motion.base_joints(place.frame, place.table)
        return float(np.linalg.norm(there[:3] - self._motion.runtime.perception.hand.base_q[:3]))

    # --- from the side -----------------------------------------------------------------------------------------

    def come_beside(self, place: Place, away_m: float) -> bool:
        """Down next to the object, so far before the grasp. Returns whether nothing was met."""
        s, motion = self._settings, self._motion
        self._guard.restart()
        beside = motion.base_joints(place.frame, place.table, 0.0, away_m)
        if motion.probe_base(beside, s.beside_m_s, self._guard.is_met):
            motion.tare(s.rest_s)
            return True
        self.note(place, self._guard)
        return False

    def come_in(self, place: Place) -> bool:
        """Slowly from there to the grasp; the hand stops where it meets something. Returns whether nothing was met."""
        motion = self._motion
        self._guard.restart()
        motion.runtime.begin_closing()
        for q in motion.line(motion.base_joints(place.frame, place.table), self._settings.approach_m_s):
            motion.set_base(q)
            motion.tick()
            if self._guard.is_met():
                motion.set_base(motion.runtime.perception.hand.base_q)
                self.note(place, self._guard)
                return False
        return True

    # --- landings ----------------------------------------------------------------------------------------------

    def note(self, place: Place, guard: Guard) -> None:
        """Store where the hand hit something: at the fingertip that did, or else at the foremost."""
        everyone = self._hand.form.fingers
        fingers = [finger for finger in guard.met if finger in everyone] or list(everyone)
        ahead = np.asarray(place.frame.pose.rotation().rotate(np.array(place.table.approach)))
        centres_m = [self._motion.tip_centre_world_m(finger, self._hand) for finger in fingers]
        self.landings_world_m.append(max(centres_m, key=lambda centre_m: float(centre_m @ ahead)))

    def _note_from_above(self, place: Place, link_m: float) -> None:
        """Store where the hand landed; links alone, the lowest of which is at ``link_m``, do so between the fingertips,
        which passed by.
        """
        if np.isinf(link_m) or any(finger in self._hand.form.fingers for finger in self._landing.met):
            self.note(place, self._landing)
            return
        height_m = link_m + self.short_of_m(place)
        self.landings_world_m.append(np.array([place.frame.x_m, place.frame.y_m, height_m]))
