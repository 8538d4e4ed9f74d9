"""The truth of a recorded session: the marker camera's pictures of each grasp, and the object's mesh.

Only evaluation reads these. The pictures are decoded again from their recorded bytes, so the truth can be
recomputed with another detector or calibration.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator

import trimesh
from gtsam import Pose3

from drivers.camera.packet import picture_of
from drivers.core.transports import Datagram
from sessions.perception.interpreter import CAMERA_LINK
from sessions.recording.session import Session
from sessions.recording.session_events import EventKind, SessionEvent
from sessions.recording.traffic.reader import TrafficMessage, TrafficReader
from sessions.recording.traffic.schemas import SESSION_EVENTS_TOPIC, received_topic
from tactile_lab.evaluation.estimate_with_truth import Truth
from tactile_lab.evaluation.files.mesh_io import read_mesh

TRUTH_TRAJECTORY = "truth.csv"
"""The true poses in ``results/``, in the format of ``trajectory.csv``."""

Look = Callable[[Datagram], Pose3 | None]
"""Finds the object in one recorded camera datagram: ``world_T_object``, or None if it is not seen."""


def session_truth(session: Session, grasp_count: int, look: Look | None, traffic: TrafficReader | None = None) -> Truth:
    """The true pose of each grasp and the true mesh.

    Args:
        session: the recorded session.
        grasp_count: number of grasps.
        look: the marker detector; None for a rig without a camera.
        traffic: reader of the session's traffic, for a caller who needs its losses afterwards.

    Raises:
        SessionError: the traffic file or a session event in it cannot be read.
        ShapeError: the mesh cannot be used.
    """
    pictures = {}
    if look is not None:
        pictures = marked_pictures(picture_messages(session) if traffic is None else traffic.messages())
    poses = [look(pictures[index]) if look and index in pictures else None for index in range(grasp_count)]
    return Truth(tuple(poses), read_truth_mesh(session))


def read_truth_mesh(session: Session) -> trimesh.Trimesh | None:
    """The object's mesh, None if the session has none. Raises ShapeError."""
    return None if session.truth_mesh is None else read_mesh(session.truth_mesh)


def picture_messages(session: Session) -> Iterator[TrafficMessage]:
    """Of a session's recording, what :func:`marked_pictures` needs. Raises SessionError."""
    return session.traffic().messages_on({received_topic(CAMERA_LINK), SESSION_EVENTS_TOPIC})


def marked_pictures(messages: Iterable[TrafficMessage]) -> dict[int, Datagram]:
    """The camera datagram that shows the truth of each grasp.

    A session event refers to the newest picture since the last event, and to the grasp being captured, otherwise the
    last one; the first picture of a grasp counts.
    """
    found: dict[int, Datagram] = {}
    picture: Datagram | None = None
    counter = _GraspCounter()
    for message in messages:
        if message.topic == received_topic(CAMERA_LINK):
            picture = _better(picture, Datagram(message.data, message.stamp_ns))
        elif message.topic == SESSION_EVENTS_TOPIC:
            event = SessionEvent.from_bytes(message.data)
            counter.take(event.kind)
            if event.kind is EventKind.UNDO:
                found.pop(counter.finished, None)
            if event.kind is EventKind.TRUTH_FRAME and picture is not None:
                found.setdefault(counter.current, picture)
                picture = None
    found.pop(-1, None)
    return found


def _better(before: Datagram | None, now: Datagram) -> Datagram:
    """The newest frame with a picture; if there is none, the newest with corners only."""
    return now if before is None or picture_of(now.payload) or not picture_of(before.payload) else before


def camera_datagrams(session: Session) -> Iterator[Datagram]:
    """Everything the camera sent. Raises SessionError."""
    for message in session.traffic().messages_on({received_topic(CAMERA_LINK)}):
        yield Datagram(message.data, message.stamp_ns)


class _GraspCounter:
    """Numbers the grasps as perception does: one for every completed capture that was not undone."""

    def __init__(self) -> None:
        self.finished, self._is_open = 0, False

    def take(self, kind: EventKind) -> None:
        """Process one session event."""
        if kind is EventKind.CAPTURE_BEGIN:
            self._is_open = True
        elif kind is EventKind.CAPTURE_END:
            self.finished, self._is_open = self.finished + 1, False
        elif kind is EventKind.UNDO:
            self.finished -= 1

    @property
    def current(self) -> int:
        """The grasp that a picture taken now belongs to; -1 before the first."""
        return self.finished if self._is_open else self.finished - 1
