"""What a bridge needs of ROS 2: to publish serialized messages, and to answer services without arguments."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Protocol, TypeAlias

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
