"""A recorded session sampled at a constant rate: what was known at each instant, decoded from the raw bytes."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from drivers.camera.packet import picture_of
from drivers.core.clock import NANOSECONDS
from drivers.core.contacts import Array
from drivers.core.errors import CodecError
from drivers.force.force_samples import WrenchSample
from drivers.shadow.model.motors import MotorMap
from drivers.shadow.protocol.motor_data import ToMotor
from drivers.shadow.protocol.palm_codec import MOTORS
from drivers.shadow.protocol.palm_images import PALMS
from sessions.perception.fingertip_samples import biotac_counts
from sessions.perception.interpreter import CAMERA_LINK, HAND_LINK
from sessions.recording.session import Session
from sessions.recording.session_events import EventKind, SessionEvent
from sessions.recording.traffic import schemas
from sessions.recording.traffic.reader import TrafficMessage, may_hold
from tactile_lab.rigs.build import build_interpreter
from tactile_lab.rigs.description import rig_of_session
from tactile_lab.viewers.items import Item, ObjectPose, Surface, Touches
from tactile_lab.viewers.robot_of_rig import robot_of_rig
from tactile_lab.viewers.story import Story

REACH, CLOSE, FEEL, CARRY = "reach for the object", "close the fingers", "feel the contacts", "carry the object"
PHASES = (REACH, CLOSE, FEEL, CARRY)
"""What is being done at an instant, in words."""

_PHASE_FROM = {
    EventKind.CLOSE_BEGIN: CLOSE,
    EventKind.CAPTURE_BEGIN: FEEL,
    EventKind.CAPTURE_END: REACH,
    EventKind.TOUCH_END: REACH,
    EventKind.HOLD_BEGIN: CARRY,
    EventKind.HOLD_END: REACH,
}
_TOLD = frozenset(
    {
        schemas.CONTACTS_TOPIC,
        schemas.SLAM_POSE_TOPIC,
        schemas.SLAM_STATE_TOPIC,
        schemas.SLAM_SURFACE_TOPIC,
        schemas.TRUTH_POSE_TOPIC,
    }
)
"""Topics that hold what was concluded, which the bytes do not."""
_DEMANDS = (ToMotor.DEMAND_PWM, ToMotor.DEMAND_TORQUE)


@dataclass(frozen=True)
class Moment:
    """What was known at an instant of a session.

    Attributes:
        positions: joints of hand and positioner by the names of the robot's description; radians, metres.
        demands: last sent to the motors, by motor number, shape (20,), counts.
        wrenches: newest raw reading of each force sensor, shape (6,), N and N m, in the sensor's frame.
        loads_N: contact force on each fingertip, infinite if its sensor has no valid reading.
        counts: newest readings of each BioTac by channel; None for a channel that was not received.
        phase: of :data:`PHASES`.
        touches: of the last grasp; None before the first.
        grasps: how many were captured and not undone.
        estimate, surface: the newest; None before the first.
        truth: the object's true pose; None where nobody knows it.
        picture: the camera's newest, encoded as received.
    """

    stamp_ns: int = 0
    positions: Mapping[str, float] = field(default_factory=dict)
    demands: Array = field(default_factory=lambda: np.zeros(MOTORS))
    wrenches: Mapping[str, Array] = field(default_factory=dict)
    loads_N: Mapping[str, float] = field(default_factory=dict)
    counts: Mapping[str, Mapping[str, int | None]] = field(default_factory=dict)
    phase: str = REACH
    touches: Touches | None = None
    grasps: int = 0
    estimate: ObjectPose | None = None
    surface: Surface | None = None
    truth: ObjectPose | None = None
    picture: bytes | None = None


class SampledSession:
    """The moments of a session, from the first in which hand and positioner are known.

    Args:
        session: the recording.
        rate_Hz: moments a second.

    Attributes:
        robot: of the session.
        motors: which motor pulls which joint.
        fingers: that have a fingertip sensor.
        forces: those of them whose sensors measure wrenches.
        channels: of each BioTac, by finger.
        has_truth: whether a true pose may have been recorded.

    Raises:
        ConfigurationError, SessionError: the recorded description or a calibration copy cannot be used.
    """

    def __init__(self, session: Session, rate_Hz: int) -> None:
        rig = rig_of_session(session)
        self.robot = robot_of_rig(rig)
        self.motors = MotorMap.load(rig.files["motors"])
        self._session, self._period_ns = session, NANOSECONDS // rate_Hz
        self._interpreter, self._story = build_interpreter(rig), Story(self.robot)
        self._palm = PALMS[rig.description.hand.palm]
        self._seen = self._interpreter.perception
        self.fingers = tuple(self._seen.fingertips)
        self.channels = {
            finger: tuple(counts)
            for finger, tip in self._seen.fingertips.items()
            if (counts := biotac_counts(tip)) is not None
        }
        self.forces = tuple(finger for finger in self.fingers if finger not in self.channels)
        self.has_truth = may_hold(session.traffic().path, (schemas.TRUTH_POSE_TOPIC,))
        self._now = Moment()

    def __iter__(self) -> Iterator[Moment]:
        """The moments, once. Raises SessionError."""
        self._interpreter.listener = self._on_sample
        traffic, due_ns = self._session.traffic(), -1
        for message in traffic.messages():
            clock_ns = self._interpreter.clock.now_ns()
            if self._seen.hand.ready and due_ns < 0:
                due_ns = clock_ns
            while 0 <= due_ns < clock_ns:
                yield self._moment(due_ns)
                due_ns += self._period_ns
            self._take(message, str(traffic.path))

    def _moment(self, stamp_ns: int) -> Moment:
        seen = self._seen
        counts = {finger: biotac_counts(seen.fingertips[finger]) or {} for finger in self.channels}
        positions = self.robot.positions(seen.hand.joints_rad, seen.hand.base_q)
        return replace(self._now, stamp_ns=stamp_ns, positions=positions, loads_N=seen.loads_N(), counts=counts)

    def _take(self, message: TrafficMessage, where: str) -> None:
        """One recorded message."""
        transport = schemas.received_transport(message.topic)
        if transport is not None:
            self._interpreter.on_received(transport, message.data, message.stamp_ns)
            if transport == CAMERA_LINK and (picture := picture_of(message.data)):
                self._now = replace(self._now, picture=picture)
        elif message.topic == schemas.transmitted_topic(HAND_LINK):
            self._on_command(message.data)
        elif message.topic == schemas.SESSION_EVENTS_TOPIC:
            event = SessionEvent.from_bytes(message.data, where=where)
            self._interpreter.event(event)
            self._now = replace(self._now, phase=_PHASE_FROM.get(event.kind, self._now.phase))
        elif message.topic in _TOLD:
            for item in self._story.message(message.topic, message.data, message.stamp_ns):
                self._on_item(item)

    def _on_sample(self, transport: str, sample: Any) -> None:
        if transport.startswith("ft/"):
            readings = [one.wrench for one in sample if isinstance(one, WrenchSample)]
            if readings:
                self._now = replace(self._now, wrenches={**self._now.wrenches, transport[3:]: readings[-1]})

    def _on_command(self, data: bytes) -> None:
        """What the palm was sent; other commands than demands, and damaged ones, change nothing."""
        try:
            command = self._palm.decode_command(data)
        except CodecError:
            return
        if command.to_motor_data_type in _DEMANDS:
            self._now = replace(self._now, demands=np.array(command.motor_data, dtype=float))

    def _on_item(self, item: Item) -> None:
        if isinstance(item, Touches):
            self._now = replace(self._now, touches=item, grasps=item.grasp + 1)
        elif isinstance(item, Surface):
            self._now = replace(self._now, surface=item)
        elif isinstance(item, ObjectPose) and item.true:
            self._now = replace(self._now, truth=item)
        elif isinstance(item, ObjectPose):
            self._now = replace(self._now, estimate=item)
