"""A server of Foxglove's WebSocket protocol (``foxglove.sdk.v1``; before, ``foxglove.websocket.v1``), to watch only.

It announces topics and sends what a viewer subscribes to; whatever else a viewer sends is ignored. A late viewer
is first sent what is still true: the robot, fixed frames, contacts, the newest surface.
"""

from __future__ import annotations

import asyncio
import base64
import contextlib
import json
import struct
from collections import OrderedDict
from collections.abc import Mapping
from http import HTTPStatus
from typing import Any

from websockets.asyncio.server import Server, ServerConnection, serve
from websockets.exceptions import ConnectionClosed
from websockets.http11 import Request, Response
from websockets.typing import Subprotocol

from tactile_lab.viewers.encoded import Encoded, Topic
from tactile_lab.viewers.live.door import Door
from tactile_lab.viewers.live.outbox import Outbox

SUBPROTOCOLS = [Subprotocol("foxglove.sdk.v1"), Subprotocol("foxglove.websocket.v1")]
MOST_VIEWERS = 8
_MESSAGE = struct.Struct("<BIQ")
_MESSAGE_OPCODE, _WARNING = 1, 1
_REQUEST_BYTES = 65_536
_WRITE_BYTES = 65_536
"""Waiting in the socket of a slow viewer, besides its outbox."""


class Viewer:
    """One connection: what it subscribed to, and what it has still to be sent."""

    def __init__(self, connection: ServerConnection) -> None:
        self.connection, self.outbox = connection, Outbox()
        self.subscriptions: dict[int, int] = {}
        """Topic's number by the viewer's own number."""
        self._told = 0

    def send(self, number: int, message: Encoded) -> None:
        """Queue a message for each subscription to its topic."""
        key = None if message.key is None else (message.topic.name, message.key)
        for subscription, topic in self.subscriptions.items():
            if topic == number:
                head = _MESSAGE.pack(_MESSAGE_OPCODE, subscription, message.stamp_ns)
                self.outbox.put(head + message.data, None if key is None else (f"{subscription}{key[0]}", key[1]))

    async def write(self) -> None:
        """Send until the connection ends; no other viewer waits for this one."""
        while True:
            frame = await self.outbox.take()
            if frame[:1] == b"{":
                await self.connection.send(frame.decode())
            else:
                await self.connection.send(frame)
            if self.outbox.left_out >= 2 * self._told + 1:
                self._told = self.outbox.left_out
                text = f"This viewer is slower than the session: {self._told} messages were left out; all are recorded."
                await self.connection.send(
                    json.dumps({"op": "status", "level": _WARNING, "message": text, "id": "slow"})
                )


class LiveServer:
    """Topics, their lasting messages, and those who watch.

    Args:
        door: decides who may.
        title: shown by viewers.
    """

    def __init__(self, door: Door, title: str) -> None:
        self._door, self._title = door, title
        self._viewers: set[Viewer] = set()
        self._topics: dict[str, tuple[int, Topic]] = {}
        self._lasting: dict[int, OrderedDict[str, Encoded]] = {}

    def listen(self, address: str, port: int) -> serve:
        """The server as an asynchronous context, to be entered. Raises OSError there if the address is taken."""
        return serve(
            self._attend,
            address,
            port,
            subprotocols=SUBPROTOCOLS,
            process_request=self._check,
            compression=None,
            max_size=_REQUEST_BYTES,
            write_limit=_WRITE_BYTES,
            server_header=None,
        )

    def publish(self, message: Encoded) -> None:
        """Queue a message for everyone who wants it, and keep it for those who come later if it lasts."""
        number = self._number(message.topic)
        if message.key is not None:
            kept = self._lasting.setdefault(number, OrderedDict())
            kept.pop(message.key, None)  # what undoes something stands behind it
            kept[message.key] = message
        for viewer in self._viewers:
            viewer.send(number, message)

    def _number(self, topic: Topic) -> int:
        """A topic's number; a new topic is announced."""
        if topic.name not in self._topics:
            number = len(self._topics) + 1
            self._topics[topic.name] = (number, topic)
            for viewer in self._viewers:
                viewer.outbox.put(_announcement({number: topic}), ("", f"announce {number}"))
        return self._topics[topic.name][0]

    def _check(self, connection: ServerConnection, request: Request) -> Response | None:
        problem = self._door.problem(request.path, request.headers.get("Origin"))
        if not problem and len(self._viewers) >= MOST_VIEWERS:
            return connection.respond(HTTPStatus.SERVICE_UNAVAILABLE, f"{MOST_VIEWERS} viewers watch already.\n")
        return connection.respond(HTTPStatus.FORBIDDEN, problem + "\n") if problem else None

    async def _attend(self, connection: ServerConnection) -> None:
        """One viewer, from its first message to its end."""
        viewer = Viewer(connection)
        info = {"op": "serverInfo", "name": self._title, "capabilities": [], "supportedEncodings": [], "metadata": {}}
        viewer.outbox.put(json.dumps({**info, "sessionId": self._title}).encode(), ("", "info"))
        viewer.outbox.put(_announcement(dict(self._topics.values())), ("", "announce"))
        self._viewers.add(viewer)
        writing = asyncio.create_task(viewer.write())
        try:
            async for request in connection:
                if isinstance(request, str):
                    self._take(viewer, request)
        except ConnectionClosed:
            pass  # it went without a farewell
        finally:
            self._viewers.discard(viewer)
            writing.cancel()
            with contextlib.suppress(asyncio.CancelledError, ConnectionClosed):
                await writing

    def _take(self, viewer: Viewer, text: str) -> None:
        """Process a request; one that is invalid, or asks for more than to watch, is ignored."""
        with contextlib.suppress(ValueError, KeyError, TypeError, AttributeError, OverflowError, RecursionError):
            content = json.loads(text)
            if content["op"] == "subscribe":
                for one in content["subscriptions"]:
                    self._subscribe(viewer, int(one["id"]), int(one["channelId"]))
            elif content["op"] == "unsubscribe":
                for number in content["subscriptionIds"]:
                    viewer.subscriptions.pop(int(number), None)

    def _subscribe(self, viewer: Viewer, subscription: int, number: int) -> None:
        if not 0 <= subscription < 1 << 32 or len(viewer.subscriptions) > 4 * len(self._topics):
            return
        viewer.subscriptions[subscription] = number
        for message in self._lasting.get(number, {}).values():
            viewer.send(number, message)


def _announcement(topics: Mapping[int, Topic]) -> bytes:
    channels: list[dict[str, Any]] = [
        {
            "id": number,
            "topic": topic.name,
            "encoding": topic.encoding,
            "schemaName": topic.schema.name,
            "schemaEncoding": topic.schema.encoding,
            "schema": _definition(topic),
        }
        for number, topic in topics.items()
    ]
    return json.dumps({"op": "advertise", "channels": channels}).encode()


def _definition(topic: Topic) -> str:
    """Binary definitions in base64, others as they are."""
    if topic.schema.encoding == "protobuf":
        return base64.b64encode(topic.schema.definition).decode()
    return topic.schema.definition.decode()


def port_of(server: Server) -> int:
    """Where a server listens."""
    return int(next(iter(server.sockets)).getsockname()[1])
