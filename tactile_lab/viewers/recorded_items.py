"""The items of a recorded session, from its first message to its last."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

from drivers.camera.frames import Detection
from drivers.camera.packet import picture_of
from drivers.force.force_samples import WrenchSample
from sessions.perception.interpreter import CAMERA_LINK, HAND_LINK, Interpreter
from sessions.recording.recorder import STATE_PERIOD_ns
from sessions.recording.session import Session
from sessions.recording.session_events import SessionEvent
from sessions.recording.traffic import schemas
from tactile_lab.rigs.build import build_interpreter
from tactile_lab.rigs.description import rig_of_session
from tactile_lab.viewers.camera_pose import camera_of_rig
from tactile_lab.viewers.items import Item
from tactile_lab.viewers.robot import Robot
from tactile_lab.viewers.robot_of_rig import robot_of_rig
from tactile_lab.viewers.story import STORY_TOPICS, Story

_FROM_BYTES = frozenset({schemas.JOINTS_TOPIC, schemas.IMAGE_TOPIC})
"""Topics whose content the raw bytes have too, and of extracts only they."""


class RecordedItems:
    """A session's items; joints, wrenches and pictures are decoded from the raw bytes.

    Args:
        session: the recording.
        period_ns: between two states of the hand, and two wrenches of a finger.

    Raises:
        ConfigurationError, SessionError: the recorded description or a calibration copy cannot be used.
    """

    def __init__(self, session: Session, period_ns: int = STATE_PERIOD_ns) -> None:
        rig = rig_of_session(session)
        self.robot: Robot = robot_of_rig(rig)
        self._session, self._period_ns = session, period_ns
        self._interpreter: Interpreter = build_interpreter(rig)
        self._story = Story(self.robot, camera_of_rig(rig))
        self._due_ns: dict[str, int] = {}
        self._samples: list[tuple[str, Any]] = []
        self._found: Detection | None = None
        """The markers in the camera's newest frame."""

    def __iter__(self) -> Iterator[Item]:
        """Everything, once. Raises SessionError."""
        self._interpreter.listener = lambda transport, sample: self._samples.append((transport, sample))
        traffic, begun = self._session.traffic(), False
        for message in traffic.messages():
            if not begun:
                yield from self._story.begin(message.stamp_ns)
                begun = True
            transport = schemas.received_transport(message.topic)
            if transport is not None:
                self._interpreter.on_received(transport, message.data, message.stamp_ns)
                yield from self._decoded(message.stamp_ns)
                if transport == CAMERA_LINK and (picture := picture_of(message.data)):
                    yield from self._story.picture(message.stamp_ns, picture, self._found)
            elif message.topic == schemas.SESSION_EVENTS_TOPIC:
                self._interpreter.event(SessionEvent.from_bytes(message.data, where=str(traffic.path)))
            elif message.topic in STORY_TOPICS - _FROM_BYTES:
                yield from self._story.message(message.topic, message.data, message.stamp_ns)

    def _decoded(self, stamp_ns: int) -> Iterator[Item]:
        """What the drivers made of the last bytes."""
        samples, self._samples = self._samples, []
        seen = self._interpreter.perception
        for transport, sample in samples:
            if transport == HAND_LINK and seen.hand.ready and self._is_due(HAND_LINK, stamp_ns):
                yield from self._story.state(stamp_ns, seen.hand.joints_rad, seen.hand.base_q)
            elif transport == CAMERA_LINK:
                self._found = sample.detection
            elif transport.startswith("ft/"):
                for one in (reading for reading in sample if isinstance(reading, WrenchSample)):
                    if self._is_due(transport, one.stamp_ns):
                        yield from self._story.wrench(one.stamp_ns, transport[3:], one.wrench)

    def _is_due(self, what: str, stamp_ns: int) -> bool:
        """Whether it is time for the next one of its kind; a positive answer counts as it."""
        if stamp_ns < self._due_ns.get(what, stamp_ns):
            return False
        self._due_ns[what] = stamp_ns + self._period_ns
        return True
