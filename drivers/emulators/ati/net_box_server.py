"""An emulated Net F/T box on real sockets: RDT over UDP, web pages over HTTP, by default on loopback."""

from __future__ import annotations

import contextlib
import select
import socket
import threading
from collections.abc import Callable
from functools import partial
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer

from drivers.ati.protocols import rdt_codec
from drivers.emulators.ati.net_box_unit import NetBoxUnit
from drivers.emulators.background import Background, Pace
from drivers.emulators.closing import Closing

_SHORTEST_s, _LONGEST_s = 0.001, 0.02
"""Interval between checks of the socket: short enough to send fast streams in small batches and to close promptly."""


class NetBoxServer(Closing):
    """Serves one box until it is closed. A context manager.

    Args:
        unit: the emulated box.
        host: address to serve on; with one loopback address per box (127.0.0.1, 127.0.0.2, ...) all can use the fixed
            port.
        port, http_port: ports to serve on; 0 for any free one.

    Attributes:
        port, http_port: the ports that it serves on.
        lose: decides by the number of each record whether the network loses it.
        lost: records lost in this way.
    """

    def __init__(
        self,
        unit: NetBoxUnit,
        host: str = "127.0.0.1",
        port: int = rdt_codec.PORT,
        http_port: int = 0,
    ) -> None:
        self.unit, self.lost = unit, 0
        self.lose: Callable[[int], bool] = lambda number: False
        self._lock, self._pace = threading.Lock(), Pace()
        self._client: tuple[str, int] | None = None
        self._socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        try:
            self._socket.bind((host, port))
            self._socket.setblocking(False)
            self._http = ThreadingHTTPServer((host, http_port), partial(_Pages, self))
        except OSError:
            self._socket.close()
            raise
        self.port, self.http_port = self._socket.getsockname()[1], self._http.server_address[1]
        self._http.timeout = 0.05
        self._http.daemon_threads = False
        self._stream = Background(f"box {host} stream", self._turn)
        self._pages = Background(f"box {host} pages", self._http.handle_request)

    def close(self) -> None:
        """Stop serving; idempotent."""
        self._stream.close()
        self._pages.close()
        self._http.server_close()
        self._socket.close()

    def page(self, target: str) -> bytes | None:
        """A web page of the box; None if there is no such page."""
        with self._lock:
            return self.unit.page(target)

    def _turn(self) -> None:
        patience_s = min(max(self._pace.wait_s(self.unit.rate_hz), _SHORTEST_s), _LONGEST_s)
        if select.select([self._socket], [], [], patience_s)[0]:
            self._answer()
        if due := self._pace.due(self.unit.rate_hz):
            self._send(due)

    def _answer(self) -> None:
        """Process all waiting requests."""
        with contextlib.suppress(BlockingIOError, ConnectionError):
            while True:
                self._take(*self._socket.recvfrom(100))

    def _take(self, payload: bytes, client: tuple[str, int]) -> None:
        with self._lock:
            refused = self.unit.refused
            self.unit.handle(payload)
            if self.unit.refused == refused:
                self._client = client  # a later request redirects the stream

    def _send(self, due: int) -> None:
        """Send the records that are due: a few milliseconds of them, with one reading of the sensor."""
        with self._lock:
            records, last, client = self.unit.ticks(due), self.unit.sent, self._client
        if client is None:
            return
        for number, record in enumerate(records, last - len(records) + 1):
            if self.lose(number):
                self.lost += 1
                continue
            with contextlib.suppress(BlockingIOError, ConnectionError):  # as a real box does
                self._socket.sendto(record, client)


class _Pages(BaseHTTPRequestHandler):
    timeout = 1.0  # a silent client must not block it

    def __init__(self, server: NetBoxServer, *args: object) -> None:
        self._box = server
        super().__init__(*args)  # type: ignore[arg-type]

    def do_GET(self) -> None:
        page = self._box.page(self.path)
        self.send_response(404 if page is None else 200)
        self.send_header("Content-Length", str(len(page or b"")))
        self.end_headers()
        self.wfile.write(page or b"")

    def log_message(self, *words: object) -> None:
        """Do nothing: a box keeps no log."""
