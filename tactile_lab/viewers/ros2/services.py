"""The services of the bridge: who may ask for what when, and the sentence that is answered."""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping
from typing import Any

from sessions.guided.operator import Ask

START = "start"
SERVICES: Mapping[str, str] = {
    START: "begin a session",
    "stop": "end it after this grasp",
    "capture": "measure the grasp that the hand holds",
    "undo": "undo the last grasp",
    "next": "the person has done this step",
    "go": "let the rig do this step",
    "pause": "pause, or resume",
}
"""Names of the services below the node, with what each does."""

_ASKS = {"stop": Ask.END, **{ask.value: ask for ask in (Ask.CAPTURE, Ask.UNDO, Ask.NEXT, Ask.GO, Ask.PAUSE)}}
_STEPS = frozenset({"capture", "next", "go"})
"""Of guided sessions, and possible at some stages alone."""


class Services:
    """Answers at once, from the session's last state; accepted requests are sent to the session.

    Args:
        send: takes a request as plain data.
    """

    def __init__(self, send: Callable[[Mapping[str, Any]], None]) -> None:
        self._send = send
        self._running = self._guided = False
        self._stage, self._asks = "", frozenset[str]()

    def on_state(self, data: bytes) -> None:
        """A session began or ended."""
        content = json.loads(data)
        self._running, self._guided = bool(content["running"]), bool(content["guided"])
        self._stage, self._asks = "", frozenset()

    def on_panel(self, data: bytes) -> None:
        """A guided session shows another stage."""
        content = json.loads(data)
        self._stage, self._asks = str(content["stage"]), frozenset(content["asks"])

    def call(self, name: str) -> tuple[bool, str]:
        """A service was called: whether it is accepted, and a sentence."""
        if refusal := self._refusal(name):
            return False, refusal
        if name == START:
            self._running = True  # until the session says so itself: two calls start one session
            self._send({"ask": START})
        else:
            self._send({"ask": _ASKS[name].value, "text": "by a client of ROS 2" if name == "stop" else ""})
        return True, f"asked to {SERVICES[name]}"

    def _refusal(self, name: str) -> str:
        """Why a call is refused; "" if it is accepted."""
        if name == START:
            return "a session is running: stop it first" if self._running else ""
        if not self._running:
            return "no session is running: start one first"
        if name in _STEPS and not self._guided:
            return "the program decides in this session: --mode guided lets a person decide"
        if name in _STEPS and name not in self._asks:
            return (
                f"not at this stage ({self._stage or 'begin'}): possible are {', '.join(sorted(self._asks)) or 'none'}"
            )
        return ""
