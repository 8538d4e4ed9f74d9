"""The rig runtime: the connected devices of a rig, run in one common cycle.

A cycle exchanges data with the hand and the positioner, reads the fingertips' transports and waits for the next
deadline. Deadlines lie on a fixed grid, so that a slow cycle does not shift later ones. What the devices received
reaches :class:`Perception` through the taps of their transports (see :mod:`sessions.perception.interpreter`), before
the devices decode it for their own control.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from typing import Any

from gtsam import Pose3

from drivers.core.clock import NANOSECONDS, Clock
from drivers.core.contacts import FINGERS, Grasp
from drivers.core.errors import DeviceError, SessionError, TactileLabError
from drivers.core.fingertip import FingertipCalibration, FingertipSensor
from drivers.positioner.kinds import LedPositioner
from sessions.perception.event_outcomes import Outcome, TareReport, TruthFrame, Undone
from sessions.perception.instruments import (
    BaseInstrument,
    CameraInstrument,
    CyclingInstrument,
    FrameReading,
    HandInstrument,
    NamedInstrument,
    PolledInstrument,
    WatchingCamera,
    motor_torques,
    warmest_C,
)
from sessions.perception.interpreter import HAND_LINK, Observer, fingertip_link
from sessions.perception.perception import Perception
from sessions.perception.weighing.weighing import Dragging, Hanging
from sessions.recording.recorder import Level, Recorder
from sessions.recording.session_events import EventKind, SessionEvent
from sessions.rig_runtime.cycle_timing import CycleCounts, CycleTiming
from sessions.rig_runtime.device_losses import DeviceLosses
from sessions.rig_runtime.flight_recorder import CycleSnapshot
from sessions.rig_runtime.instrument_set import InstrumentSet
from sessions.rig_runtime.state_recording import StateRecording, TruthReading

READY_TIMEOUT_ns = 2 * NANOSECONDS
"""How long the hand and the positioner may take to answer after connecting."""


class RigRuntime:
    """The devices of a rig.

    Args:
        clock: the session's clock.
        cycle_ns: period of the common cycle.
        hand, base, camera: live devices on tapped transports.
        wrench_devices: live devices of the fingertips' own transports, by finger (see :class:`SensorStream`).
        observer: the tap of all those transports; it has the Perception and the recorder.
        fingertip_calibrations: by finger.
        truth: the truth channel of a simulated rig; used only by the recorder.
        force_ranges_N: calibrated range of the fingertips' sensors, smallest axis, by finger.
    """

    def __init__(
        self,
        *,
        clock: Clock,
        cycle_ns: int,
        hand: HandInstrument,
        base: BaseInstrument,
        observer: Observer,
        wrench_devices: Mapping[str, PolledInstrument] | None = None,
        camera: CameraInstrument | None = None,
        fingertip_calibrations: Mapping[str, FingertipCalibration] | None = None,
        truth: Callable[[], TruthReading] | None = None,
        force_ranges_N: Mapping[str, float] | None = None,
    ) -> None:
        self.clock, self.cycle_ns = clock, cycle_ns
        self.hand, self.base, self.camera = hand, base, camera
        self._watching = camera if isinstance(camera, WatchingCamera) else None  # looked up once, not in every cycle
        self.wrench_devices = dict(wrench_devices or {})
        self.fingertip_calibrations = dict(fingertip_calibrations or {})
        self._timing = CycleTiming(clock, cycle_ns)
        self._devices = InstrumentSet(hand, base, self.wrench_devices, camera)
        self._losses = DeviceLosses(observer.interpreter, hand)
        self._state = StateRecording(observer, clock, truth, self._devices, self._losses)
        self.observer = observer
        self._force_ranges_N = dict(force_ranges_N or {})

    @property
    def perception(self) -> Perception:
        """The state of the hand and its grasps."""
        return self.observer.interpreter.perception

    @property
    def recorder(self) -> Recorder:
        """The recorder."""
        return self.observer.recorder

    @property
    def fingertips(self) -> dict[str, FingertipSensor]:
        """The fingertip sensors, by finger."""
        return self.perception.fingertips

    @property
    def world_T_mount(self) -> Pose3:
        """The forearm-to-world calibration."""
        return self.perception.world_T_mount

    @property
    def losses(self) -> Mapping[str, int]:
        """Data losses by kind and transport; complete once the rig runtime is closed."""
        return self._losses.counts()

    @property
    def counts(self) -> CycleCounts:
        """Cycles so far, and those that were late."""
        return self._timing.counts

    def report_problems_to(self, listener: Callable[[str], None]) -> None:
        """Problems of devices are recorded, and from now on also passed to ``listener``, once each."""
        self._state.watch.listener = listener

    # --- lifecycle ---------------------------------------------------------------------------------------------

    def connect(self) -> None:
        """Connect every device and run cycles until the hand and the positioner have answered.

        If anything fails, everything is closed again. Raises DeviceError.
        """
        try:
            self._devices.connect()
            self._await_first_samples()
            if isinstance(self.hand, CyclingInstrument):
                self.log(Level.INFO, "hand", self.hand.description())
            if isinstance(self.base, NamedInstrument) and self.base.identity:
                self.log(Level.INFO, "base", self.base.identity)
        except BaseException as error:
            for problem in self._close_all():
                error.add_note(f"while closing again: {problem}")
            raise

    def close(self) -> None:
        """Stop and close every device, even if another fails; idempotent. Raises the first error."""
        self.stop()
        try:
            self._state.conclude()
        finally:
            problems = self._close_all()
        if problems:
            raise problems[0]

    def stop(self) -> None:
        """Stop all motion: zero demands to the hand, the positioner holds. Never raises."""
        self.hand.stop()
        self.base.stop()

    def lead_by_hand(self) -> None:
        """Zero demands to the hand, and a positioner that can be led is let go, until :meth:`stop` or a resume."""
        self.stop()
        if isinstance(self.base, LedPositioner):
            self.base.lead_by_hand()

    def restart_fingertip(self, finger: str) -> None:
        """Restart the sensor of a fingertip with its own transport. Raises DeviceError."""
        if device := self.wrench_devices.get(finger):
            device.close()
            device.connect()

    def resume(self) -> None:
        """Allow motion again after :meth:`stop`; nothing moves before new targets are set."""
        self.hand.resume()
        self.base.resume()

    def _await_first_samples(self) -> None:
        give_up_ns = self.clock.now_ns() + READY_TIMEOUT_ns
        while not self.perception.hand.ready:
            if self.clock.now_ns() > give_up_ns:
                what = f"no sample from the hand or the positioner within {READY_TIMEOUT_ns / NANOSECONDS:g} s"
                raise DeviceError(what, where="rig runtime", hint="Check power and cables, then try again")
            self.cycle()

    def _close_all(self) -> list[TactileLabError]:
        self.stop()
        self._timing.restart()
        return self._devices.close()

    # --- the cycle ---------------------------------------------------------------------------------------------

    def cycle(self) -> None:
        """Run one cycle over all devices and wait for the next deadline.

        Raises:
            DeviceError: a device failed; if the session itself was late before, it says so too.
        """
        self._timing.begin()
        try:
            self._exchange()
        except DeviceError as error:
            if not (late := self._timing.lateness()):
                raise
            hint = f"{late}. {error.hint}" if error.hint else late
            raise type(error)(error.what, where=error.where, hint=hint) from error
        self._state.record()
        self._timing.wait()

    def _exchange(self) -> None:
        self.hand.exchange()
        self.base.exchange()
        for device in self.wrench_devices.values():
            device.poll()
        if self._watching is not None:
            self._watching.poll()

    def snapshot(self) -> CycleSnapshot:
        """The last cycle as the safety supervisor sees it."""
        seen, newest = self.perception, self.observer.interpreter.newest
        tips = {finger: newest.get(fingertip_link(finger)) for finger in self.wrench_devices}
        hand = newest.get(HAND_LINK)
        return CycleSnapshot(
            stamp_ns=self._timing.begun_ns,
            hand_stamp_ns=seen.hand_stamp_ns,
            loads_N=seen.loads_N(),
            palm_world_m=seen.hand.palm_world_m,
            tip_stamps_ns={finger: None if heard is None else heard.stamp_ns for finger, heard in tips.items()},
            force_ranges_N=self._force_ranges_N,
            warmest_C=None if hand is None else warmest_C(hand.sample),
            void_tips=seen.void_tips(),
            motor_torques=None if hand is None else motor_torques(hand.sample),
        )

    def run(self, duration_ns: int) -> None:
        """Run cycles for a time, at least one."""
        end_ns = self.clock.now_ns() + duration_ns
        self.cycle()
        while self.clock.now_ns() < end_ns:
            self.cycle()

    # --- session events ----------------------------------------------------------------------------------------

    def tare(self, fingers: Iterable[str] = FINGERS) -> TareReport:
        """Tare the named, untouched fingertips; refusals are reported and recorded as warnings."""
        report = self._record_event(EventKind.TARE, tuple(fingers))
        assert isinstance(report, TareReport)
        for finger, reason in report.refused.items():
            self.log(Level.WARNING, finger, reason)
        return report

    def begin_closing(self) -> None:
        """The open hand is around the object; from now on the fingers close."""
        self._record_event(EventKind.CLOSE_BEGIN)

    def begin_capture(self) -> None:
        """Collect samples from now on."""
        self._record_event(EventKind.CAPTURE_BEGIN)

    def end_capture(self) -> Grasp:
        """Compute a grasp from the samples since :meth:`begin_capture`."""
        grasp = self._record_event(EventKind.CAPTURE_END)
        assert isinstance(grasp, Grasp)
        self.recorder.grasp(self.clock.now_ns(), grasp, self.perception.touches.dropped)
        self._state.record_truth()
        return grasp

    def end_touch(self) -> None:
        """Keep the contacts of the samples since :meth:`begin_capture` for the next grasp."""
        self._record_event(EventKind.TOUCH_END)

    def note_object_moved(self, *, fell: bool) -> None:
        """The object was found again: pushed aside, or fallen over."""
        self._record_event(EventKind.OBJECT_FELL if fell else EventKind.OBJECT_MOVED)

    def begin_hold(self) -> None:
        """From now on the object moves with the palm."""
        self._record_event(EventKind.HOLD_BEGIN)

    def end_hold(self) -> None:
        """From now on the object stays in place."""
        self._record_event(EventKind.HOLD_END)

    def begin_dragging(self) -> None:
        """From now on the held object is dragged to and fro over the table."""
        self._record_event(EventKind.DRAG_BEGIN)

    def end_dragging(self) -> Dragging | None:
        """Compute the table's friction; None if the fingertips measured nothing."""
        found = self._record_event(EventKind.DRAG_END)
        assert found is None or isinstance(found, Dragging)
        return found

    def begin_hanging(self) -> None:
        """From now on the lifted object is shifted to and fro."""
        self._record_event(EventKind.HANG_BEGIN)

    def end_hanging(self) -> Hanging | None:
        """Compute the object's weight; None if the fingertips measured nothing."""
        found = self._record_event(EventKind.HANG_END)
        assert found is None or isinstance(found, Hanging)
        return found

    def picture(self, cycle: Callable[[], None] | None = None) -> FrameReading:
        """Take a picture; cycles continue until it arrives.

        Args:
            cycle: runs one cycle, for supervised callers; default :meth:`cycle`.

        Raises:
            DeviceError: there is no camera, or it gave no picture.
        """
        if self.camera is None:
            raise DeviceError("the rig has no camera", where="camera")
        self.camera.ask()
        while (frame := self.camera.take_picture()) is None:
            (cycle or self.cycle)()
        return frame

    def truth_frame(self, cycle: Callable[[], None] | None = None) -> TruthFrame | None:
        """Take a picture that shows the object of the current grasp at rest; None without a camera.

        Args:
            cycle: see :meth:`picture`.

        Raises:
            DeviceError: the camera gave no picture.
        """
        if self.camera is None:
            return None
        self.picture(cycle)
        outcome = self._record_event(EventKind.TRUTH_FRAME)
        if not isinstance(outcome, TruthFrame):
            raise DeviceError("the picture cannot be read", where="camera", hint="Check the camera's link")
        self._state.record_truth()
        return outcome

    def undo(self) -> Undone:
        """Undo the last grasp. Raises SessionError if there is none."""
        undone = self._record_event(EventKind.UNDO)
        assert isinstance(undone, Undone)
        return undone

    def report_stop(self, cause: str, cycles: list[dict[str, Any]]) -> None:
        """Record why everything was stopped, with the last cycles. Raises SessionError."""
        self.recorder.safety_stop(self.clock.now_ns(), cause, cycles)
        self.log(Level.ERROR, "safety", f"stopped: {cause}")

    def log(self, level: Level, source: str, message: str) -> None:
        """Record a log entry for people."""
        self.recorder.log(self.clock.now_ns(), level, source, message)

    def _record_event(self, kind: EventKind, fingers: tuple[str, ...] = FINGERS) -> Outcome | None:
        if unknown := set(fingers) - set(FINGERS):
            raise SessionError(f"no finger called {', '.join(sorted(unknown))}", hint=f"Fingers: {', '.join(FINGERS)}")
        return self.observer.event(SessionEvent(kind, self.clock.now_ns(), fingers))
