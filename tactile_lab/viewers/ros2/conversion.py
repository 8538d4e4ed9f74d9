"""From a session's messages to ROS 2's, serialized, with stamps of this computer's own clock."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from typing import Any

from rosbags.typesys import Stores, get_typestore

from tactile_lab.rigs.description import load_rig
from tactile_lab.viewers.camera_pose import camera_of_rig
from tactile_lab.viewers.items import Item
from tactile_lab.viewers.robot_of_rig import robot_of_rig
from tactile_lab.viewers.ros_bag import LASTING
from tactile_lab.viewers.ros_messages import RosMessages
from tactile_lab.viewers.story import Story


@dataclass(frozen=True)
class Serialized:
    """A message of ROS 2 in little-endian CDR."""

    topic: str
    kind: str
    data: bytes

    @property
    def lasting(self) -> bool:
        """Whether those who come later need it."""
        return self.topic in LASTING


class Conversion:
    """Converts the messages of one session after another.

    Args:
        rig: its name or file.
        now_ns: time of this computer, by which other nodes stamp, nanoseconds since 1970.
    """

    def __init__(self, rig: str, now_ns: Callable[[], int]) -> None:
        found = load_rig(rig)
        self._robot, self._camera, self._now_ns = robot_of_rig(found), camera_of_rig(found), now_ns
        self._store = get_typestore(Stores.ROS2_JAZZY)
        self._make = RosMessages(self._store.types, self._robot)
        self.begin_session()

    def begin_session(self) -> None:
        """What follows is another session's."""
        self._story = Story(self._robot, self._camera)
        self._ahead_ns: int | None = None

    def of(self, topic: str, data: bytes, stamp_ns: int) -> Iterator[Serialized]:
        """The messages of ROS 2; before the first of a session what never changes. Raises ValueError."""
        if self._ahead_ns is None:
            self._ahead_ns = self._now_ns() - stamp_ns
            yield from self._serialized(self._make.description(self._now_ns()))
            for item in self._story.begin(stamp_ns):
                yield from self._converted(item)
        for item in self._story.message(topic, data, stamp_ns):
            yield from self._converted(item)

    def _converted(self, item: Item) -> Iterator[Serialized]:
        item = replace(item, stamp_ns=item.stamp_ns + (self._ahead_ns or 0))
        yield from self._serialized(self._make.live(item))

    def _serialized(self, made: Iterator[tuple[str, str, int, Any]]) -> Iterator[Serialized]:
        for topic, kind, _, message in made:
            yield Serialized(topic, kind, bytes(self._store.serialize_cdr(message, kind)))
