"""The session's end of the bridge: copies of messages out, requests in. A slow or dead bridge delays no cycle."""

from __future__ import annotations

import json
import threading
from collections import deque
from collections.abc import Mapping, Sequence
from typing import Any

from drivers.core.errors import ProcessError
from sessions.guided.operator import Ask, Panel, Request, request_of
from sessions.recording.traffic import schemas
from tactile_lab.process_feed import ProcessFeed
from tactile_lab.viewers.ros2.node import Reach
from tactile_lab.viewers.ros2.services import START
from tactile_lab.viewers.story import TRUTH_TOPICS, is_shown

STATE_TOPIC = "/bridge/state"
"""Tells the bridge whether a session runs."""

_ALLOWED = frozenset({Ask.END, Ask.CAPTURE, Ask.UNDO, Ask.NEXT, Ask.GO, Ask.PAUSE})
_PENDING = 50


class Ros2Feed(ProcessFeed):
    """A node of ROS 2 that shows sessions, and takes requests; an operator of them.

    Args:
        rig: its name or file.
        reach: who can see the node.
    """

    attended = False

    def __init__(self, rig: str, reach: Reach) -> None:
        settings = {"rig": rig, "domain": reach.domain, "network": reach.network}
        hint = "Check the packages (extra [ros]), or choose another --domain"
        super().__init__("tactile_lab.viewers.ros2.process", settings, name="ros2", hint=hint)
        self._started = threading.Event()
        self._asked: deque[Request] = deque(maxlen=_PENDING)

    def is_shown(self, topic: str, data: bytes) -> bool:
        told = topic in (STATE_TOPIC, schemas.GUIDE_TOPIC) or is_shown(topic)
        return told and topic not in TRUTH_TOPICS

    def on_press(self, content: Mapping[str, Any]) -> None:
        """Store an allowed request. Raises ValueError for anything else."""
        if content.get("ask") == START:
            self._started.set()
        elif (request := request_of(content)).ask in _ALLOWED:
            self._asked.append(request)

    def wait_for_start(self, patience_s: float) -> bool:
        """Whether a session is to begin; waits for this time at most.

        Raises:
            ProcessError: the bridge's process has ended.
        """
        if self._started.wait(patience_s):
            return True
        if not self.running:
            hint = "Start the bridge again"
            raise ProcessError("the process of the bridge has ended", where="ros2", hint=hint)
        return False

    def begin(self, *, guided: bool) -> None:
        """A session begins; requests from before it are forgotten."""
        self._asked.clear()
        self._tell(running=True, guided=guided)

    def end(self) -> None:
        """The session has ended: another may be started."""
        self._started.clear()
        self._tell(running=False, guided=False)

    def requests(self) -> Sequence[Request]:
        """Requests since the last call."""
        requests = []
        while self._asked:
            requests.append(self._asked.popleft())
        return requests

    def show(self, panel: Panel) -> None:
        """Nothing to do: the bridge reads the recorded panels."""

    def _tell(self, **state: bool) -> None:
        self.write(STATE_TOPIC, json.dumps(state).encode(), 0)
