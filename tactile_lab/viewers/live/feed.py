"""The session's end of the live server: copies of messages out, nothing in."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from tactile_lab.process_feed import ProcessFeed
from tactile_lab.viewers.story import TRUTH_TOPICS, is_shown


class LiveFeed(ProcessFeed):
    """A server for viewers of a running session; they watch only, and do not see the truth.

    Args:
        rig: its name or file.
        address, port: where it listens; port 0: any free port.
        token: that viewers must give.
        title: shown by viewers.
        origin: of one more web application that may connect; "" for none.
    """

    def __init__(self, rig: str, address: str, port: int, token: str, title: str, origin: str = "") -> None:
        settings = {"rig": rig, "address": address, "port": port, "token": token, "title": title, "origin": origin}
        hint = "Choose another --live-port, or run without --live"
        super().__init__("tactile_lab.viewers.live.process", settings, name="live", hint=hint)

    def is_shown(self, topic: str, data: bytes) -> bool:
        return topic not in TRUTH_TOPICS and is_shown(topic)

    def on_press(self, content: Mapping[str, Any]) -> None:
        """The server asks for nothing."""
