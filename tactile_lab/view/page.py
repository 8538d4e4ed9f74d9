"""The page: viser behind the access control, updated by messages."""

from __future__ import annotations

import asyncio
import ipaddress
import socket
import threading
from collections.abc import Callable
from contextlib import redirect_stdout
from io import StringIO
from pathlib import Path
from types import TracebackType
from typing import Literal, Self

import viser
from viser import _messages

from drivers.core.errors import ConfigurationError, refusal
from sessions.guided.operator import Ask
from tactile_lab.view.certificates import load_certificate
from tactile_lab.view.controls import Controls
from tactile_lab.view.drawing import Drawing
from tactile_lab.view.gate import Gate, is_loopback, serve
from tactile_lab.view.inner_door import InnerDoor
from tactile_lab.view.scene import Scene
from tactile_lab.view.wizard_feed import QUIT
from tactile_lab.view.wizard_panel import WizardPanel

Say = Callable[..., None]
"""Reports a pressed button by keywords: ask and text, or question and answer."""

_WHOLE_TABLE = 3.0
"""Camera distance for a wizard, whose hand also presses the edges of the table."""


class Page:
    """A page that shows a scene.

    Args:
        address, port: where it listens; port 0: any free port.
        token: access token; needed for any address but the loopback interface's.
        title: of the page.
        certificate: PEM file with a certificate and its key; "" for no encryption.
        panel: which buttons it has.
        say: called with a pressed button, in another thread; None without requests.
    """

    def __init__(
        self,
        address: str,
        port: int,
        token: str,
        title: str,
        *,
        certificate: str = "",
        panel: Literal["session", "wizard"] = "session",
        say: Say | None = None,
    ) -> None:
        if not token and not is_loopback(address):
            raise ConfigurationError(
                "a token is needed to listen on this address", where=address, hint="Listen on 127.0.0.1, or use --token"
            )
        self._door, self._token = (address, port), token
        self._encryption = load_certificate(Path(certificate)) if certificate else None
        self._inner_door = InnerDoor()
        with redirect_stdout(StringIO()), self._inner_door.in_place_of_ports():  # viser greets on standard output
            self._inner = viser.ViserServer(port=0, label=title, verbose=False)
        refuse_tunnels(self._inner)
        self._inner.gui.configure_theme(show_logo=False, show_share_button=False, control_width="large")
        self._inner.gui.set_panel_label(title)
        self.scene = Scene()
        self._drawing = Drawing(self._inner, _WHOLE_TABLE if panel == "wizard" else 1.0)
        self._controls = _controls(self._inner, panel, say)
        self._loop = asyncio.new_event_loop()
        self._thread = threading.Thread(target=self._loop.run_forever, name="door", daemon=True)
        self._server: asyncio.Server | None = None
        self.url = ""
        """URL of the page, including the token."""

    def __enter__(self) -> Self:
        """Start listening. Raises ConfigurationError if the address is not available."""
        self._thread.start()
        address, port = self._door
        gate = Gate(_names(address), self._token, encrypted=self._encryption is not None)
        serving = serve(gate, address, port, self._inner_door, self._encryption)
        opened = asyncio.run_coroutine_threadsafe(serving, self._loop)
        try:
            server = opened.result(10)
        except (OSError, TimeoutError) as error:
            self.close()
            raise ConfigurationError(
                f"cannot listen on port {port} ({refusal(error)})",
                where=address,
                hint="Choose another --view-port or --listen",
            ) from error
        self._server = server
        bound = server.sockets[0].getsockname()[1]
        name = socket.gethostname() if _is_every(address) else address
        shown = f"[{name}]" if ":" in name else name
        scheme = "http" if self._encryption is None else "https"
        self.url = f"{scheme}://{shown}:{bound}/" + (f"?token={self._token}" if self._token else "")
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def close(self) -> None:
        """Close the page."""
        if self._server is not None:
            self._loop.call_soon_threadsafe(self._server.close)
        asyncio.run_coroutine_threadsafe(_end_visits(), self._loop).result(2.0)
        self._loop.call_soon_threadsafe(self._loop.stop)
        self._thread.join(2.0)
        self._loop.close()
        with redirect_stdout(StringIO()):
            self._inner.stop()
        self._inner_door.close()

    def draw(self) -> None:
        """Show what has changed in the scene."""
        if self.scene.changed:
            self._drawing.draw(self.scene)
            self._controls.draw(self.scene)


def _controls(server: viser.ViserServer, panel: str, say: Say | None) -> Controls | WizardPanel:
    """The panel with its buttons."""
    told: Say = say or (lambda **content: None)

    def press(ask: Ask, text: str) -> None:
        told(ask=ask.value, text=text)

    def answer(question: int, key: str) -> None:
        told(question=question, answer=key)

    if panel == "wizard":
        return WizardPanel(server, answer, QUIT)
    return Controls(server, press, live=say is not None)


def refuse_tunnels(server: viser.ViserServer) -> None:
    """Disable viser's option to request a public address for the page."""
    for message in (_messages.ShareUrlRequest, _messages.ShareUrlDisconnect):
        server._websock_server.unregister_handler(message)


async def _end_visits() -> None:
    """No public address."""
    others = [task for task in asyncio.all_tasks() if task is not asyncio.current_task()]
    for task in others:
        task.cancel()
    await asyncio.gather(*others, return_exceptions=True)


def _names(address: str) -> frozenset[str] | None:
    """Valid host names of a page at an address; None for any: others reach this computer by name and by address."""
    if is_loopback(address):
        return frozenset({address, "localhost", "127.0.0.1", "::1"})
    return None


def _is_every(address: str) -> bool:
    """Whether it stands for all addresses of this computer, as 0.0.0.0 does."""
    try:
        return ipaddress.ip_address(address).is_unspecified
    except ValueError:
        return False
