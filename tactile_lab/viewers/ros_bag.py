"""A session as a ROS 2 bag: frames, markers and clouds for RViz, and all samples; written and read without ROS."""

from __future__ import annotations

import shutil
from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path
from typing import Any

from drivers.core.errors import ConfigurationError, WriteError
from drivers.core.installed.extras import require_package
from drivers.shadow.model.kinematics import JOINTS
from sessions.exchange.sample_tables import SampleTables
from tactile_lab.viewers.items import Frames, Item
from tactile_lab.viewers.robot import POSITIONER_JOINTS, Robot
from tactile_lab.viewers.ros_messages import JOINT_STATE, TEXT, WRENCH, RosMessages

LASTING = ("/tf_static", "/robot_description")
"""Topics whose last message those who come later need too: their durability is transient local."""
_IN_ITEMS = ("slam_object", "truth_object")
"""Tables that the items hold with more than the tables."""

_Message = tuple[str, str, int, Any]


def write_ros_bag(folder: Path, robot: Robot, items: Iterable[Item], tables: SampleTables) -> int:
    """Write a bag into a new folder; nothing is left of one that cannot be completed. Returns the number of messages.

    Args:
        robot: of the session.
        items: what viewers show.
        tables: all samples: joints and wrenches at full rate, and data without a type of ROS as JSON in a ``String``.

    Raises:
        ConfigurationError: rosbags is not installed, or the folder exists.
        WriteError: the folder cannot be written.
    """
    require_package("rosbags")
    from rosbags.rosbag2 import WriterError
    from rosbags.typesys import Stores, get_typestore

    if folder.exists():
        raise ConfigurationError("exists already", where=str(folder), hint="Choose a new folder")
    store = get_typestore(Stores.ROS2_JAZZY)
    make = RosMessages(store.types, robot)
    partial = folder.with_name(f".{folder.name}.part")  # the files inside are named after the bag's own folder
    try:
        partial.mkdir()
        count = _write(partial / folder.name, store, _in_order(make, robot, items, tables))
        (partial / folder.name).replace(folder)
    except (OSError, WriterError) as error:
        raise WriteError(f"cannot be written ({error})", where=str(folder), hint="Choose a new folder") from error
    finally:
        shutil.rmtree(partial, ignore_errors=True)
    return count


def _write(folder: Path, store: Any, messages: Sequence[_Message]) -> int:
    from rosbags.interfaces import Qos, QosDurability, QosHistory, QosLiveliness, QosReliability, QosTime
    from rosbags.rosbag2 import Writer

    endless = QosTime(2**31 - 1, 2**31 - 1)
    latched = Qos(
        QosHistory.KEEP_LAST,
        10,
        QosReliability.RELIABLE,
        QosDurability.TRANSIENT_LOCAL,
        endless,
        endless,
        QosLiveliness.AUTOMATIC,
        endless,
        False,
    )
    with Writer(folder, version=9) as bag:
        connections: dict[str, Any] = {}
        for topic, kind, stamp_ns, message in messages:
            if topic not in connections:
                offered = [latched] if topic in LASTING else []
                connections[topic] = bag.add_connection(topic, kind, typestore=store, offered_qos_profiles=offered)
            bag.write(connections[topic], stamp_ns, store.serialize_cdr(message, kind))
    return len(messages)


def _in_order(make: RosMessages, robot: Robot, items: Iterable[Item], tables: SampleTables) -> list[_Message]:
    """Everything, oldest first; frames that never move are known from the beginning."""
    found: list[_Message] = []
    begin_ns: int | None = None
    for item in items:
        if begin_ns is None:
            begin_ns = item.stamp_ns
            found += make.description(begin_ns)
        if isinstance(item, Frames) and item.lasting:
            item = Frames(begin_ns, item.placements, lasting=True)
        found += make.of(item)
    found += _rows(make, robot, tables)
    return sorted(found, key=lambda message: message[2])


def _rows(make: RosMessages, robot: Robot, tables: SampleTables) -> Iterator[_Message]:
    for name, table in tables.tables.items():
        if name in _IN_ITEMS:
            continue
        for stamp_ns, row in zip(table.stamps_ns, table.rows, strict=True):
            if name in ("joints", "base"):
                told = _joints(robot, name, row)
                yield (
                    "/joint_states",
                    JOINT_STATE,
                    stamp_ns,
                    make.joint_state(stamp_ns, list(told), list(told.values())),
                )
            elif name.startswith("wrench_"):
                finger = name.removeprefix("wrench_")
                yield f"/ft/{finger}/wrench", WRENCH, stamp_ns, make.wrench(stamp_ns, finger, row)
            else:
                yield "/" + name.replace("_", "/"), TEXT, stamp_ns, make.text(table.columns, row)


def _joints(robot: Robot, table: str, row: Sequence[Any]) -> dict[str, float]:
    """A row by the names of the robot's description, of the joints that it has."""
    names = POSITIONER_JOINTS if table == "base" else [robot.prefix + name for name in JOINTS]
    known = robot.moving_joints
    return {name: float(value) for name, value in zip(names, row, strict=True) if name in known}
