"""What a bridge needs of ROS 2: to publish serialized messages, and to answer services without arguments."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from importlib.util import find_spec
from typing import Protocol, TypeAlias

from drivers.core.installed.extras import require_package

NODE = "tactile_lab"

Answer: TypeAlias = Callable[[], tuple[bool, str]]
"""Answers a ``std_srvs/srv/Trigger``: success, and a sentence. Called in a thread of the node."""


@dataclass(frozen=True)
class Reach:
    """Who can see the node.

    Attributes:
        domain: ROS 2's domain.
        network: other computers as well; otherwise this one alone.
    """

    domain: int
    network: bool = False


class Node(Protocol):
    """A node of ROS 2."""

    def publish(self, topic: str, kind: str, data: bytes, *, lasting: bool) -> None:
        """Publish a message in little-endian CDR, without waiting; ``lasting`` ones reach those who come later."""

    def serve(self, name: str, answer: Answer) -> None:
        """Answer a service of type ``std_srvs/srv/Trigger``."""

    def close(self) -> None:
        """Leave the graph."""


def has_rclpy() -> bool:
    """Whether this Python has ROS 2's own library."""
    return find_spec("rclpy") is not None


def require_ros2() -> None:
    """Check that a node can be opened. Raises ConfigurationError without rosbags, or without both rclpy and Cyclone."""
    require_package("rosbags")
    if not has_rclpy():
        require_package("cyclonedds")


def open_node(reach: Reach) -> Node:
    """A node by ROS 2's own library where there is one, by Cyclone DDS elsewhere.

    Raises:
        ConfigurationError: neither is installed.
        DeviceError: the node cannot be opened.
    """
    require_ros2()
    if has_rclpy():
        from tactile_lab.viewers.ros2.rclpy_node import RclpyNode

        return RclpyNode(reach)
    from tactile_lab.viewers.ros2.dds_node import DdsNode

    return DdsNode(reach)
