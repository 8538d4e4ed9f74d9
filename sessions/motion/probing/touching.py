"""Touches without a grasp: a tap on the top, a probe from the side.

The hand takes up a posture of one of the closings, fingers partly closed, and the positioner carries it in a straight
line until something is touched; then as many fingertips as possible are laid on the object. The contacts are kept for
the next grasp (:attr:`~sessions.recording.session_events.EventKind.TOUCH_END`): the object has not moved since the
touch.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from drivers.core.contacts import Array
from drivers.shadow.closing.closing import Closing, closing, sideways
from drivers.shadow.closing.posture import HandShape
from drivers.shadow.closing.tip_motion import motor_rates
from sessions.motion.cycle_settings import CycleSettings, TouchSettings
from sessions.motion.grasp_frame import GraspFrame
from sessions.motion.grasp_plan import TouchPlace
from sessions.motion.guard import LINKS, Guard
from sessions.motion.motion import Motion
from sessions.motion.probing.lane import Lane
from sessions.motion.probing.touch_patterns import COLUMN, TAP, Pattern, TAP_HEIGHT_m, lowest_ahead, lowest_touch_m
from sessions.motion.travel import top_at_most_m, travel_height_m
from sessions.perception.approach_paths import TipSurface


@dataclass(frozen=True)
class SideTouch:
    """What a touch from the side has met: places and outward normals, shape (n, 3) each, world frame.

    Where an object gave way before a contact was captured, the fingertips' foremost places stand for it.
    """

    points_m: Array
    normals: Array

    def __len__(self) -> int:
        return len(self.points_m)


_DOWN = np.array([0.0, 0.0, -1.0])
_BELOW_m = 0.003
"""Below the top as it is known: what a tap meets from there on is a rim or a slope, on which links land."""

_SUNK_s = 0.2
"""So much longer fingertips are laid on where the hand sinks meanwhile."""

_FINGER_END_m = 0.05
"""The two links behind a fingertip are so long."""

_AWAY_m = 0.03
"""From a side that is known, while the hand goes along it."""


class Toucher:
    """Touches the object.

    Args:
        motion: supervised motion.
        cycle: speeds, forces and times.
        hand: its form, and the shape of its fingertips.
    """

    def __init__(self, motion: Motion, cycle: CycleSettings, hand: HandShape) -> None:
        self._motion, self._cycle, self._hand = motion, cycle, hand
        self.guard = Guard(motion, cycle.touch.met_N, cycle.held_up_rad)
        """Ends approaches, and tells what met something in the last."""

    @property
    def settings(self) -> TouchSettings:
        """Speeds and forces of touching."""
        return self._cycle.touch

    def expect_tallest(self, height_m: float) -> None:
        """From here on the hand travels above this height: nothing on the table is taller, as far as is known."""
        self._motion.tallest_m = height_m

    def on_top(self, height_m: float) -> None:
        """The top was looked for, and nothing taller found: the first approach has ended well.

        Where a link alone has landed, fingertips may have been inside a rim, and the rim is higher.
        """
        self.expect_tallest(height_m + (_FINGER_END_m if self.guard.met == (LINKS,) else 0.0))
        self._motion.supervisor.on_approach()

    def tap(self, frame: GraspFrame, below_top_m: float = np.inf) -> Array:
        """Come down on the object under a grasp frame, lay the fingertips on it, and rise again.

        Slowly from a little above the tallest thing that is known.

        Args:
            frame: the fingertips are around its origin.
            below_top_m: no farther down than this below the tallest thing, which has been felt, and never onto the
                table; below it, where links may land on a rim, more slowly still.

        Returns:
            Where fingertips touched something, shape (n, 3), world frame: their contacts, which on a rim are higher
            than the fingertips reach down; without any, the fingertips' foremost places.
        """
        s, table, motion = self.settings, closing(TAP.closing, TAP_HEIGHT_m, self._hand), self._motion
        self._poise(table, TAP, frame)
        motion.runtime.begin_closing()
        found = np.empty((0, 3))
        known = len(motion.runtime.perception.probed)
        if self._come_down(table, frame, below_top_m):
            motion.supervisor.on_approach()
            found, is_known = self._landing_points(_DOWN, frame), below_top_m < np.inf
            if not is_known or LINKS not in self.guard.met:
                leans = self.guard.leans if is_known else self.guard.leans_hard
                self._lay_on(table, TAP, _DOWN, frame, s.force_N, s.sink_m, leans=leans)
                found = landed if len(landed := self._landing_points(_DOWN, frame)) else found
        self.capture()
        motion.rise(self._cycle.lift_m, self._cycle.travel_m_s)
        contacts = motion.runtime.perception.probed[known:]
        return np.array([contact.point_world_m for contact in contacts]) if contacts else found

    def _come_down(self, table: Closing, frame: GraspFrame, below_top_m: float) -> bool:
        """The way down of a tap, until it meets something. Returns whether it has."""
        s, motion = self.settings, self._motion
        touching_m, top_m = self._hand.semi_axes_m[2] - TAP_HEIGHT_m, top_at_most_m(motion)
        lowest_m = s.lowest_m if motion.tallest_m is None else max(s.lowest_m, top_m - below_top_m)
        below_m = top_m - _BELOW_m if below_top_m < np.inf else lowest_m
        heights_m = [max(lowest_m, height_m) for height_m in (top_m + s.near_m, below_m, lowest_m)]
        near, below, lowest = (motion.base_joints(frame, table, m + touching_m) for m in heights_m)
        return (
            self._approach(near, self._cycle.descent_m_s)
            or self._approach(below, s.tap_m_s, is_careful=True)
            or self._approach(lowest, self._cycle.links_landing_m_s, is_careful=True)
        )

    def lowest_m(self, side: str) -> float:
        """How low the lowest fingertip of a touch from a side may be."""
        return lowest_touch_m(side, self.settings.side_heights_m, self._hand)

    def touch_side(
        self,
        places: Sequence[TouchPlace],
        side: str,
        from_m: float,
        beyond_m: float | None = None,
    ) -> SideTouch | None:
        """Come toward the middle of a grasp frame from its left or right, palm upright, fingers one above the other.

        Args:
            places: fingers move along their frames' y axes, over the origin and a little beyond; of those after the
                first it is known where the side is, and what fingertips meet on their way there is felt and ends the
                touch; so does an object that has given way, which leans by now.
            side: where the palm stands, one of :data:`~drivers.shadow.closing.closing.SIDES`.
            from_m: where the fingertips begin, counted from the origin.
            beyond_m: how far over the origin; as the settings say unless given.

        Returns:
            What was touched, perhaps nothing; None where the hand could not come down.
        """
        s, motion, (first, *further) = self.settings, self._motion, places
        table = closing(sideways(COLUMN.closing, side), first.height_m, self._hand)
        column = lowest_ahead(table, self._hand, first.up_to_m)
        lane = Lane(table, column, first, s.row_m, s.beyond_m if beyond_m is None else beyond_m)
        known = len(motion.runtime.perception.probed)
        self._poise(table, column, lane.frame, from_m)
        self.guard.restart()
        if not motion.probe_base(lane.joints(motion, from_m), self._cycle.beside_m_s, self.guard.is_met):
            self._rise_over(lane.frame, table, from_m)
            return None
        motion.tare(self._cycle.rest_s)
        landed = latest = self._lay_against(lane)
        for following in further:
            beside = replace(lane, place=following)
            if self._has_given_way(latest):
                break
            if not self._go_along(beside):
                self._meet_again(beside)
                break
            lane = beside
            latest = self._lay_against(lane)
            landed = np.vstack([landed, latest])
        motion.move_base(lane.joints(motion, from_m), *self._travel)
        self._rise_over(lane.frame, table, from_m)
        if contacts := motion.runtime.perception.probed[known:]:
            points_m, normals = ([getattr(c, of) for c in contacts] for of in ("point_world_m", "normal_world"))
            return SideTouch(np.array(points_m), np.array(normals))
        return SideTouch(landed, np.tile(-lane.ahead, (len(landed), 1)))

    def _lay_against(self, lane: Lane) -> Array:
        """Toward the side until it is met, and the fingertips against it: their foremost places, shape (n, 3).

        Where a link has met it alone they stay where they are: links would push what the fingertips do not reach.
        """
        motion, along = self._motion, np.array(lane.table.approach)
        motion.runtime.begin_closing()
        if not self._approach(lane.joints(motion, -lane.past_m), self.settings.side_m_s):
            self.capture()  # only that there is nothing
            return np.empty((0, 3))
        if len(landed := self._landing_points(along, lane.frame)):
            self._lay_on(lane.table, lane.column, along, lane.frame, self.settings.rake_N, 0.0, lane.place.up_to_m)
        self.capture()
        return landed

    def _has_given_way(self, landed_m: Array) -> bool:
        """Whether what fingertips have met at these places, shape (n, 3), is not felt any more."""
        felt_N = max(self._motion.loads_N().values(), default=0.0)
        return len(landed_m) > 0 and felt_N < self._felt_N

    def _go_along(self, lane: Lane) -> bool:
        """Back a little, and over to another lane. Returns whether nothing was met there."""
        motion, cycle, back = self._motion, self._cycle, self._motion.runtime.perception.hand.base_q.copy()
        over = lane.joints(motion, _AWAY_m)
        back[:3] -= motion.runtime.world_T_mount.rotation().unrotate(_AWAY_m * lane.ahead)
        motion.move_base(back, *self._travel)
        motion.blend_fingers(lane.table, lane.column.progress, cycle.finger_rad_s, lane.column.aside(lane.table))
        motion.runtime.begin_closing()
        self.guard.restart()
        return motion.probe_base(over, self.settings.side_m_s, self.guard.is_met)

    def _meet_again(self, lane: Lane) -> None:
        """What a fingertip met on the way to another lane, of a handle perhaps, is felt: the hand has turned back from
        it. A link is not pressed against it.
        """
        s, motion, over = self.settings, self._motion, lane.joints(self._motion, _AWAY_m)
        back = motion.runtime.perception.hand.base_q.copy()
        motion.runtime.begin_closing()
        way = over[:3] - back[:3]
        along = motion.runtime.world_T_mount.rotation().rotate(way / np.linalg.norm(way))
        if self._approach(over, s.side_m_s) and LINKS not in self.guard.met:
            direction = np.asarray(lane.frame.pose.rotation().unrotate(along))
            self._lay_on(lane.table, lane.column, direction, lane.frame, s.alone_N, s.sink_m)
            self.capture()
        motion.move_base(back, *self._travel)

    def _rise_over(self, frame: GraspFrame, table: Closing, away_m: float) -> None:
        """Up to where the hand may travel."""
        above = self._motion.base_joints(frame, table, self._above_m(table), away_m)
        self._motion.climb(above, self._cycle.travel_m_s)

    def _above_m(self, table: Closing) -> float:
        """How far above its touch the hand may travel."""
        return travel_height_m(table, self._motion, self._cycle, self._hand)

    def _landing_points(self, direction_grasp: Array, frame: GraspFrame) -> Array:
        """The foremost points of the fingertips that touch something, shape (n, 3), world frame."""
        ahead = np.asarray(frame.pose.rotation().rotate(direction_grasp))
        met = [finger for finger, load_N in self._motion.loads_N().items() if load_N > self.settings.met_N / 2]
        surface = TipSurface.upright(self._hand.semi_axes_m, self._hand.centre_distal_m)
        frames = self._motion.runtime.perception.hand.world_T_distal
        return np.array([surface.leading_point(frames[f].matrix(), ahead) for f in met]).reshape(-1, 3)

    @property
    def _felt_N(self) -> float:
        """A fingertip that carries more feels something."""
        return self.settings.met_N / 4

    @property
    def _travel(self) -> tuple[float, float]:
        return self._cycle.travel_m_s, self._cycle.turn_rad_s

    def _poise(self, table: Closing, pattern: Pattern, frame: GraspFrame, away_m: float = 0.0) -> None:
        """Place the hand above a grasp frame, fingers arranged for the touch, and tare the sensors."""
        motion, cycle = self._motion, self._cycle
        above = motion.base_joints(frame, table, self._above_m(table), away_m)
        motion.climb(above, cycle.travel_m_s)
        motion.blend_fingers(table, pattern.progress, cycle.finger_rad_s, pattern.aside(table))
        motion.move_base(motion.unwound(above), *self._travel)
        motion.tare(cycle.rest_s)

    def _approach(self, goal: Array, speed_m_s: float, *, is_careful: bool = False) -> bool:
        """Move toward ``goal`` until the hand touches something; then the positioner stops."""
        motion = self._motion
        self.guard.restart()
        for q in motion.line(goal, speed_m_s, is_careful=is_careful):
            motion.set_base(q)
            motion.tick()
            if self.guard.is_met():
                motion.set_base(motion.runtime.perception.hand.base_q)
                return True
        return False

    def _lay_on(
        self,
        table: Closing,
        pattern: Pattern,
        direction_grasp: Array,
        frame: GraspFrame,
        force_N: float,
        sink_m: float,
        up_to_m: float = np.inf,
        leans: Callable[[], bool] | None = None,
    ) -> None:
        """Every fingertip moves along a direction until it has the contact force, or has reached its limit.

        At first it searches; once it has felt something it follows its force alone, lest it runs after what gives way.
        The hand sinks a little meanwhile, and fingers that touch yield: the thumb can hardly move in that direction
        itself. While a fingertip is pressed hard, or a link leans on something, the hand draws back; once a link has
        done so it sinks no more. Where only finding the object matters, only links that lean hard are heeded.
        """
        s, motion = self.settings, self._motion
        rates = motor_rates(table, pattern.progress, direction_grasp, self._hand)
        rates = {f: motors for f, motors in rates.items() if f in self.guard.met or self._height_m(f) <= up_to_m}
        force_N = force_N if len(rates) > 1 else max(force_N, s.alone_N)
        gone_m, found = dict.fromkeys(rates, 0.0), set(self.guard.met)
        leans = leans or self.guard.leans
        self.guard.keep_usual()
        start, sunk_m, has_leaned = motion.runtime.perception.hand.base_q.copy(), 0.0, False
        step_m = sink_m / motion.cycles(s.press_s)
        way = np.zeros(6)
        way[:3] = motion.runtime.world_T_mount.rotation().unrotate(frame.pose.rotation().rotate(direction_grasp))
        for _ in motion.shares(s.press_s + (_SUNK_s if sink_m else 0.0)):
            loads_N = motion.loads_N()
            has_leaned |= (is_leaning := leans())
            if is_leaning or max(loads_N.values(), default=0.0) >= s.most_N:
                sunk_m = max(sunk_m - step_m, -sink_m)
            elif not has_leaned:
                sunk_m = min(sunk_m + step_m, sink_m)
            motion.set_base(start + sunk_m * way)
            found |= {finger for finger, load_N in loads_N.items() if load_N > self._felt_N}
            found |= set(motion.bent(self._cycle.held_up_rad))
            for finger in rates.keys() & loads_N.keys():
                error_N = float(np.clip(force_N - loads_N[finger], -1.0, 1.0))
                moved_m = (s.gain * error_N if finger in found else s.search_m_s) * motion.cycle_s
                gone_m[finger] = float(np.clip(gone_m[finger] + moved_m, -s.reach_m, s.reach_m))
            aside = pattern.aside(table)
            for finger in rates.keys() - pattern.held_rad.keys():
                aside |= {motor: aside.get(motor, 0.0) + r * gone_m[finger] for motor, r in rates[finger].items()}
            motion.set_fingers(table, pattern.progress, aside)
            motion.tick()

    def _height_m(self, finger: str) -> float:
        return float(self._motion.tip_centre_world_m(finger, self._hand)[2])

    def capture(self) -> None:
        """Keep what the fingertips feel now for the next grasp."""
        motion = self._motion
        motion.runtime.begin_capture()
        motion.wait(self.settings.capture_s)
        motion.runtime.end_touch()
