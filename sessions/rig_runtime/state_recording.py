"""Records the state of a running session for viewers: joints, loads, frames, truth."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from typing import Protocol

from gtsam import Pose3

from drivers.core.clock import Clock
from drivers.core.contacts import Contact
from drivers.shadow.model.kinematics import JOINTS
from sessions.perception.fingertip_samples import record_fingertips
from sessions.perception.interpreter import Observer
from sessions.recording.recorder import Level
from sessions.rig_runtime.device_losses import DeviceLosses
from sessions.rig_runtime.health_watch import HealthWatch
from sessions.rig_runtime.instrument_set import InstrumentSet

BASE_JOINTS = ("x_m", "y_m", "z_m", "yaw_rad", "pitch_rad", "roll_rad")


class TruthReading(Protocol):
    """Data of the truth channel of a simulated rig."""

    @property
    def world_T_object(self) -> Pose3: ...
    @property
    def contacts(self) -> Iterable[Contact] | None: ...


class StateRecording:
    """Records the hand's state at the recorder's rate, together with the truth.

    Args:
        observer: has recorder and Perception.
        clock: the session's.
        truth: the truth channel of a simulated rig.
        devices: report their problems.
        losses: their data losses; updated here.

    Attributes:
        watch: reports problems of devices and fingertips.
    """

    def __init__(
        self,
        observer: Observer,
        clock: Clock,
        truth: Callable[[], TruthReading] | None,
        devices: InstrumentSet,
        losses: DeviceLosses,
    ) -> None:
        self._observer, self._clock, self._truth = observer, clock, truth
        self._devices, self._losses = devices, losses
        self.watch = HealthWatch(self._warn)

    def record(self) -> None:
        """Record everything that is due. Raises SessionError."""
        now_ns, recorder, seen = self._clock.now_ns(), self._observer.recorder, self._observer.interpreter.perception
        if not (seen.hand.ready and recorder.state_due(now_ns)):
            return
        joints = dict(zip(JOINTS, seen.hand.joints_rad.tolist(), strict=True))
        recorder.joints(now_ns, joints, dict(zip(BASE_JOINTS, seen.hand.base_q.tolist(), strict=True)))
        recorder.loads(now_ns, seen.loads_N())
        record_fingertips(recorder, now_ns, seen.fingertips)
        recorder.frames(now_ns, {"palm": seen.hand.world_T_palm, **seen.hand.world_T_distal})
        self.record_truth()
        self._losses.look()
        self.watch.look([*self._devices.problems(), *self._losses.problems(), *seen.problems()])

    def record_truth(self) -> None:
        """The object's true pose, on a simulated rig. Raises SessionError."""
        if self._truth is not None:
            reading = self._truth()
            self._observer.recorder.truth(self._clock.now_ns(), reading.world_T_object, reading.contacts)

    def conclude(self) -> None:
        """Record the problems of the devices with their final counts. Raises SessionError."""
        self._losses.conclude()
        if not self._observer.recorder.broken:
            tips = self._observer.interpreter.perception.problems()
            self.watch.conclude([*self._devices.problems(ask=True), *tips])

    def _warn(self, device: str, words: str) -> None:
        self._observer.recorder.log(self._clock.now_ns(), Level.WARNING, device, words)
