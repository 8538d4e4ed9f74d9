"""A session as an MCAP file of standard types, which Foxglove, Lichtblick and Rerun open without a plug-in."""

from __future__ import annotations

import json
from collections.abc import Iterable
from pathlib import Path

from mcap.writer import Writer

from drivers.core.errors import SessionError
from tactile_lab.viewers.encoded import Encoded, Topic
from tactile_lab.viewers.robot import Robot
from tactile_lab.viewers.urdf import urdf

DESCRIPTION_FILE = "robot.urdf"


def write_foxglove(path: Path, robot: Robot, messages: Iterable[Encoded], facts: dict[str, object]) -> int:
    """Write a new file; one that cannot be completed is removed. Returns the number of messages.

    Args:
        robot: its description is attached as ``robot.urdf``.
        messages: in their order.
        facts: about the session, stored as metadata.

    Raises:
        SessionError: the file exists or cannot be written.
    """
    if path.exists():
        raise SessionError("exists already", where=str(path), hint="Choose another name")
    partial = path.with_name(f".{path.name}.part")
    try:
        with partial.open("wb") as file:
            count = _McapFile(Writer(file), robot, facts).write(messages)
        partial.replace(path)
    except OSError as error:
        what = f"cannot be written ({error.strerror or error})"
        raise SessionError(what, where=str(path), hint="Choose another name") from error
    finally:
        if partial.exists():
            partial.unlink()
    return count


class _McapFile:
    def __init__(self, writer: Writer, robot: Robot, facts: dict[str, object]) -> None:
        self._writer, self._robot = writer, robot
        self._facts = {name: value if isinstance(value, str) else json.dumps(value) for name, value in facts.items()}
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
