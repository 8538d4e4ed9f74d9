"""The live server's process: reads settings and messages from standard input, says its address on standard output.

It ends with its input, so that no server outlives its session.
"""

from __future__ import annotations

import asyncio
import base64
import json
import os
import sys
import threading
from collections.abc import Iterator
from typing import Any

from drivers.core.child_process import failure
from drivers.core.errors import ConfigurationError, TactileLabError, refusal
from tactile_lab.rigs.description import load_rig
from tactile_lab.viewers.camera_pose import camera_of_rig
from tactile_lab.viewers.encoded import Encoded
from tactile_lab.viewers.foxglove_messages import FoxgloveMessages
from tactile_lab.viewers.live.door import Door
from tactile_lab.viewers.live.server import LiveServer, port_of
from tactile_lab.viewers.robot_of_rig import robot_of_rig
from tactile_lab.viewers.story import Story


def main() -> int:
    """Serve until the input ends. Returns the exit code."""
    settings = json.loads(sys.stdin.buffer.readline())
    try:
        asyncio.run(_serve(settings))
    except TactileLabError as error:
        _say(problem=str(error), exit_code=error.exit_code)
        return error.exit_code
    except Exception as error:
        _say(problem=failure(error))
        return 1
    return 0


class Conversion:
    """From a session's messages to those of viewers.

    Args:
        rig: its name or file.
    """

    def __init__(self, rig: str) -> None:
        found = load_rig(rig)
        robot = robot_of_rig(found)
        self._story, self._make = Story(robot, camera_of_rig(found)), FoxgloveMessages(robot)
        self._begun = False

    def of(self, topic: str, data: bytes, stamp_ns: int) -> Iterator[Encoded]:
        """The messages for viewers; before the first of them what never changes."""
        if not self._begun:
            self._begun = True
            yield from self._make.begin(stamp_ns)
            for item in self._story.begin(stamp_ns):
                yield from self._make.of(item)
        for item in self._story.message(topic, data, stamp_ns):
            yield from self._make.of(item)


async def _serve(settings: dict[str, Any]) -> None:
    conversion = Conversion(settings["rig"])
    server = LiveServer(Door(settings["token"], settings["origin"]), settings["title"])
    ended, loop = asyncio.Event(), asyncio.get_running_loop()
    try:
        async with server.listen(settings["address"], settings["port"]) as listening:
            port = port_of(listening)
            _say(url=f"ws://{settings['address']}:{port}/?token={settings['token']}")
            reader = threading.Thread(target=_read, args=(conversion, server, loop, ended), daemon=True)
            reader.start()
            await ended.wait()
    except OSError as error:
        what = f"cannot listen on {settings['address']}:{settings['port']} ({refusal(error)})"
        raise ConfigurationError(what, hint="Choose another --live-port") from error


def _read(conversion: Conversion, server: LiveServer, loop: asyncio.AbstractEventLoop, ended: asyncio.Event) -> None:
    """Thread: converts what the session sends, and hands it to the server, one message at a time."""
    try:
        for line in sys.stdin.buffer:
            message = json.loads(line)
            encoded = list(conversion.of(message["topic"], base64.b64decode(message["data"]), int(message["stamp_ns"])))
            asyncio.run_coroutine_threadsafe(_publish(server, encoded), loop).result()
    finally:
        loop.call_soon_threadsafe(ended.set)


async def _publish(server: LiveServer, messages: list[Encoded]) -> None:
    for message in messages:
        server.publish(message)


def _say(**content: Any) -> None:
    """Write one line of JSON to standard output."""
    os.write(1, json.dumps(content).encode() + b"\n")


if __name__ == "__main__":
    sys.exit(main())
