"""The page's own socket: in a folder of this user's alone, and closed to clients without this program's secret.

viser would listen on a port, where every program of this computer could press the buttons that move the hand.
"""

from __future__ import annotations

import asyncio
import hmac
import secrets
import shutil
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from http import HTTPStatus
from pathlib import Path
from typing import Any

_HEADER = "X-Tactile-Lab-Door"


class InnerDoor:
    """A socket's place, and the secret that every request to it must have."""

    def __init__(self) -> None:
        self._folder = Path(tempfile.mkdtemp(prefix="tactile-lab-page-"))  # readable by this user alone
        self._secret = secrets.token_urlsafe(24)

    @property
    def path(self) -> Path:
        """Of the socket."""
        return self._folder / "page"

    @contextmanager
    def in_place_of_ports(self) -> Iterator[None]:
        """Within the block servers of the package ``websockets`` listen here, on any port."""
        from websockets.asyncio import server

        usual = server.serve

        def serve(handler: Any, *place: Any, process_request: Any = None, **options: Any) -> Any:
            def checked(connection: Any, request: Any) -> Any:
                if not hmac.compare_digest(request.headers.get(_HEADER, "").encode(), self._secret.encode()):
                    return connection.respond(HTTPStatus.FORBIDDEN, "not this program\n")
                return None if process_request is None else process_request(connection, request)

            return usual(handler, unix=True, path=str(self.path), process_request=checked, **options)

        server.serve = serve  # type: ignore[assignment, misc]
        try:
            yield
        finally:
            server.serve = usual  # type: ignore[misc]

    async def connect(self) -> tuple[asyncio.StreamReader, asyncio.StreamWriter]:
        """A connection to the page. Raises OSError."""
        return await asyncio.open_unix_connection(str(self.path))

    def marked(self, head: bytes) -> bytes:
        """A request's head with the secret, in place of whatever a visitor has put there."""
        lines = [line for line in head.split(b"\r\n") if not line.lower().startswith(_HEADER.lower().encode())]
        lines.insert(1, f"{_HEADER}: {self._secret}".encode())
        return b"\r\n".join(lines)

    def close(self) -> None:
        """Remove the socket's folder."""
        shutil.rmtree(self._folder, ignore_errors=True)
