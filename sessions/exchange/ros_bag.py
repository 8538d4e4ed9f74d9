"""Tables of samples as a ROS 2 bag, with ROS's own message types; written and read without ROS."""

from __future__ import annotations

import json
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from drivers.core.clock import NANOSECONDS
from drivers.core.errors import SessionError
from drivers.core.installed.extras import require_package
from sessions.exchange.sample_tables import SampleTables
from sessions.exchange.table_files import picture_suffix, rows_of

_JOINT_STATE, _WRENCH = "sensor_msgs/msg/JointState", "geometry_msgs/msg/WrenchStamped"
_POSE, _PICTURE, _TEXT = "geometry_msgs/msg/PoseStamped", "sensor_msgs/msg/CompressedImage", "std_msgs/msg/String"


def write_ros_bag(tables: SampleTables, folder: Path) -> int:
    """Write a bag into a new folder. Returns the number of messages.

    Joints and base become ``JointState``, wrenches ``WrenchStamped``, poses ``PoseStamped``, pictures
    ``CompressedImage``; data without a ROS type (BioTac counts, contacts, session events, log events) become JSON in a
    ``String``.

    Raises:
        ConfigurationError: rosbags is not installed.
        SessionError: the folder exists or cannot be written.
    """
    require_package("rosbags")
    from rosbags.rosbag2 import Writer, WriterError
    from rosbags.typesys import Stores, get_typestore

    store = get_typestore(Stores.ROS2_JAZZY)
    make = _Messages(store.types)
    try:
        with Writer(folder, version=9) as bag:
            for topic, kind, stamp_ns, message in make.in_order(tables):
                connection = next((one for one in bag.connections if one.topic == topic), None)
                connection = connection or bag.add_connection(topic, kind, typestore=store)
                bag.write(connection, stamp_ns, store.serialize_cdr(message, kind))
    except (OSError, WriterError) as error:
        raise SessionError(f"cannot be written ({error})", where=str(folder), hint="Choose a new folder") from error
    return rows_of(tables)


class _Messages:
    """Converts samples to ROS messages."""

    def __init__(self, types: Any) -> None:
        self._types = types

    def in_order(self, tables: SampleTables) -> list[tuple[str, str, int, Any]]:
        """Topic, type, stamp and message of everything, oldest first."""
        found = []
        for name, table in tables.tables.items():
            topic, kind, make = self._maker(name, table.columns)
            rows = zip(table.stamps_ns, table.rows, strict=True)
            found += [(topic, kind, stamp_ns, make(stamp_ns, row)) for stamp_ns, row in rows]
        for stamp_ns, content in tables.pictures:
            found.append(("/camera/image/compressed", _PICTURE, stamp_ns, self._picture(stamp_ns, content)))
        return sorted(found, key=lambda item: item[2])

    def _maker(self, name: str, columns: Sequence[str]) -> tuple[str, str, Callable[[int, Sequence[Any]], Any]]:
        if name in ("joints", "base"):
            names = [column.removesuffix("_rad").removesuffix("_m") for column in columns]
            return f"/{name}", _JOINT_STATE, lambda stamp_ns, row: self._joints(stamp_ns, names, row)
        if name.startswith("wrench_"):
            finger = name.removeprefix("wrench_")
            return f"/ft/{finger}/wrench", _WRENCH, lambda stamp_ns, row: self._wrench(stamp_ns, finger, row)
        if name in ("slam_object", "truth_object"):
            return "/" + name.replace("_", "/"), _POSE, self._pose
        return "/" + name.replace("_", "/"), _TEXT, lambda stamp_ns, row: self._text(columns, row)

    def _header(self, stamp_ns: int, frame: str) -> Any:
        stamp = self._types["builtin_interfaces/msg/Time"](stamp_ns // NANOSECONDS, stamp_ns % NANOSECONDS)
        return self._types["std_msgs/msg/Header"](stamp, frame)

    def _vector(self, values: Sequence[Any]) -> Any:
        return self._types["geometry_msgs/msg/Vector3"](*(float(value) for value in values))

    def _joints(self, stamp_ns: int, names: list[str], row: Sequence[Any]) -> Any:
        none = np.zeros(0)
        position = np.array(row, dtype=np.float64)
        return self._types[_JOINT_STATE](self._header(stamp_ns, ""), names, position, none, none)

    def _wrench(self, stamp_ns: int, finger: str, row: Sequence[Any]) -> Any:
        wrench = self._types["geometry_msgs/msg/Wrench"](self._vector(row[:3]), self._vector(row[3:6]))
        return self._types[_WRENCH](self._header(stamp_ns, f"{finger}/sensor"), wrench)

    def _pose(self, stamp_ns: int, row: Sequence[Any]) -> Any:
        place = self._types["geometry_msgs/msg/Point"](*(float(value) for value in row[:3]))
        turn = self._types["geometry_msgs/msg/Quaternion"](*(float(value) for value in row[3:7]))
        return self._types[_POSE](self._header(stamp_ns, "world"), self._types["geometry_msgs/msg/Pose"](place, turn))

    def _picture(self, stamp_ns: int, content: bytes) -> Any:
        kind = picture_suffix(content).removeprefix(".").replace("jpg", "jpeg")
        return self._types[_PICTURE](self._header(stamp_ns, "camera"), kind, np.frombuffer(content, np.uint8))

    def _text(self, columns: Sequence[str], row: Sequence[Any]) -> Any:
        plain = [value.item() if isinstance(value, np.generic) else value for value in row]
        return self._types[_TEXT](json.dumps(dict(zip(columns, plain, strict=True))))
