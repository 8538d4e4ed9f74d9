"""Touches without a grasp: a tap on the top, a probe from the side.

The hand takes up a posture of one of the closings, fingers partly closed, and the positioner carries it in a straight
line until something is touched; then as many fingertips as possible are laid on the object. The contacts are kept for
the next grasp (:attr:`~sessions.recording.session_events.EventKind.TOUCH_END`): the object has not moved since the
touch.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from drivers.core.contacts import Array
from drivers.shadow.closing.closing import Closing, closing, sideways
from drivers.shadow.closing.posture import HandShape
from drivers.shadow.closing.tip_motion import motor_rates
from sessions.motion.cycle_settings import CycleSettings, TouchSettings
from sessions.motion.grasp_frame import GraspFrame
from sessions.motion.guard import Guard
from sessions.motion.motion import Motion
from sessions.motion.probing.touch_patterns import COLUMN, ROW, TAP, Pattern, TAP_HEIGHT_m, lowest_ahead, lowest_touch_m
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


_DOWN, _BACK = np.array([0.0, 0.0, -1.0]), np.array([-1.0, 0.0, 0.0])


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

    @property
    def first_finger_side(self) -> float:
        """1 where the first finger is toward +y of the grasp frame, -1 on a left hand."""
        return -1.0 if self._hand.form.is_left else 1.0

    def expect_tallest(self, height_m: float) -> None:
        """From here on the hand travels above this height: nothing on the table is taller, as far as is known."""
        self._motion.tallest_m = height_m

    def on_top(self, height_m: float) -> None:
        """The top was looked for, and nothing taller found: the first approach has ended well."""
        self.expect_tallest(height_m)
        self._motion.supervisor.on_approach()

    def tap(self, frame: GraspFrame, below_top_m: float = np.inf) -> Array:
        """Come down on the object under a grasp frame, lay the fingertips on it, and rise again.

        Slowly from a little above the tallest thing that is known.

        Args:
            frame: the fingertips are around its origin.
            below_top_m: no farther down than this below the tallest thing that is known, and never onto the table.

        Returns:
            Where fingertips touched something, shape (n, 3), world frame: their contacts, which on a rim are higher
            than the fingertips reach down; without any, the fingertips' foremost places.
        """
        s, table, motion = self.settings, closing(TAP.closing, TAP_HEIGHT_m, self._hand), self._motion
        self._poise(table, TAP, frame)
        touching_m = self._hand.semi_axes_m[2] - TAP_HEIGHT_m
        top_m = top_at_most_m(motion)
        lowest_m = s.lowest_m if motion.tallest_m is None else max(s.lowest_m, top_m - below_top_m)
        near_m = max(lowest_m, top_m + s.near_m)
        motion.runtime.begin_closing()
        found = np.empty((0, 3))
        near, lowest = (motion.base_joints(frame, table, m + touching_m) for m in (near_m, lowest_m))
        known = len(motion.runtime.perception.probed)
        if self._approach(near, self._cycle.descent_m_s) or self._approach(lowest, s.tap_m_s, is_careful=True):
            motion.supervisor.on_approach()
            self._lay_on(table, TAP, _DOWN, frame, s.force_N, s.sink_m)
            found = self._landing_points(_DOWN, frame)
        self.capture()
        motion.rise(self._cycle.lift_m, self._cycle.travel_m_s)
        contacts = motion.runtime.perception.probed[known:]
        return np.array([contact.point_world_m for contact in contacts]) if contacts else found

    def touch_side(
        self,
        frame: GraspFrame,
        side: str,
        from_m: float,
        height_m: float | None = None,
        all_up_to_m: float = 0.0,
        beyond_m: float | None = None,
    ) -> SideTouch | None:
        """Come toward the middle of a grasp frame from its left or right, palm upright, fingers one above the other.

        Args:
            frame: fingers move along its y axis, over its origin and a little beyond.
            side: where the palm stands, one of :data:`~drivers.shadow.closing.closing.SIDES`.
            from_m: where the fingertips begin, counted from its origin.
            height_m: of the lowest fingertip; as low as the side allows unless given.
            all_up_to_m: fingertips up to this height are all laid against the side; above it only the one that met it:
                several push an object over that one leaves standing.
            beyond_m: how far over its origin; as the settings say unless given.

        Returns:
            What was touched, perhaps nothing; None where the hand could not come down.
        """
        s, motion = self.settings, self._motion
        height_m = height_m or lowest_touch_m(side, s.side_heights_m, self._hand)
        table = closing(sideways(COLUMN.closing, side), height_m, self._hand)
        lane, column = frame.shifted_inside(np.array([-s.row_m, 0.0])), lowest_ahead(table, self._hand, all_up_to_m)
        known, past_m = len(motion.runtime.perception.probed), s.beyond_m if beyond_m is None else beyond_m
        self._poise(table, column, lane, from_m)
        begin, end = (motion.base_joints(lane, table, 0.0, away_m) for away_m in (from_m, -past_m))
        self.guard.restart()
        if not motion.probe_base(begin, self._cycle.beside_m_s, self.guard.is_met):
            self._rise_over(lane, table, from_m)
            return None
        motion.tare(self._cycle.rest_s)
        motion.runtime.begin_closing()
        landed = np.empty((0, 3))
        if self._approach(end, s.side_m_s):
            landed = self._landing_points(np.array(table.approach), lane)
            self._lay_on(table, column, np.array(table.approach), lane, s.rake_N, 0.0, all_up_to_m)
            self.capture()
        motion.move_base(begin, *self._travel)
        self._rise_over(lane, table, from_m)
        if contacts := motion.runtime.perception.probed[known:]:
            points_m, normals = ([getattr(c, of) for c in contacts] for of in ("point_world_m", "normal_world"))
            return SideTouch(np.array(points_m), np.array(normals))
        against = -np.asarray(lane.pose.rotation().rotate(np.array(table.approach)))
        return SideTouch(landed, np.tile(against, (len(landed), 1)))

    def _rise_over(self, frame: GraspFrame, table: Closing, away_m: float) -> None:
        """Up to where the hand may travel."""
        above = self._motion.base_joints(frame, table, self._above_m(table), away_m)
        self._motion.climb(above, self._cycle.travel_m_s)

    def _above_m(self, table: Closing) -> float:
        """How far above its touch the hand may travel."""
        return travel_height_m(table, self._motion, self._cycle, self._hand)

    def rake(self, frame: GraspFrame, from_m: float) -> Array | None:
        """Come toward the middle of a grasp frame from its +x side, fingers in a row, until they touch something.

        Args:
            frame: fingers move along its -x axis, over its origin and as far beyond.
            from_m: their start, relative to its origin.

        Returns:
            Where fingertips touched something, shape (n, 3), world frame; None if they could not descend.
        """
        s, motion = self.settings, self._motion
        table = closing(ROW.closing, s.rake_height_m, self._hand)
        begin, end = (frame.shifted_inside(np.array([x - s.row_m, 0.0])) for x in (from_m, -s.beyond_m))
        self._poise(table, ROW, begin)
        self.guard.restart()
        if not motion.probe_base(motion.base_joints(begin, table), self._cycle.descent_m_s, self.guard.is_met):
            self._rise()
            return None
        motion.wait(self._cycle.rest_s)
        motion.runtime.begin_closing()
        found = np.empty((0, 3))
        if self._approach(motion.base_joints(end, table), s.rake_m_s):
            self._lay_on(table, ROW, _BACK, frame, s.rake_N, 0.0)
            found = self._landing_points(_BACK, frame)
            self.capture()
            motion.move_base(motion.base_joints(begin, table), *self._travel)
        self._rise()
        return found

    def close_thumb(self, frame: GraspFrame) -> Array | None:
        """Come down around a grasp frame, the hand open, and close only the thumb.

        Returns:
            Where the thumb touched something, or landed on it on the way down, shape (n, 3), world frame; None if
            another finger could not descend.
        """
        s, motion = self.settings, self._motion
        table = closing(ROW.closing, s.rake_height_m, self._hand)
        progress = {finger: table.path(finger).valid[0] for finger in table.fingers}
        self._poise(table, Pattern(ROW.closing, progress), frame)
        self.guard.restart()
        if not motion.probe_base(motion.base_joints(frame, table), self._cycle.descent_m_s, self.guard.is_met):
            stands = "TH" in self.guard.met
            met_m = motion.tip_centre_world_m("TH", self._hand)
            self._rise()
            return met_m[None] if stands else None
        motion.wait(self._cycle.rest_s)
        motion.runtime.begin_closing()
        path, found = table.path("TH"), np.empty((0, 3))
        while progress["TH"] < path.valid[1] and self._motion.loads_N().get("TH", 0.0) <= s.met_N:
            progress["TH"] += self._cycle.closing_m_s * motion.cycle_s / path.length_m
            motion.set_fingers(table, progress)
            motion.tick()
        if self._motion.loads_N().get("TH", 0.0) > s.met_N:
            motion.wait(self._cycle.rest_s)
            found = self._landing_points(path.direction, frame)
            self.capture()
        progress["TH"] = path.valid[0]
        motion.blend_fingers(table, progress, self._cycle.finger_rad_s)
        self._rise()
        return found

    def _rise(self) -> None:
        """Move straight up from the positioner's last target."""
        self._motion.rise(self._cycle.lift_m, self._cycle.travel_m_s)

    def _landing_points(self, direction_grasp: Array, frame: GraspFrame) -> Array:
        """The foremost points of the fingertips that touch something, shape (n, 3), world frame."""
        ahead = np.asarray(frame.pose.rotation().rotate(direction_grasp))
        met = [finger for finger, load_N in self._motion.loads_N().items() if load_N > self.settings.met_N / 2]
        surface = TipSurface.upright(self._hand.semi_axes_m, self._hand.centre_distal_m)
        frames = self._motion.runtime.perception.hand.world_T_distal
        return np.array([surface.leading_point(frames[f].matrix(), ahead) for f in met]).reshape(-1, 3)

    @property
    def _travel(self) -> tuple[float, float]:
        return self._cycle.travel_m_s, self._cycle.turn_rad_s

    def _poise(self, table: Closing, pattern: Pattern, frame: GraspFrame, away_m: float = 0.0) -> None:
        """Place the hand above a grasp frame, fingers arranged for the touch, and tare the sensors."""
        motion, cycle = self._motion, self._cycle
        above = motion.base_joints(frame, table, self._above_m(table), away_m)
        motion.climb(above, cycle.travel_m_s)
        motion.blend_fingers(table, pattern.progress, cycle.finger_rad_s, pattern.aside(table))
        motion.move_base(above, *self._travel)
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
    ) -> None:
        """Every fingertip moves along a direction until it has the contact force, or has reached its limit.

        The hand sinks a little meanwhile, and fingers that touch yield: the thumb can hardly move in that direction
        itself. While a fingertip is pressed hard the hand draws back.
        """
        s, motion = self.settings, self._motion
        rates = motor_rates(table, pattern.progress, direction_grasp, self._hand)
        rates = {f: motors for f, motors in rates.items() if f in self.guard.met or self._height_m(f) <= up_to_m}
        force_N = force_N if len(rates) > 1 else max(force_N, s.alone_N)
        gone_m = dict.fromkeys(rates, 0.0)
        start, sunk_m, step_m = (
            motion.runtime.perception.hand.base_q.copy(),
            0.0,
            2.0 * sink_m / motion.cycles(s.press_s),
        )
        way = np.zeros(6)
        way[:3] = motion.runtime.world_T_mount.rotation().unrotate(frame.pose.rotation().rotate(direction_grasp))
        for _ in motion.shares(s.press_s):
            is_pressed = max(motion.loads_N().values(), default=0.0) >= s.most_N
            sunk_m = float(np.clip(sunk_m + (-step_m if is_pressed else step_m), -sink_m, sink_m))
            motion.set_base(start + sunk_m * way)
            for finger, load_N in ((f, load_N) for f, load_N in self._motion.loads_N().items() if f in rates):
                moved_m = s.gain * float(np.clip(force_N - load_N, -1.0, 1.0)) * motion.cycle_s
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
