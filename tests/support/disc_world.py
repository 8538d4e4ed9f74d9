"""A world without physics for the conductor: a disc on the table, and fingers that reach their targets at once.

Contact forces follow from penetration: 500 N/m. A held disc moves with the palm; a released one stays.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass

import numpy as np
from gtsam import Pose3

from drivers.core.clock import VirtualClock
from drivers.core.contacts import FINGERS, Array, Grasp
from drivers.core.fingertip import TipContact
from drivers.positioner.positioner import mount_T_forearm
from drivers.shadow.model.kinematics import JOINT_INDEX, JOINTS
from sessions.perception.event_outcomes import TareReport, Undone
from sessions.perception.perception import Perception
from sessions.recording.recorder import Level, NullRecorder
from sessions.recording.session_events import EventKind, SessionEvent
from sessions.rig_runtime.flight_recorder import CycleSnapshot

CYCLE_ns = 10_000_000
TIP_RADIUS_m, TIP_CENTRE_m = 0.0085, np.array([0.0, 0.0, 0.019])
STIFFNESS_N_m = 500.0
HIGH_ABOVE = np.array([-0.35, 0.0, 0.45, 0.0, 0.0, 0.0])


@dataclass
class Disc:
    """An upright disc: centre on the table (2,), radius, height, and its rotation while carried."""

    centre_m: Array
    radius_m: float = 0.035
    height_m: float = 0.04


@dataclass(frozen=True)
class Reading:
    """A sample of the hand."""

    stamp_ns: int
    joints_rad: Array
    fresh: bool = True


@dataclass(frozen=True)
class BaseState:
    """A sample of the positioner."""

    stamp_ns: int
    q: Array


class DiscTip:
    """A fingertip that measures the contact with the disc."""

    def __init__(self, finger: str, world: DiscWorld) -> None:
        self.finger, self._world = finger, world
        self.tares = 0

    def update(self, samples: object) -> None:
        """Do nothing: the world already has the state."""

    def tare(self, world_R_distal: Array, *, reason: str = "") -> None:
        self.tares += 1

    def load_N(self, world_R_distal: Array) -> float:
        return self._world.load_N(self.finger)

    def void(self) -> str:
        return ""

    def begin_capture(self) -> None:
        """Do nothing: no samples are averaged."""

    def contact(self, world_R_distal: Array) -> TipContact | None:
        load_N = self._world.load_N(self.finger)
        if load_N < 0.05:
            return None
        outward = self._world.outward(self.finger)
        point_m = TIP_CENTRE_m - world_R_distal.T @ outward * TIP_RADIUS_m
        normal = world_R_distal.T @ outward
        return TipContact(point_m, normal, 1e-6 * np.eye(3), 0.05, load_N, 0.0)

    def health(self) -> tuple[str, ...]:
        return ()


class Mover:
    """The hand or the positioner: takes targets, and counts stops and resumes."""

    def __init__(self, take: Callable[[object], None]) -> None:
        self._take, self.stops, self.resumes = take, 0, 0

    def set_targets(self, targets_rad: Mapping[str, float]) -> None:
        self._take(targets_rad)

    def set_target(self, q: Array) -> None:
        self._take(q)

    def stop(self) -> None:
        self.stops += 1

    def resume(self) -> None:
        self.resumes += 1


class DiscWorld:
    """Has the interface of a rig runtime, for the conductor.

    Args:
        disc: the object; None for an empty table.
        before_cycle: called before every cycle, to make things go wrong.
    """

    def __init__(self, disc: Disc | None, before_cycle: Callable[[DiscWorld], None] | None = None) -> None:
        self.stop_reports: list[tuple[str, int]] = []
        self.disc, self.before_cycle = disc, before_cycle
        self.clock, self.cycle_ns = VirtualClock(), CYCLE_ns
        self.hand, self.base = Mover(self._move_fingers), Mover(self._move_base)
        self.camera, self.fingertip_calibrations = None, {}
        self.recorder = NullRecorder()
        self.session_events: list[EventKind] = []
        self.log_lines: list[tuple[Level, str]] = []
        self.world_T_mount = Pose3()
        self.joints_rad, self.base_q = np.zeros(len(JOINTS)), HIGH_ABOVE.copy()
        self.silent, self.cycles = False, 0
        self.is_led, self.times_led, self.led_at_capture = False, 0, False
        self._held_from: Pose3 | None = None
        self.perception = Perception(
            wrench_fingertips={finger: DiscTip(finger, self) for finger in FINGERS},
            mount_T_forearm=mount_T_forearm,
            world_T_mount=self.world_T_mount,
        )
        self.cycle()

    # --- motion --------------------------------------------------------------------------------------------

    def _move_fingers(self, targets_rad: object) -> None:
        assert isinstance(targets_rad, dict)
        for name, angle in targets_rad.items():
            if name.endswith("J0"):
                self.joints_rad[JOINT_INDEX[f"{name[:2]}J1"]] = 0.375 * angle
                self.joints_rad[JOINT_INDEX[f"{name[:2]}J2"]] = 0.625 * angle
            else:
                self.joints_rad[JOINT_INDEX[name]] = angle

    def _move_base(self, q: object) -> None:
        self.base_q = np.asarray(q, dtype=float)

    def cycle(self) -> None:
        if self.before_cycle is not None:
            self.before_cycle(self)
        self.cycles += 1
        now_ns = self.clock.now_ns()
        if not self.silent:
            self.perception.on_hand(Reading(now_ns, self.joints_rad.copy()))
        self.perception.on_base(BaseState(now_ns, self.base_q.copy()))
        self._carry()
        self.clock.sleep_until_ns(now_ns + CYCLE_ns)

    def _carry(self) -> None:
        if self._held_from is None or self.disc is None:
            return
        palm = self.perception.hand.world_T_palm
        motion = palm * self._held_from.inverse()
        self.disc.centre_m = np.asarray(motion.transformFrom(np.array([*self.disc.centre_m, 0.0])))[:2]
        self._held_from = palm

    # --- contact ------------------------------------------------------------------------------------------

    def _tip_m(self, finger: str) -> Array:
        # Asked for at every cycle: the perception's own way makes the poses of all five fingers for each of them.
        frame = self.perception.hand.current().world_T_distal[FINGERS.index(finger)]
        return np.asarray(frame[:3, :3] @ TIP_CENTRE_m + frame[:3, 3])

    def outward(self, finger: str) -> Array:
        """Direction out of the disc toward a tip, world frame, shape (3,)."""
        assert self.disc is not None
        aside_m, above_m = self._depths_m(finger)
        if above_m < aside_m:
            return np.array([0.0, 0.0, 1.0])
        away = self._tip_m(finger)[:2] - self.disc.centre_m
        return np.array([*(away / np.linalg.norm(away)), 0.0])

    def load_N(self, finger: str) -> float:
        """Contact force of a tip."""
        if self.disc is None:
            return 0.0
        return STIFFNESS_N_m * max(0.0, min(self._depths_m(finger)))

    def _depths_m(self, finger: str) -> tuple[float, float]:
        """Penetration of a tip into the disc: from the side, and from the top."""
        assert self.disc is not None
        tip_m = self._tip_m(finger)
        aside_m = self.disc.radius_m + TIP_RADIUS_m - math.dist(tip_m[:2], self.disc.centre_m)
        return aside_m, self.disc.height_m + TIP_RADIUS_m - float(tip_m[2])

    # --- session events
    # -------------------------------------------------------------------------------------------------

    def _mark(self, kind: EventKind, fingers: tuple[str, ...] = FINGERS) -> object:
        self.session_events.append(kind)
        return self.perception.event(SessionEvent(kind, self.clock.now_ns(), fingers))

    def tare(self, fingers: Iterable[str] = FINGERS) -> TareReport:
        report = self._mark(EventKind.TARE, tuple(fingers))
        assert isinstance(report, TareReport)
        return report

    def begin_closing(self) -> None:
        self._mark(EventKind.CLOSE_BEGIN)

    def begin_capture(self) -> None:
        self.led_at_capture |= self.is_led
        self._mark(EventKind.CAPTURE_BEGIN)

    def end_capture(self) -> Grasp:
        grasp = self._mark(EventKind.CAPTURE_END)
        assert isinstance(grasp, Grasp)
        return grasp

    def end_touch(self) -> None:
        self._mark(EventKind.TOUCH_END)

    def note_object_moved(self, *, fell: bool) -> None:
        self._mark(EventKind.OBJECT_FELL if fell else EventKind.OBJECT_MOVED)

    def begin_hold(self) -> None:
        self._mark(EventKind.HOLD_BEGIN)
        self._held_from = self.perception.hand.world_T_palm

    def end_hold(self) -> None:
        self._mark(EventKind.HOLD_END)
        self._held_from = None

    def truth_frame(self, cycle: Callable[[], None] | None = None) -> None:
        self._mark(EventKind.TRUTH_FRAME)

    def undo(self) -> Undone:
        undone = self._mark(EventKind.UNDO)
        assert isinstance(undone, Undone)
        return undone

    def resume(self) -> None:
        self.hand.resume()
        self.base.resume()

    def stop(self) -> None:
        self.is_led = False
        self.hand.stop()
        self.base.stop()

    def lead_by_hand(self) -> None:
        self.stop()
        self.is_led, self.times_led = True, self.times_led + 1

    def snapshot(self) -> CycleSnapshot:
        seen = self.perception
        return CycleSnapshot(self.clock.now_ns(), seen.hand_stamp_ns, seen.loads_N(), seen.hand.palm_world_m)

    def report_stop(self, cause: str, cycles: list[dict[str, object]]) -> None:
        self.stop_reports.append((cause, len(cycles)))

    def log(self, level: Level, source: str, message: str) -> None:
        self.log_lines.append((level, message))

    @property
    def event_counts(self) -> Counter[EventKind]:
        """How often each kind of session event was recorded."""
        return Counter(self.session_events)
