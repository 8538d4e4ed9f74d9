"""A session as an MCAP file of standard types, which Foxglove, Lichtblick and Rerun open without a plug-in."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path
from typing import Any

from mcap.writer import Writer

from tactile_lab.viewers.encoded import Encoded, Topic
from tactile_lab.viewers.foxglove_messages import FoxgloveMessages
from tactile_lab.viewers.new_files import new_file
from tactile_lab.viewers.recorded_items import RecordedItems
from tactile_lab.viewers.robot import Robot
from tactile_lab.viewers.urdf import urdf

DESCRIPTION_FILE = "robot.urdf"


def write_foxglove(path: Path, items: RecordedItems, facts: Mapping[str, str]) -> int:
    """Write a new file; nothing is left of one that cannot be completed. Returns the number of messages.

    Args:
        items: of a session; its robot's description is attached as ``robot.urdf``.
        facts: about the session, stored as metadata.

    Raises:
        ConfigurationError: the file exists.
        WriteError: it cannot be written.
    """
    with new_file(path) as partial, partial.open("wb") as file:
        return _McapFile(Writer(file), items.robot, facts).write(foxglove_messages(items))


def foxglove_messages(items: RecordedItems) -> Iterator[Encoded]:
    """The messages of a session, in their order."""
    make, begun = FoxgloveMessages(items.robot), False
    for item in items:
        if not begun:
            yield from make.begin(item.stamp_ns)
            begun = True
        yield from make.of(item)


class _McapFile:
    def __init__(self, writer: Writer, robot: Robot, facts: Mapping[str, str]) -> None:
        self._writer: Any = writer
        self._robot, self._facts = robot, dict(facts)
        self._schemas: dict[str, int] = {}
        self._channels: dict[str, int] = {}

    def write(self, messages: Iterable[Encoded]) -> int:
        """Everything from header to summary."""
        writer, count, latest_ns = self._writer, 0, 0
        writer.start(profile="", library="tactile-lab")
        writer.add_metadata("tactile-lab", self._facts)
        writer.add_attachment(0, 0, DESCRIPTION_FILE, "application/xml", urdf(self._robot).encode())
        for message in messages:
            latest_ns = max(latest_ns, message.stamp_ns)  # readers that sort by it keep the order
            writer.add_message(self._channel(message.topic), latest_ns, message.data, message.stamp_ns, count)
            count += 1
        writer.finish()
        return count

    def _channel(self, topic: Topic) -> int:
        if topic.name not in self._channels:
            schema = topic.schema
            if schema.name not in self._schemas:
                number = self._writer.register_schema(schema.name, schema.encoding, schema.definition)
                self._schemas[schema.name] = number
            self._channels[topic.name] = self._writer.register_channel(
                topic.name, topic.encoding, self._schemas[schema.name]
            )
        return self._channels[topic.name]
