"""The recorder: every byte, every event, and samples for viewers.

A replay needs only bytes and session events. The samples (joints, loads, transforms, contacts, pictures, poses) are for
viewers and thinned out; the program never reads them back. Ground truth has separate topics, which only the evaluation
reads.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import asdict
from enum import IntEnum
from typing import Any, Protocol

from gtsam import Pose3

from drivers.core.contacts import Array, Contact, Grasp
from sessions.recording.session_events import SessionEvent
from sessions.recording.traffic import foxglove, schemas

STATE_PERIOD_ns = 80_000_000
"""State samples are written at most this often: 12.5 Hz."""


class Level(IntEnum):
    """Severity of an event, with the numbers of ``foxglove.Log``."""

    INFO = 2
    WARNING = 3
    ERROR = 4


class WrenchReading(Protocol):
    """One reading of a force sensor: force (N) then torque (N m), shape (6,), sensor frame."""

    @property
    def stamp_ns(self) -> int: ...
    @property
    def wrench(self) -> Array: ...
    @property
    def sent(self) -> int: ...
    @property
    def measured(self) -> int: ...
    @property
    def status(self) -> int: ...


class TrafficSink(Protocol):
    """Receives a recorder's messages."""

    def write(self, topic: str, data: bytes, stamp_ns: int) -> None:
        """Store one message. Raises SessionError if it cannot be stored."""


class NullTraffic:
    """A sink that stores nothing, for rigs that are only observed."""

    def write(self, topic: str, data: bytes, stamp_ns: int) -> None:
        """Not stored."""


