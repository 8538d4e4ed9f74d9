"""Who may watch: those who have the token, and no other web site open in the same browser."""

from __future__ import annotations

import hmac
from dataclasses import dataclass
from urllib.parse import parse_qs, urlsplit

LOOPBACK = frozenset({"127.0.0.1", "localhost", "::1"})
KNOWN_ORIGINS = frozenset({"https://app.foxglove.dev", "file://"})
"""Foxglove's own web application, and viewers that are installed as programs."""


@dataclass(frozen=True)
class Door:
    """Decides about connections.

    Attributes:
        token: that the address must hold.
        origin: of one more web application that may connect, such as ``https://lichtblick.example.org``; "" for none.
    """

    token: str
    origin: str = ""

    def problem(self, path: str, origin: str | None) -> str:
        """Why a connection is refused, in a sentence; "" if it is accepted.

        Args:
            path: of the request, with its query.
            origin: header of the request; None if it has none, as for programs that are no browsers.
        """
        if origin is not None and not self._is_known(origin):
            return f"The viewer comes from another web site, {origin[:80]}: allow it with --live-origin."
        shown = parse_qs(urlsplit(path).query).get("token", [""])[-1]
        if not hmac.compare_digest(shown.encode(errors="replace"), self.token.encode()):
            return "The token is missing or wrong: use the address that the session printed."
        return ""

    def _is_known(self, origin: str) -> bool:
        if origin in KNOWN_ORIGINS or (self.origin and origin == self.origin.rstrip("/")):
            return True
        try:
            return urlsplit(origin).hostname in LOOPBACK
        except ValueError:
            return False
