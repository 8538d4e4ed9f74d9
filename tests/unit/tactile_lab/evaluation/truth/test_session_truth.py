"""Which picture shows the truth of which grasp, also after an undo."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from gtsam import Pose3

from drivers.camera.frames import Detection, Frame
from drivers.camera.packet import encode_packet
from sessions.perception.interpreter import CAMERA_LINK
from sessions.recording.session_events import EventKind, SessionEvent
from sessions.recording.traffic.reader import TrafficMessage
from sessions.recording.traffic.schemas import SESSION_EVENTS_TOPIC, received_topic
from tactile_lab.evaluation.truth.session_truth import marked_pictures, session_truth

CORNERS_ONLY = encode_packet(Frame(0, np.zeros((2, 2), np.uint8), 1, 0, Detection("DICT_4X4_50", (2, 2), {})))


def messages(*story: EventKind | bytes) -> list[TrafficMessage]:
    """What a recording holds: session events, and pictures as their bytes."""
    return [
        TrafficMessage(received_topic(CAMERA_LINK), part, stamp_ns, stamp_ns)
        if isinstance(part, bytes)
        else TrafficMessage(SESSION_EVENTS_TOPIC, SessionEvent(part, stamp_ns).to_bytes(), stamp_ns, stamp_ns)
        for stamp_ns, part in enumerate(story)
    ]


def seen(*story: EventKind | bytes) -> dict[int, bytes]:
    return {grasp: picture.payload for grasp, picture in marked_pictures(messages(*story)).items()}


BEGIN, END, SHOWN, UNDO = EventKind.CAPTURE_BEGIN, EventKind.CAPTURE_END, EventKind.TRUTH_FRAME, EventKind.UNDO


@pytest.mark.parametrize(
    ("story", "pictures"),
    [
        ((b"a", BEGIN, SHOWN, END, BEGIN, b"b", SHOWN, END), {0: b"a", 1: b"b"}),
        ((BEGIN, END, b"a", SHOWN), {0: b"a"}),  # after a capture, of the grasp that ended
        ((b"a", SHOWN, BEGIN, END), {}),  # before the first grasp
        ((b"a", b"b", BEGIN, SHOWN, END), {0: b"b"}),  # the newest
        ((b"a", BEGIN, SHOWN, b"b", SHOWN, END), {0: b"a"}),  # the first that was meant
        ((b"a", BEGIN, SHOWN, END, BEGIN, SHOWN, END), {0: b"a"}),  # no picture since
        ((b"a", BEGIN, SHOWN, END, UNDO, b"b", BEGIN, SHOWN, END), {0: b"b"}),  # an undone grasp is taken again
        ((b"a", BEGIN, SHOWN, END, BEGIN, b"b", SHOWN, END, UNDO), {0: b"a"}),
        ((b"a", CORNERS_ONLY, BEGIN, SHOWN, END), {0: b"a"}),  # what has a picture, also if it is older
        ((CORNERS_ONLY, BEGIN, SHOWN, END), {0: CORNERS_ONLY}),
    ],
)
def test_the_picture_of_a_grasp_is_the_one_its_event_means(
    story: tuple[EventKind | bytes, ...], pictures: dict[int, bytes]
) -> None:
    assert seen(*story) == pictures


WITHOUT_MESH: Any = SimpleNamespace(truth_mesh=None)


def test_a_grasp_without_a_picture_has_no_truth_and_the_others_keep_theirs() -> None:
    traffic: Any = SimpleNamespace(messages=lambda: messages(BEGIN, END, BEGIN, b"shown", SHOWN, END))
    seen_at = {b"shown": Pose3()}
    truth = session_truth(WITHOUT_MESH, 3, lambda picture: seen_at[picture.payload], traffic)
    assert truth.world_T_object == (None, seen_at[b"shown"], None)


def test_without_a_camera_no_pose_is_known() -> None:
    truth = session_truth(WITHOUT_MESH, 2, None)
    assert truth.world_T_object == (None, None)
    assert truth.mesh is None
