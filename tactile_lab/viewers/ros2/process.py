"""The bridge's process: reads settings and messages from standard input, writes requests to standard output.

It ends with its input, so that no node outlives its program.
"""

from __future__ import annotations

import base64
import json
import os
import sys
import time
from collections.abc import Mapping
from functools import partial
from typing import Any

from drivers.core.child_process import failure
from drivers.core.errors import TactileLabError
from sessions.recording.traffic import schemas
from tactile_lab.viewers.ros2.conversion import Conversion
from tactile_lab.viewers.ros2.feed import STATE_TOPIC
from tactile_lab.viewers.ros2.node import NODE, Node, Reach
from tactile_lab.viewers.ros2.opening import open_node
from tactile_lab.viewers.ros2.services import SERVICES, Services


def main() -> int:
    """Bridge until the input ends. Returns the exit code."""
    settings = json.loads(sys.stdin.buffer.readline())
    try:
        conversion = Conversion(settings["rig"], time.time_ns)
        node = open_node(Reach(settings["domain"], settings["network"]))
    except TactileLabError as error:
        _say({"problem": str(error), "exit_code": error.exit_code})
        return error.exit_code
    except Exception as error:
        _say({"problem": failure(error)})
        return 1
    services = Services(_say)
    for name in SERVICES:
        node.serve(name, partial(services.call, name))
    _say({"url": f"node /{NODE} on domain {settings['domain']}"})
    try:
        for line in sys.stdin.buffer:
            _take(json.loads(line), conversion, services, node)
    finally:
        node.close()
    return 0


def _take(message: Mapping[str, Any], conversion: Conversion, services: Services, node: Node) -> None:
    """One message of the session."""
    topic, data = message["topic"], base64.b64decode(message["data"])
    if topic == STATE_TOPIC:
        services.on_state(data)
        conversion.begin_session()
    elif topic == schemas.GUIDE_TOPIC:
        services.on_panel(data)
    else:
        for one in conversion.of(topic, data, int(message["stamp_ns"])):
            node.publish(one.topic, one.kind, one.data, lasting=one.lasting)


def _say(content: Mapping[str, Any]) -> None:
    """Write one line of JSON to standard output."""
    os.write(1, json.dumps(content).encode() + b"\n")


if __name__ == "__main__":
    sys.exit(main())
