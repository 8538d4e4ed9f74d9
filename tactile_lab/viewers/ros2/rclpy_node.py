"""A node by ROS 2's own library, where the program runs in an environment of ROS."""

from __future__ import annotations

import os
import threading
from importlib import import_module
from typing import Any

from tactile_lab.viewers.ros2.node import NODE, Answer, Reach

_DEPTH = 10


class RclpyNode:
    """See :class:`~tactile_lab.viewers.ros2.node.Node`.

    Args:
        reach: who can see it. ROS 2's own variables for that win where they are set.
    """

    def __init__(self, reach: Reach) -> None:
        if not reach.network:
            os.environ.setdefault("ROS_AUTOMATIC_DISCOVERY_RANGE", "LOCALHOST")
        rclpy, executors = import_module("rclpy"), import_module("rclpy.executors")
        self._context = import_module("rclpy.context").Context()
        rclpy.init(context=self._context, domain_id=reach.domain)
        self._node = rclpy.create_node(NODE, context=self._context)
        self._publishers: dict[str, Any] = {}
        self._executor = executors.SingleThreadedExecutor(context=self._context)
        self._executor.add_node(self._node)
        self._thread = threading.Thread(target=self._executor.spin, name="rclpy", daemon=True)
        self._thread.start()

    def publish(self, topic: str, kind: str, data: bytes, *, lasting: bool) -> None:
        """Publish a message; bytes are taken as serialized."""
        if topic not in self._publishers:
            self._publishers[topic] = self._node.create_publisher(_class(kind), topic, _quality(lasting))
        self._publishers[topic].publish(data)

    def serve(self, name: str, answer: Answer) -> None:
        """Answer a service."""

        def on_request(request: Any, response: Any) -> Any:
            response.success, response.message = answer()
            return response

        self._node.create_service(_class("std_srvs/srv/Trigger"), f"/{NODE}/{name}", on_request)

    def close(self) -> None:
        """Leave the graph."""
        self._executor.shutdown()
        self._node.destroy_node()
        self._context.try_shutdown()
        self._thread.join(1.0)


def _class(kind: str) -> Any:
    """The class of a type such as ``std_msgs/msg/String``."""
    package, group, name = kind.split("/")
    return getattr(import_module(f"{package}.{group}"), name)


def _quality(lasting: bool) -> Any:
    """Reliable, and transient local where it lasts."""
    qos = import_module("rclpy.qos")
    durability = qos.DurabilityPolicy.TRANSIENT_LOCAL if lasting else qos.DurabilityPolicy.VOLATILE
    return qos.QoSProfile(depth=1 if lasting else _DEPTH, durability=durability)
