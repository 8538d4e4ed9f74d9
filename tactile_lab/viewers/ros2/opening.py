"""Opens a node of ROS 2 by whichever library there is."""

from __future__ import annotations

from importlib.util import find_spec

from drivers.core.installed.extras import require_package
from tactile_lab.viewers.ros2.node import Node, Reach


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
        ConfigurationError: neither is installed, or the node cannot be opened.
    """
    require_ros2()
    if has_rclpy():
        from tactile_lab.viewers.ros2.rclpy_node import RclpyNode

        return RclpyNode(reach)
    from tactile_lab.viewers.ros2.dds_node import DdsNode

    return DdsNode(reach)
