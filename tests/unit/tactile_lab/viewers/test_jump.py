"""What a viewer shows that comes late or jumps in a recording: it is given the newest message of each topic alone."""

from __future__ import annotations

from collections.abc import Iterator
from types import SimpleNamespace
from typing import Any

import foxglove.messages as fm
import numpy as np
import pytest
from gtsam import Pose3, Rot3
from mcap_protobuf.decoder import DecoderFactory
from rosbags.typesys import Stores, get_typestore

from drivers.shadow.model.hand_form import RIGHT_HAND
from tactile_lab.viewers.foxglove_messages import FoxgloveMessages
from tactile_lab.viewers.items import Item
from tactile_lab.viewers.robot import CAMERA, OBJECT, WORLD, Robot
from tactile_lab.viewers.ros_messages import RosMessages
from tactile_lab.viewers.story import Story
from tests.support import told_session

CAMERA_POSE = Pose3(Rot3.Pitch(1.0), np.array([0.1, 0.2, -0.5]))


class SightedOnce:
    """Stands for the search in pictures: the first one shows where the camera is."""

    def __init__(self) -> None:
        self._answers = iter([CAMERA_POSE])

    def first_sight(self, encoded: bytes, found: object = None) -> Pose3 | None:
        return next(self._answers, None)


def items(robot: Robot) -> Iterator[Item]:
    story: Any = Story(robot, SightedOnce())  # type: ignore[arg-type]
    yield from story.begin(0)
    for topic, data, stamp_ns in told_session.told():
        yield from story.message(topic, data, stamp_ns)


def foxglove_links(robot: Robot) -> dict[str, str]:
    """Parents by child, of the newest messages that Foxglove's viewer is given."""
    make = FoxgloveMessages(robot)
    newest = {one.topic.name: one for item in items(robot) for one in make.of(item)}
    told = [links_in(newest[topic].data) for topic in ("/tf_static", "/tf")]
    return {child: parent for links in told for child, parent in links.items()}


def links_in(data: bytes) -> dict[str, str]:
    schema = fm.FrameTransforms.get_schema()
    stored = SimpleNamespace(id=1, name=schema.name, encoding=schema.encoding, data=schema.data)
    decode = DecoderFactory().decoder_for("protobuf", stored)  # type: ignore[arg-type]
    assert decode is not None
    return {one.child_frame_id: one.parent_frame_id for one in decode(data).transforms}


def ros_links(robot: Robot) -> dict[str, str]:
    """The same of ROS."""
    make = RosMessages(get_typestore(Stores.ROS2_JAZZY).types, robot)
    newest = {topic: message for item in items(robot) for topic, _, _, message in make.of(item)}
    told = [one for topic in ("/tf_static", "/tf") for one in newest[topic].transforms]
    return {one.child_frame_id: one.header.frame_id for one in told}


@pytest.mark.parametrize("links", [foxglove_links, ros_links])
@pytest.mark.parametrize("form", [RIGHT_HAND, RIGHT_HAND.mirrored])
def test_the_newest_frames_alone_connect_hand_table_camera_and_object_to_the_world(links, form):
    robot = told_session.robot(form)
    parents = links(robot)
    assert {one.child for one in robot.joints} | {CAMERA, OBJECT} <= set(parents)
    for frame in parents:
        for _ in parents:
            frame = parents.get(frame, frame)
        assert frame == WORLD
