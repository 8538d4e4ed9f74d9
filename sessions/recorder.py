"""The recorder: every byte, every mark, and samples for the eye.

Bytes and marks are all that a replay needs. The samples beside them (joints, loads, transforms, contacts, pictures,
poses) are there for viewers and are thinned out; nothing is ever read back from them. Truth has topics of its own,
which only evaluation reads.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from enum import IntEnum
from typing import Any, Protocol

from gtsam import Pose3

from sessions import schemas
from sessions.marks import Mark
from tactile_lab.geometry.contacts import Array, Contact, Grasp

STATE_PERIOD_ns = 80_000_000
"""State samples are written at most this often: 12.5 Hz."""


class Level(IntEnum):
    """Severity of an event, with the numbers of ``foxglove.Log``."""

    INFO = 2
    WARNING = 3
    ERROR = 4


class TrafficSink(Protocol):
    """Where a recorder's messages go."""

    def write(self, topic: str, data: bytes, stamp_ns: int) -> None:
        """Take one message. Raises SessionError when it can not be kept."""


class NullTraffic:
    """A sink that keeps nothing, for benches that only look."""

    def write(self, topic: str, data: bytes, stamp_ns: int) -> None:
        """Not kept."""


class Recorder:
    """A :class:`drivers.links.Tap` that also takes marks, samples, events and truth.

    Every method raises SessionError when the message can not be kept (a full disk): a session that is not being
    recorded must not go on.
    """

    def __init__(self, sink: TrafficSink) -> None:
        self.broken = False
        """A message could not be kept, and its writer was told so: what follows is not recorded."""
        self._sink = sink
        self._next_state_ns: int | None = None

    # --- what a replay needs -----------------------------------------------------------------------------------

    def transmitted(self, link: str, payload: bytes, stamp_ns: int) -> None:
        """The program sent ``payload``."""
        self._put(schemas.transmitted_topic(link), payload, stamp_ns)

    def received(self, link: str, payload: bytes, stamp_ns: int) -> None:
        """The device sent ``payload``, which arrived at ``stamp_ns``."""
        self._put(schemas.received_topic(link), payload, stamp_ns)

    def mark(self, mark: Mark) -> None:
        """The conductor meant something."""
        self._put(schemas.MARKS_TOPIC, mark.to_bytes(), mark.stamp_ns)

    # --- what viewers show -------------------------------------------------------------------------------------

    def state_due(self, now_ns: int) -> bool:
        """Whether it is time for the next state sample; asking and being told yes uses it up."""
        if self._next_state_ns is not None and now_ns < self._next_state_ns:
            return False
        self._next_state_ns = now_ns + STATE_PERIOD_ns
        return True

    def joints(self, stamp_ns: int, joints_rad: Mapping[str, float], base: Mapping[str, float]) -> None:
        """Joint angles of the hand and joint positions of the positioner, by name."""
        content = {"timestamp": schemas.time(stamp_ns), "joints_rad": dict(joints_rad), "base": dict(base)}
        self._put_json(schemas.JOINTS_TOPIC, content, stamp_ns)

    def loads(self, stamp_ns: int, loads_N: Mapping[str, float]) -> None:
        """Contact force on each fingertip."""
        content = {"timestamp": schemas.time(stamp_ns), "load_N": dict(loads_N)}
        self._put_json(schemas.LOADS_TOPIC, content, stamp_ns)

    def frames(self, stamp_ns: int, world_T_frames: Mapping[str, Pose3]) -> None:
        """Where named frames are in the world."""
        transforms = [schemas.transform(stamp_ns, "world", name, pose) for name, pose in world_T_frames.items()]
        self._put_json(schemas.TRANSFORMS_TOPIC, {"transforms": transforms}, stamp_ns)

    def grasp(self, stamp_ns: int, grasp: Grasp, dropped: Mapping[str, str]) -> None:
        """The contacts of a grasp, and the fingers without one."""
        content = {
            "timestamp": schemas.time(grasp.stamp_ns),
            "index": grasp.index,
            "contacts": schemas.contacts(grasp.contacts),
            "dropped": dict(dropped),
            "hand_motion_world": schemas.pose(grasp.hand_motion_world),
        }
        self._put_json(schemas.CONTACTS_TOPIC, content, stamp_ns)

    def image(self, stamp_ns: int, encoded: bytes) -> None:
        """A camera picture as it came, JPEG or PNG."""
        self._put_json(schemas.IMAGE_TOPIC, schemas.image(stamp_ns, "camera", encoded), stamp_ns)

    def slam(
        self, stamp_ns: int, world_T_object: Pose3 | None, state: Mapping[str, Any], covariance: Array | None = None
    ) -> None:
        """The estimate after a step: the pose for viewers, the rest (plain data) beside it."""
        if world_T_object is not None:
            pose = schemas.pose_in_frame(stamp_ns, "world", world_T_object)
            self._put_json(schemas.SLAM_POSE_TOPIC, pose, stamp_ns)
        content = {"timestamp": schemas.time(stamp_ns), **state}
        if covariance is not None:
            content["covariance"] = covariance
        self._put_json(schemas.SLAM_STATE_TOPIC, content, stamp_ns)

    def event(self, stamp_ns: int, level: Level, source: str, message: str) -> None:
        """Something a person should be able to read later."""
        content = {"timestamp": schemas.time(stamp_ns), "level": int(level), "message": message, "name": source}
        self._put_json(schemas.EVENTS_TOPIC, {**content, "file": "", "line": 0}, stamp_ns)

    # --- truth -------------------------------------------------------------------------------------------------

    def truth(self, stamp_ns: int, world_T_object: Pose3, contacts: Iterable[Contact] | None = None) -> None:
        """The true pose, and true contacts where they are known; for evaluation only."""
        pose = schemas.pose_in_frame(stamp_ns, "world", world_T_object)
        self._put_json(schemas.TRUTH_POSE_TOPIC, pose, stamp_ns)
        if contacts is not None:
            content = {"timestamp": schemas.time(stamp_ns), "contacts": schemas.contacts(contacts)}
            self._put_json(schemas.TRUTH_CONTACTS_TOPIC, content, stamp_ns)

    def _put(self, topic: str, data: bytes, stamp_ns: int) -> None:
        try:
            self._sink.write(topic, data, stamp_ns)
        except BaseException:
            self.broken = True
            raise

    def _put_json(self, topic: str, content: schemas.Json, stamp_ns: int) -> None:
        self._put(topic, schemas.encode(content), stamp_ns)


class NullRecorder(Recorder):
    """A recorder that keeps nothing, for experiments in memory."""

    def __init__(self) -> None:
        super().__init__(NullTraffic())

    def state_due(self, now_ns: int) -> bool:
        return False

    def _put_json(self, topic: str, content: schemas.Json, stamp_ns: int) -> None:
        """Nothing to write."""
