"""``tactile-lab view``: a session in the browser."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from tactile_lab.cli.options import Root, SessionName
from tactile_lab.cli.running.page_address import PORT, Certificate, Listen, PageAddress, Port, Token
from tactile_lab.cli.sessions.choosing import choose_session

if TYPE_CHECKING:
    from sessions.recording.session import Session


def view(
    session: SessionName,
    root: Root = Path("runs"),
    speed: Annotated[
        float, typer.Option(min=0.0, max=1000.0, help="Playback speed as a multiple of real time; 0: jump to the end.")
    ] = 0.0,
    view_port: Port = PORT,
    listen: Listen = "127.0.0.1",
    token: Token = "",
    certificate: Certificate = None,
    rerun: Annotated[
        bool, typer.Option("--rerun", help="Send the session to Rerun's viewer instead, and end; starts the viewer.")
    ] = False,
    rerun_address: Annotated[
        str,
        typer.Option(metavar="URL", help="Of a Rerun viewer that runs, such as rerun+http://127.0.0.1:9876/proxy."),
    ] = "",
) -> None:
    """Show a recorded session in the browser, or follow a running one, until Ctrl+C.

    Viewing does not affect a running session. To control one, use ``tactile-lab run --view``.
    """
    if rerun or rerun_address:
        _send_to_rerun(choose_session(root, session), rerun_address)
        return
    from drivers.core.clock import MonotonicClock
    from tactile_lab.cli.console import say
    from tactile_lab.view.page import Page
    from tactile_lab.view.recorded import follow, play

    address, port, token, file = PageAddress(listen, view_port, token, certificate).check()
    found, clock = choose_session(root, session), MonotonicClock()
    with Page(address, port, token, found.folder.name, certificate=file) as page:
        say(f"page: {page.url}   Ctrl+C ends")
        seen = play(found, page.scene, page.draw, clock, speed)
        follow(found, page.scene, page.draw, clock, seen)
        while True:
            clock.sleep_until_ns(clock.now_ns() + 200_000_000)


def _send_to_rerun(found: Session, address: str) -> None:
    """Send everything to Rerun's viewer."""
    from tactile_lab.cli.console import count, say
    from tactile_lab.workflow.exporting import show_rerun

    say(f"sent to Rerun: {count(show_rerun(found, address), 'item')}")
