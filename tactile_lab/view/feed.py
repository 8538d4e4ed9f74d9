"""The session's end of the page: copies of messages out, requests in."""

from __future__ import annotations

from collections import deque
from collections.abc import Mapping, Sequence
from typing import Any

from sessions.guided.operator import Ask, Panel, Request, request_of
from tactile_lab.view.page_transport import PageTransport

PAGE_ASKS = frozenset(Ask) - {Ask.ATTACH, Ask.MOVE, Ask.FINGERS}
"""Requests allowed from a page: none that names files of this computer."""
_PENDING = 50


class ViewFeed(PageTransport):
    """A page that shows a running session; an operator of it.

    Args:
        address, port, token, title, certificate: see :class:`~tactile_lab.view.page_transport.PageTransport`.
    """

    attended = False

    def __init__(self, address: str, port: int, token: str, title: str, *, certificate: str = "") -> None:
        super().__init__("session", address, port, token, title, certificate=certificate)
        self._asked: deque[Request] = deque(maxlen=_PENDING)

    def on_press(self, content: Mapping[str, Any]) -> None:
        """Store an allowed request. Raises ValueError for anything else."""
        if (request := request_of(content)).ask in PAGE_ASKS:
            self._asked.append(request)

    def requests(self) -> Sequence[Request]:
        """Requests since the last call."""
        requests = []
        while self._asked:
            requests.append(self._asked.popleft())
        return requests

    def show(self, panel: Panel) -> None:
        """Nothing to do: the page shows the recorded panels."""
