"""Runs the page in a separate process and exchanges messages with it without waiting."""

from __future__ import annotations

from typing import Literal

from drivers.camera.packet import picture_of
from tactile_lab.process_feed import ProcessFeed
from tactile_lab.view.scene import CAMERA_PACKETS, SHOWN_TOPICS


class PageTransport(ProcessFeed):
    """Starts a page, sends it messages and receives its requests.

    Args:
        panel: which buttons the page has.
        address, port: where the page listens; port 0: any free port.
        token: access token; "" for none, on the loopback interface only.
        title: of the page.
        certificate: PEM file with a certificate and its key; "" for no encryption.
    """

    def __init__(
        self,
        panel: Literal["session", "wizard"],
        address: str,
        port: int,
        token: str,
        title: str,
        *,
        certificate: str = "",
    ) -> None:
        door = {"address": address, "port": port, "token": token, "certificate": certificate}
        hint = "Try again, or run without --view"
        settings = {"panel": panel, "title": title, **door}
        super().__init__("tactile_lab.view.process", settings, name="page", hint=hint)

    def is_shown(self, topic: str, data: bytes) -> bool:
        """Most of a camera's packets hold corners only."""
        return topic in SHOWN_TOPICS and (topic != CAMERA_PACKETS or bool(picture_of(data)))
