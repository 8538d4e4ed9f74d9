"""Motion: moves the hand and the positioner along paths, one supervised cycle of the rig runtime at a time.

Nothing else in a session moves anything. Every cycle goes through :meth:`Motion.tick`, where the safety supervisor
checks it; so no step of the grasp cycle can be unsupervised.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from functools import cached_property

import numpy as np
from gtsam import Pose3, Rot3

from drivers.core.clock import NANOSECONDS
from drivers.core.contacts import Array, Grasp
from drivers.positioner.positioner import mount_joints
from drivers.shadow.closing.closing import Closing
from drivers.shadow.closing.posture import TipEllipsoid
from drivers.shadow.model.hand_form import HandForm
from sessions.motion.base_path import STRAIGHT_WRIST, base_path
from sessions.motion.finger_targets import FingerTargets
from sessions.motion.grasp_frame import GraspFrame
from sessions.motion.safety import SafetySupervisor
from sessions.recording.recorder import Level
from sessions.rig_runtime.rig_runtime import RigRuntime

_TARES = 5  # a fingertip that still swings is given so many rests
_WITHDRAW_s = 0.15  # a positioner follows its targets late: back by more than it is behind
_LEVEL_m = 0.001


class Motion:
    """Moves hand and positioner together.

    Args:
        runtime: connected before anything moves.
        supervisor: checks every cycle.
    """

    def __init__(self, runtime: RigRuntime, supervisor: SafetySupervisor) -> None:
        self.runtime, self.supervisor = runtime, supervisor
        self._fingers = FingerTargets(runtime)
        self._loads_N: dict[str, float] = {}
        self._resting_N: dict[str, float] = {}
        self.motor_torques: Array | None = None
        """Newest strain-gauge counts of the motors, shape (20,); None if the hand reports none."""
        self.hand_stamp_ns: int | None = None
        """When the newest status of the hand arrived, session clock; None before the first."""
        self.tallest_m: float | None = None
        """Height over the table of whatever may stand there: the hand travels above it. None where it is not known."""

    @cached_property
    def _base_q(self) -> Array:
        """The positioner's last target, shape (6,); before the first one, its position."""
        return self.runtime.perception.hand.base_q.copy()

    @property
    def form(self) -> HandForm:
        """Which hand moves."""
        return self.runtime.perception.form

    # --- time --------------------------------------------------------------------------------------------------

    @property
    def cycle_s(self) -> float:
        """Length of a cycle."""
        return self.runtime.cycle_ns / NANOSECONDS

    def tick(self) -> None:
        """One cycle, checked by the supervisor; more cycles while the hand's link is lost, until it recovers.

        So no motion continues along its path while the hand cannot follow.

        Raises:
            SafetyError: a limit is exceeded.
            DeviceError: a device failed.
        """
        self._watched_cycle()
        if self.supervisor.hand_is_silent:
            self._await_hand()

    def _await_hand(self) -> None:
        self._log("the hand is silent: motion waits until it answers")
        began_ns = self.runtime.clock.now_ns()
        while self.supervisor.hand_is_silent:
            self._watched_cycle()
        waited_s = (self.runtime.clock.now_ns() - began_ns) / NANOSECONDS
        self._log(f"the hand answers again after {waited_s:.1f} s: the session continues")

    def _log(self, words: str) -> None:
        self.runtime.log(Level.WARNING, "hand", words)

    def _watched_cycle(self) -> None:
        self.runtime.cycle()
        snapshot = self.runtime.snapshot()
        self._loads_N = dict(snapshot.loads_N)
        self.motor_torques, self.hand_stamp_ns = snapshot.motor_torques, snapshot.hand_stamp_ns
        self.supervisor.check(snapshot)

    def wait(self, duration_s: float) -> None:
        """Run cycles for a time."""
        for _ in range(self.cycles(duration_s)):
            self.tick()

    def tare(self, rest_s: float, fingers: Sequence[str] | None = None, tries: int = _TARES) -> Mapping[str, str]:
        """Rest, and tare the fingertips; retry if a fingertip refuses because the hand still moves.

        The reading of a fingertip that keeps refusing is subtracted from now on: see :meth:`loads_N`. All are meant
        where ``fingers`` is not given.

        Returns:
            The reasons of those that kept refusing, by finger.
        """
        self._resting_N, refused = {}, dict[str, str]()
        for _ in range(tries):
            self.wait(rest_s)
            if not (refused := dict(self.runtime.tare(self.form.fingers if fingers is None else fingers).refused)):
                break
        self._resting_N = {finger: self._loads_N[finger] for finger in refused}
        return refused

    def capture(self, seconds: float) -> Grasp:
        """Collect samples for a time, compute a grasp from them, and take a picture of the held object."""
        self.runtime.begin_capture()
        self.wait(seconds)
        grasp = self.runtime.end_capture()
        self.runtime.truth_frame(self.tick)
        return grasp

    def cycles(self, duration_s: float) -> int:
        """Whole cycles in a duration, at least one."""
        return max(1, round(duration_s / self.cycle_s))

    def shares(self, duration_s: float, *, is_careful: bool = False) -> Iterator[float]:
        """The progress of a motion in each of its cycles, up to 1; slower while motions must be slow.

        Args:
            duration_s: at full speed.
            is_careful: its speed was chosen for a first touch, so that the first approach does not slow it down.
        """
        count = self.path_cycles(duration_s, is_careful=is_careful)
        for step in range(1, count + 1):
            yield step / count

    def path_cycles(self, duration_s: float, *, is_careful: bool = False) -> int:
        """In how many cycles :meth:`shares` goes through a motion."""
        supervisor = self.supervisor
        return self.cycles(duration_s / (supervisor.careful_scale if is_careful else supervisor.speed_scale))

    # --- the positioner ----------------------------------------------------------------------------------------

    def base_joints(self, grasp: GraspFrame, closing: Closing, above_m: float = 0.0, away_m: float = 0.0) -> Array:
        """Positioner joints that put the palm where a closing at a grasp frame has it, wrist straight.

        Args:
            grasp: the grasp frame.
            closing: the hand's posture.
            above_m: so far above it.
            away_m: so far back along the closing's approach.

        Returns:
            Shape (6,), metres and radians, near the present yaw.
        """
        raised = Pose3(Rot3(), np.array([0.0, 0.0, above_m]))
        back = Pose3(Rot3(), -away_m * np.array(closing.approach))
        world_T_palm = raised * grasp.pose * back * closing.grasp_T_palm
        mount_T_forearm = self.runtime.world_T_mount.inverse() * world_T_palm * STRAIGHT_WRIST.inverse()
        return np.asarray(mount_joints(mount_T_forearm, float(self._base_q[3])))

    def unwound(self, q: Array) -> Array:
        """The same place, shape (6,), with a yaw of three quarters of a turn at most, for a way at travel height.

        Every yaw is the nearest of all equal ones, and a hand that goes around an object again and again would turn on
        until the axis ends. Where it may turn all around, and holds nothing, it turns back.
        """
        middle = float(np.clip(self._base_q[3], -np.pi / 2, np.pi / 2))
        back = np.zeros(len(q))
        back[3] = 2 * np.pi * np.round((q[3] - middle) / (2 * np.pi))
        return np.asarray(q - back)

    def set_base(self, q: Array) -> None:
        """New positioner target, shape (6,), metres and radians."""
        self._base_q = np.asarray(q, dtype=float)
        self.runtime.base.set_target(self._base_q)

    def move_base(self, q: Array, speed_m_s: float, turn_rad_s: float) -> None:
        """Smooth move of the positioner to joints ``q``, shape (6,), limited by both speeds (:func:`base_path`)."""
        path = base_path(self._base_q, q, self._is_in_workspace)
        for share in self.shares(self._base_time_s(q, speed_m_s, turn_rad_s)):
            self.set_base(path(smooth(share)))
            self.tick()

    def _is_in_workspace(self, palm_m: Array) -> bool:
        x_m, y_m, _ = self.runtime.world_T_mount.transformFrom(palm_m)
        return self.supervisor.is_well_inside(float(x_m), float(y_m))

    def rise(self, height_m: float, speed_m_s: float) -> None:
        """Move straight up from the positioner's last target."""
        self.move_base(self.raised(height_m), speed_m_s, np.inf)

    def raised(self, height_m: float) -> Array:
        """The positioner's last target, so much higher; shape (6,)."""
        q = self._base_q.copy()
        q[:3] += self.runtime.world_T_mount.rotation().unrotate(np.array([0.0, 0.0, height_m]))
        return q

    def climb(self, q: Array, speed_m_s: float, most_m: float = np.inf) -> None:
        """Straight up toward the height of ``q``, shape (6,), by ``most_m`` at most, if the positioner is lower."""
        up_m = self.runtime.world_T_mount.rotation().unrotate(np.array([0.0, 0.0, 1.0]))
        missing_m = min(float(up_m @ (q[:3] - self._base_q[:3])), most_m)
        if missing_m > _LEVEL_m:
            self.rise(missing_m, speed_m_s)

    def probe_base(self, q: Array, speed_m_s: float, met: Callable[[], bool]) -> bool:
        """Move toward ``q`` at constant speed, and turn back if something is touched.

        Args:
            q: target, shape (6,).
            speed_m_s: constant speed.
            met: asked after every cycle.

        Returns:
            Whether ``q`` was reached. If not, the positioner is moving back to its previous position.
        """
        start = self._base_q
        steps = [start + share * (q - start) for share in self.shares(self._base_time_s(q, speed_m_s, np.inf))]
        for count, step in enumerate(steps):
            self.set_base(step)
            self.tick()
            if met():
                self.set_base(steps[max(0, count - self.cycles(_WITHDRAW_s))])
                self.tick()
                return False
        return True

    def line(self, q: Array, speed_m_s: float, *, is_careful: bool = False) -> Iterator[Array]:
        """Targets at constant speed from the positioner's last target to ``q``, one per cycle; see :meth:`shares`."""
        start = self._base_q
        for share in self.shares(self._base_time_s(q, speed_m_s, np.inf), is_careful=is_careful):
            yield start + share * (q - start)

    def _base_time_s(self, q: Array, speed_m_s: float, turn_rad_s: float) -> float:
        travel_s = float(np.linalg.norm(q[:3] - self._base_q[:3])) / speed_m_s
        return max(travel_s, float(np.max(np.abs(q[3:] - self._base_q[3:]))) / turn_rad_s)

    def follow(self, pose_at: Callable[[float], Array], duration_s: float, each: Callable[[], bool]) -> float:
        """Move along positioner joints given as a function of smooth progress 0..1.

        Args:
            pose_at: the joints, shape (6,).
            duration_s: of the whole path.
            each: called before every cycle; returns whether to continue.

        Returns:
            The progress made.
        """
        made = 0.0
        for share in self.shares(duration_s):
            if not each():
                break
            made = smooth(share)
            self.set_base(pose_at(made))
            self.tick()
        return made

    # --- the fingers -------------------------------------------------------------------------------------------

    def set_fingers(
        self, closing: Closing, progress: Mapping[str, float], aside_rad: Mapping[str, float] | None = None
    ) -> None:
        """Set the fingers' targets by their progress on the closing's paths; the wrist stays straight.

        Args:
            closing: its paths.
            progress: of each finger.
            aside_rad: additional angles of single motors.
        """
        self.runtime.hand.set_targets(self._fingers.on(closing, progress, aside_rad or {}))

    def blend_fingers(
        self,
        closing: Closing,
        progress: Mapping[str, float],
        speed_rad_s: float,
        aside_rad: Mapping[str, float] | None = None,
    ) -> None:
        """Move from the present targets to those at ``progress``, straight in joint space."""
        start = self._fingers.present(closing, progress)
        self.set_fingers(closing, progress, aside_rad)
        end = self._fingers.targets_rad
        duration_s = max(abs(angle - start[name]) for name, angle in end.items()) / speed_rad_s
        for share in self.shares(duration_s):
            self.runtime.hand.set_targets({name: (1 - share) * start[name] + share * end[name] for name in end})
            self.tick()

    def finger_time_s(self, closing: Closing, progress: Mapping[str, float], speed_rad_s: float) -> float:
        """Time that the joint with the longest travel needs to reach the targets at ``progress``."""
        return self._fingers.travel_rad(closing, progress) / speed_rad_s

    def bent(self, least_rad: float) -> tuple[str, ...]:
        """Fingers with a joint farther off its target than this: something holds it, whether the fingertip measures it
        or not.
        """
        return self._fingers.bent(least_rad)

    def loads_N(self) -> dict[str, float]:
        """Contact force on each fingertip at the end of the last cycle, minus its reading at rest if it could not be
        tared.
        """
        return {finger: load_N - self._resting_N.get(finger, 0.0) for finger, load_N in self._loads_N.items()}

    def tip_centre_world_m(self, finger: str, tip: TipEllipsoid) -> Array:
        """Centre of a fingertip now, world frame, shape (3,)."""
        return np.asarray(
            self.runtime.perception.hand.world_T_distal[finger].transformFrom(np.array(tip.centre_distal_m))
        )


def smooth(share: float) -> float:
    """Progress with zero speed at both ends (cubic)."""
    return share * share * (3.0 - 2.0 * share)
