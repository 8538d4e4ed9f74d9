"""The state of a running session, recorded for whoever looks at it later: joints, loads, frames, truth."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from typing import Protocol

from gtsam import Pose3

from drivers.shadow.kinematics import JOINTS
from sessions.fingertip_samples import record_fingertips
from sessions.interpreter import Observer
from tactile_lab.clock import Clock
from tactile_lab.geometry.contacts import Contact

BASE_JOINTS = ("x_m", "y_m", "z_m", "yaw_rad", "pitch_rad", "roll_rad")


class TruthReading(Protocol):
    """What the truth channel of a simulated rig says."""

    @property
    def world_T_object(self) -> Pose3: ...
    @property
    def contacts(self) -> Iterable[Contact] | None: ...


class StateRecording:
    """Records what is known of the hand as often as the recorder wants it, and the truth with it.

    Args:
        observer: has the recorder, and what is known.
        clock: the session's.
        truth: the truth channel of a simulated rig.
    """

    def __init__(self, observer: Observer, clock: Clock, truth: Callable[[], TruthReading] | None) -> None:
        self._observer, self._clock, self._truth = observer, clock, truth

    def record(self) -> None:
        """Everything, where it is due. Raises SessionError."""
        now_ns, recorder, seen = self._clock.now_ns(), self._observer.recorder, self._observer.interpreter.perception
        if not (seen.ready and recorder.state_due(now_ns)):
            return
        joints = dict(zip(JOINTS, seen.joints_rad.tolist(), strict=True))
        recorder.joints(now_ns, joints, dict(zip(BASE_JOINTS, seen.base_q.tolist(), strict=True)))
        recorder.loads(now_ns, seen.loads_N())
        record_fingertips(recorder, now_ns, seen.fingertips)
        recorder.frames(now_ns, {"palm": seen.world_T_palm, **seen.world_T_distal})
        self.record_truth()

    def record_truth(self) -> None:
        """Where the object really is, on a simulated rig. Raises SessionError."""
        if self._truth is not None:
            reading = self._truth()
            self._observer.recorder.truth(self._clock.now_ns(), reading.world_T_object, reading.contacts)
