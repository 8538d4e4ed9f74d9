"""A node without ROS: topics and services of ROS 2 by Cyclone DDS, which pip installs.

Topics are read by every ROS 2. The services are those of ``rmw_cyclonedds_cpp``: other middlewares number requests in
another place.
"""

from __future__ import annotations

import threading
from typing import Any

from cyclonedds.core import DDSException, Policy, Qos
from cyclonedds.domain import Domain, DomainParticipant
from cyclonedds.pub import DataWriter
from cyclonedds.sub import DataReader
from cyclonedds.topic import Topic
from cyclonedds.util import duration

from drivers.core.errors import ConfigurationError
from tactile_lab.viewers.ros2.dds_types import TriggerReply, TriggerRequest, message_type, type_hash
from tactile_lab.viewers.ros2.node import NODE, Answer, Reach

LOOPBACK = (
    "<CycloneDDS><Domain><General><Interfaces><NetworkInterface address='127.0.0.1'/></Interfaces>"
    "<AllowMulticast>false</AllowMulticast></General><Discovery><ParticipantIndex>auto</ParticipantIndex>"
    "<Peers><Peer address='127.0.0.1'/></Peers></Discovery></Domain></CycloneDDS>"
)
"""Cyclone's configuration of a node that this computer alone sees."""

_DEPTH, _AT_ONCE, _LOOK_s = 10, 10, 0.02
_PLAIN_CDR = Policy.DataRepresentation(use_cdrv0_representation=True)


def quality(*, lasting: bool = False, kind: str = "") -> Qos:
    """ROS 2's default quality of service; transient local where it lasts, with the type's hash if it is given."""
    durability = Policy.Durability.TransientLocal if lasting else Policy.Durability.Volatile
    policies: list[Any] = [Policy.Reliability.Reliable(duration(milliseconds=100)), durability, _PLAIN_CDR]
    policies.append(Policy.History.KeepLast(1 if lasting else _DEPTH))  # so that no writer ever waits for a reader
    if kind:
        policies.append(Policy.Userdata(f"typehash={type_hash(kind)};".encode()))
    return Qos(*policies)


class DdsNode:
    """See :class:`~tactile_lab.viewers.ros2.node.Node`.

    Args:
        reach: who can see it. A configuration of Cyclone's own (``CYCLONEDDS_URI``) is heeded for the network alone.

    Raises:
        ConfigurationError: DDS cannot be opened.
    """

    def __init__(self, reach: Reach) -> None:
        try:
            self._domain = None if reach.network else Domain(reach.domain, LOOPBACK)
            self._participant = DomainParticipant(reach.domain)
        except DDSException as error:
            hint = "Choose another --domain, or check the network's configuration"
            raise ConfigurationError(f"DDS cannot be opened ({error})", where="ros2", hint=hint) from error
        self._writers: dict[str, DataWriter[Any]] = {}
        self._services: list[tuple[DataReader[Any], DataWriter[Any], Answer]] = []
        self._lock, self._ended = threading.Lock(), threading.Event()
        self._thread = threading.Thread(target=self._answer, name="ros2 services", daemon=True)
        self._thread.start()

    def publish(self, topic: str, kind: str, data: bytes, *, lasting: bool) -> None:
        """Publish a message, without waiting."""
        if topic not in self._writers:
            described = Topic(self._participant, f"rt{topic}", message_type(kind))
            self._writers[topic] = DataWriter(self._participant, described, quality(lasting=lasting, kind=kind))
        self._writers[topic].write(_Serialized.of(kind, data))

    def serve(self, name: str, answer: Answer) -> None:
        """Answer a service."""
        asked = Topic(self._participant, f"rq/{NODE}/{name}Request", TriggerRequest)
        replied = Topic(self._participant, f"rr/{NODE}/{name}Reply", TriggerReply)
        reader = DataReader(self._participant, asked, quality())
        with self._lock:
            self._services.append((reader, DataWriter(self._participant, replied, quality()), answer))

    def close(self) -> None:
        """Leave the graph."""
        self._ended.set()
        self._thread.join(1.0)
        self._services.clear()
        self._writers.clear()
        del self._participant, self._domain

    def _answer(self) -> None:
        """Thread: looks for requests."""
        while not self._ended.wait(_LOOK_s):
            with self._lock:
                services = list(self._services)
            for reader, writer, answer in services:
                for request in reader.take(_AT_ONCE):
                    if not isinstance(request, TriggerRequest):
                        continue  # it says that a client has left
                    success, text = answer()
                    writer.write(TriggerReply(request.client, request.number, success, text))


class _Serialized:
    """Messages that are serialized already."""

    @staticmethod
    def of(kind: str, data: bytes) -> Any:
        """A message of the type, whose bytes are given."""
        described = message_type(kind)
        message = described.__new__(described)
        message.serialize = lambda **_: data
        return message
