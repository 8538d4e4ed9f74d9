"""All measurements of a session as plain tables, decoded from the raw bytes by the session's own drivers.

The tables are filled from an :class:`~sessions.perception.interpreter.Interpreter` that reads the recording, so that
they hold the session's data at full rate, and not the thinned samples for viewers. Ground truth has separate tables.
"""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from drivers.force.force_samples import WrenchSample
from drivers.shadow.model.kinematics import JOINTS
from sessions.perception.fingertip_samples import biotac_counts
from sessions.perception.interpreter import BASE_LINK, CAMERA_LINK, HAND_LINK, Interpreter
from sessions.recording.session_events import SessionEvent
from sessions.recording.traffic import schemas, told
from sessions.recording.traffic.reader import TrafficMessage, TrafficReader
from sessions.rig_runtime.state_recording import BASE_JOINTS

WRENCH_COLUMNS = ("fx_N", "fy_N", "fz_N", "tx_Nm", "ty_Nm", "tz_Nm", "device_counter", "device_clock", "status")
POSE_COLUMNS = ("x_m", "y_m", "z_m", "qx", "qy", "qz", "qw")
CONTACT_COLUMNS = ("grasp", "finger", "x_m", "y_m", "z_m", "nx", "ny", "nz", "force_N")


@dataclass
class Table:
    """Rows with one stamp each: reception time, session clock, nanoseconds."""

    columns: tuple[str, ...]
    stamps_ns: list[int] = field(default_factory=list)
    rows: list[Sequence[Any]] = field(default_factory=list)

    def add(self, stamp_ns: int, row: Sequence[Any]) -> None:
        """Append one row."""
        self.stamps_ns.append(stamp_ns)
        self.rows.append(row)


@dataclass
class SampleTables:
    """Tables by name, and the pictures as received."""

    tables: dict[str, Table] = field(default_factory=dict)
    pictures: list[tuple[int, bytes]] = field(default_factory=list)

    def table(self, name: str, columns: Sequence[str]) -> Table:
        """The table of that name, created if needed."""
        return self.tables.setdefault(name, Table(tuple(columns)))


def read_tables(reader: TrafficReader, interpreter: Interpreter) -> SampleTables:
    """Read a whole recording. Raises SessionError."""
    found = SampleTables()
    interpreter.listener = lambda transport, sample: _take_sample(found, interpreter, transport, sample)
    for message in reader.messages():
        transport = schemas.received_transport(message.topic)
        if transport == CAMERA_LINK:
            found.pictures.append((message.stamp_ns, message.data))
        if transport is not None:
            interpreter.on_received(transport, message.data, message.stamp_ns)
        elif message.topic == schemas.SESSION_EVENTS_TOPIC:
            event = SessionEvent.from_bytes(message.data, where=str(reader.path))
            found.table("marks", ("kind",)).add(event.stamp_ns, (event.kind.value,))
            interpreter.event(event)
        elif message.topic in _OTHERS:
            _OTHERS[message.topic](found, message)
    return found


def _take_sample(found: SampleTables, interpreter: Interpreter, transport: str, sample: Any) -> None:
    if transport == HAND_LINK:
        found.table("joints", [f"{name}_rad" for name in JOINTS]).add(sample.stamp_ns, sample.joints_rad)
        for finger, tip in interpreter.perception.fingertips.items():
            if (counts := biotac_counts(tip)) is not None:
                row = [np.nan if value is None else value for value in counts.values()]
                found.table(f"biotac_{finger}", list(counts)).add(sample.stamp_ns, row)
    elif transport == BASE_LINK:
        found.table("base", BASE_JOINTS).add(sample.stamp_ns, sample.q)
    elif transport.startswith("ft/"):
        for one in (reading for reading in sample if isinstance(reading, WrenchSample)):
            row = [*one.wrench, one.sent, one.measured, one.status]
            found.table(f"wrench_{transport[3:]}", WRENCH_COLUMNS).add(one.stamp_ns, row)


def _take_pose(name: str) -> Any:
    def take(found: SampleTables, message: TrafficMessage) -> None:
        pose = json.loads(message.data)["pose"]
        place, turn = pose["position"], pose["orientation"]
        row = [place["x"], place["y"], place["z"], turn["x"], turn["y"], turn["z"], turn["w"]]
        found.table(name, POSE_COLUMNS).add(message.stamp_ns, row)

    return take


def _take_event(found: SampleTables, message: TrafficMessage) -> None:
    content = json.loads(message.data)
    row = (content["level"], content["name"], content["message"])
    found.table("events", ("level", "source", "message")).add(message.stamp_ns, row)


def _take_contacts(found: SampleTables, message: TrafficMessage) -> None:
    content = json.loads(message.data)
    index, touches = told.grasp(content)
    for one in touches:
        row = (index, one.finger, *one.point_world_m, *one.normal_world, one.force_N)
        found.table("contacts", CONTACT_COLUMNS).add(told.stamp_ns(content), row)


_OTHERS: Mapping[str, Any] = {
    schemas.SLAM_POSE_TOPIC: _take_pose("slam_object"),
    schemas.TRUTH_POSE_TOPIC: _take_pose("truth_object"),
    schemas.LOG_TOPIC: _take_event,
    schemas.CONTACTS_TOPIC: _take_contacts,
}
"""Other messages that go into tables, by topic."""
