"""Address of the server for other viewers, from command line options."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from typing import TYPE_CHECKING, Annotated
from urllib.parse import urlsplit

import typer

from tactile_lab.cli.running.page_address import HERE, PageAddress

if TYPE_CHECKING:
    from tactile_lab.viewers.live.feed import LiveFeed

LIVE_PORT = 8765
"""Which Foxglove and Lichtblick propose."""
_PANEL = "Other viewers"

Live = Annotated[
    bool,
    typer.Option(
        "--live",
        help="Also send this to Foxglove or Lichtblick on this computer, to watch only.",
        rich_help_panel=_PANEL,
    ),
]
LivePort = Annotated[
    int,
    typer.Option("--live-port", min=0, max=65535, help="Port for viewers; 0: any free port.", rich_help_panel=_PANEL),
]
LiveOrigin = Annotated[
    str,
    typer.Option(
        "--live-origin",
        metavar="URL",
        help="A web application that may connect, besides Foxglove's and those of this computer.",
        rich_help_panel=_PANEL,
    ),
]


@dataclass(frozen=True)
class LiveAddress:
    """Rig, port, token and additional web application as typed."""

    rig: str
    port: int
    token: str
    origin: str

    @classmethod
    def if_wanted(cls, live: bool, rig: str, port: int, token: str, origin: str) -> LiveAddress | None:
        """The address if viewers are wanted. Raises BadParameter for an option that needs them, or an origin that
        no browser sends."""
        for option, given in (("--live-port", port != LIVE_PORT), ("--live-origin", bool(origin))):
            if given and not live:
                raise typer.BadParameter("needs --live", param_hint=f"'{option}'")
        if origin and not _is_origin(origin):
            what = "must be a web address without a path, such as https://lichtblick.example.org"
            raise typer.BadParameter(what, param_hint="'--live-origin'")
        return cls(rig, port, token, origin) if live else None


def _is_origin(text: str) -> bool:
    """Whether browsers send such a text as the origin of a web application, a slash at its end apart."""
    try:
        parts = urlsplit(text.rstrip("/"))
    except ValueError:
        return False
    return (
        parts.scheme in ("http", "https")
        and bool(parts.hostname)
        and f"{parts.scheme}://{parts.netloc}" == text.rstrip("/")
    )


@contextmanager
def serve_live(live: LiveAddress, title: str) -> Iterator[LiveFeed]:
    """The server, while the session runs. Raises ConfigurationError, ProcessError."""
    from drivers.core.installed.extras import require_package
    from tactile_lab.cli.console import say, warn
    from tactile_lab.viewers.live.feed import LiveFeed

    for package in ("foxglove", "websockets"):
        require_package(package)
    _, port, token, _ = PageAddress(HERE, live.port, live.token).check()
    with LiveFeed(live.rig, HERE, port, token, title, live.origin) as feed:
        say(f"live: {feed.url}   (Foxglove, Lichtblick: open connection, Foxglove WebSocket)")
        yield feed
    if feed.dropped:
        warn(f"the viewers' server was too slow: {feed.dropped} messages were not sent, but all are recorded")