class Recorder:
    """A :class:`drivers.core.transports.Tap` that also takes session events, samples, events and truth.

    Every method raises SessionError if the message cannot be stored (a full disk): a session that is not recorded must
    not continue.
    """

    def __init__(self, sink: TrafficSink) -> None:
        self.broken = False
        """Whether a message could not be stored and the error was raised: later messages are not recorded."""
        self._sink = sink
        self._onlookers: list[TrafficSink] = []
        self._next_state_ns: int | None = None

    def add_onlooker(self, onlooker: TrafficSink) -> None:
        """From now on viewers' topics, and what devices send, also go to ``onlooker``.

        Its ``write`` must be quick, for what it does not show as well, and never raise.
        """
        self._onlookers.append(onlooker)

    # --- what a replay needs -----------------------------------------------------------------------------------

    def on_transmitted(self, transport: str, payload: bytes, stamp_ns: int) -> None:
        """The program sent ``payload``."""
        self._put(schemas.transmitted_topic(transport), payload, stamp_ns)

    def on_received(self, transport: str, payload: bytes, stamp_ns: int) -> None:
        """The device sent ``payload``, which arrived at ``stamp_ns``."""
        topic = schemas.received_topic(transport)
        self._put(topic, payload, stamp_ns)
        self._tell(topic, payload, stamp_ns)

    def event(self, event: SessionEvent) -> None:
        """Record a session event."""
        self._put(schemas.SESSION_EVENTS_TOPIC, event.to_bytes(), event.stamp_ns)

    # --- what viewers show -------------------------------------------------------------------------------------

    def state_due(self, now_ns: int) -> bool:
        """Whether it is time for the next state sample; a positive answer counts as the sample."""
        if self._next_state_ns is not None and now_ns < self._next_state_ns:
            return False
        self._next_state_ns = now_ns + STATE_PERIOD_ns
        return True

    def joints(self, stamp_ns: int, joints_rad: Mapping[str, float], base: Mapping[str, float]) -> None:
        """Joint angles of the hand and joint positions of the positioner, by name."""
        self._put_json(schemas.JOINTS_TOPIC, foxglove.joint_states(stamp_ns, {**joints_rad, **base}), stamp_ns)

    def loads(self, stamp_ns: int, loads_N: Mapping[str, float]) -> None:
        """Contact force on each fingertip."""
        content = {"timestamp": foxglove.time(stamp_ns), "load_N": dict(loads_N)}
        self._put_json(schemas.LOADS_TOPIC, content, stamp_ns)

    def frames(self, stamp_ns: int, world_T_frames: Mapping[str, Pose3]) -> None:
        """Poses of named frames in the world."""
        transforms = [schemas.transform(stamp_ns, "world", name, pose) for name, pose in world_T_frames.items()]
        self._put_json(schemas.TRANSFORMS_TOPIC, {"transforms": transforms}, stamp_ns)

    def grasp(self, stamp_ns: int, grasp: Grasp, dropped: Mapping[str, str]) -> None:
        """The contacts of a grasp, and the fingers without one."""
        content = {
            "timestamp": foxglove.time(grasp.stamp_ns),
            "index": grasp.index,
            "contacts": schemas.contacts(grasp.contacts),
            "dropped": dict(dropped),
            "hand_motion_world": foxglove.pose(grasp.hand_motion_world),
            "motion_sigma": {} if grasp.motion_sigma is None else asdict(grasp.motion_sigma),
        }
        self._put_json(schemas.CONTACTS_TOPIC, content, stamp_ns)
        self._put_json(schemas.CLOUD_TOPIC, foxglove.contact_cloud(stamp_ns, grasp.contacts), stamp_ns)
        self._put_json(schemas.SCENE_TOPIC, foxglove.contact_scene(stamp_ns, grasp.index, grasp.contacts), stamp_ns)

    def wrench(self, stamp_ns: int, finger: str, reading: WrenchReading) -> None:
        """A force sensor's raw wrench in its own frame."""
        content = {
            "timestamp": foxglove.time(reading.stamp_ns),
            "frame_id": f"{finger}/sensor",
            "force_N": reading.wrench[:3],
            "torque_Nm": reading.wrench[3:],
            "device_counter": reading.sent,
            "device_clock": reading.measured,
            "status": reading.status,
        }
        self._put_json(schemas.wrench_topic(finger), content, stamp_ns)

    def biotac(self, stamp_ns: int, finger: str, counts: Mapping[str, int | None], pac: Sequence[int]) -> None:
        """A BioTac's reading: counts by channel (PDC, TAC, TDC, E1 ...; None: not received) and of the vibration."""
        content = {"timestamp": foxglove.time(stamp_ns), "finger": finger, "counts": dict(counts), "pac": list(pac)}
        self._put_json(schemas.biotac_topic(finger), content, stamp_ns)

    def camera(self, stamp_ns: int, matrix: Array, distortion: Sequence[float], size_px: tuple[int, int]) -> None:
        """The camera's calibration, for viewers: camera matrix (3, 3) in pixels, distortion in OpenCV's order."""
        content = foxglove.camera_calibration(stamp_ns, matrix, distortion, size_px)
        self._put_json(schemas.CAMERA_TOPIC, content, stamp_ns)

    def image(self, stamp_ns: int, encoded: bytes) -> None:
        """A camera picture as received, JPEG or PNG."""
        self._put_json(schemas.IMAGE_TOPIC, schemas.image(stamp_ns, "camera", encoded), stamp_ns)

    def slam(
        self, stamp_ns: int, world_T_object: Pose3 | None, state: Mapping[str, Any], covariance: Array | None = None
    ) -> None:
        """The estimate after a step: the pose for viewers, and the rest as plain data."""
        if world_T_object is not None:
            pose = schemas.pose_in_frame(stamp_ns, "world", world_T_object)
            self._put_json(schemas.SLAM_POSE_TOPIC, pose, stamp_ns)
        content = {"timestamp": foxglove.time(stamp_ns), **state}
        if covariance is not None:
            content["covariance"] = covariance
        self._put_json(schemas.SLAM_STATE_TOPIC, content, stamp_ns)

    def surface(self, stamp_ns: int, content: Mapping[str, Any]) -> None:
        """The estimated surface, see :func:`tactile_lab.autonomy.estimate_messages.surface_message`."""
        self._put_json(schemas.SLAM_SURFACE_TOPIC, {"timestamp": foxglove.time(stamp_ns), **content}, stamp_ns)

    def plan(self, stamp_ns: int, content: Mapping[str, Any]) -> None:
        """The next grasp, plain data."""
        self._put_json(schemas.PLAN_TOPIC, {"timestamp": foxglove.time(stamp_ns), **content}, stamp_ns)

    def decision(self, stamp_ns: int, content: Mapping[str, Any]) -> None:
        """A policy's decision with its candidates and scores, plain data."""
        self._put_json(schemas.DECISION_TOPIC, {"timestamp": foxglove.time(stamp_ns), **content}, stamp_ns)

    def guide(self, stamp_ns: int, content: Mapping[str, Any]) -> None:
        """The panel of a guided session, plain data."""
        self._put_json(schemas.GUIDE_TOPIC, {"timestamp": foxglove.time(stamp_ns), **content}, stamp_ns)

    def safety_stop(self, stamp_ns: int, cause: str, cycles: list[dict[str, Any]]) -> None:
        """Why everything was stopped, with the last cycles before it as plain data, oldest first."""
        content = {"timestamp": foxglove.time(stamp_ns), "cause": cause, "cycles": cycles}
        self._put_json(schemas.SAFETY_TOPIC, content, stamp_ns)

    def log(self, stamp_ns: int, level: Level, source: str, message: str) -> None:
        """A log entry for people."""
        content = {"timestamp": foxglove.time(stamp_ns), "level": int(level), "message": message, "name": source}
        self._put_json(schemas.LOG_TOPIC, {**content, "file": "", "line": 0}, stamp_ns)

    # --- truth -------------------------------------------------------------------------------------------------

    def truth(self, stamp_ns: int, world_T_object: Pose3, contacts: Iterable[Contact] | None = None) -> None:
        """The true pose, and true contacts if known; for evaluation only."""
        pose = schemas.pose_in_frame(stamp_ns, "world", world_T_object)
        self._put_json(schemas.TRUTH_POSE_TOPIC, pose, stamp_ns)
        if contacts is not None:
            content = {"timestamp": foxglove.time(stamp_ns), "contacts": schemas.contacts(contacts)}
            self._put_json(schemas.TRUTH_CONTACTS_TOPIC, content, stamp_ns)

    def _put(self, topic: str, data: bytes, stamp_ns: int) -> None:
        try:
            self._sink.write(topic, data, stamp_ns)
        except BaseException:
            self.broken = True
            raise

    def _put_json(self, topic: str, content: foxglove.Json, stamp_ns: int) -> None:
        data = schemas.encode(content)
        self._put(topic, data, stamp_ns)
        self._tell(topic, data, stamp_ns)

    def _tell(self, topic: str, data: bytes, stamp_ns: int) -> None:
        for onlooker in self._onlookers:
            onlooker.write(topic, data, stamp_ns)


class NullRecorder(Recorder):
    """A recorder that stores nothing, for experiments in memory."""

    def __init__(self) -> None:
        super().__init__(NullTraffic())

    def state_due(self, now_ns: int) -> bool:
        return False

    def _put_json(self, topic: str, content: foxglove.Json, stamp_ns: int) -> None:
        """Nothing to write."""
