"""Access control of the page: who may see it and press its buttons.

The page itself listens on a socket in a folder of this user's alone, asks every request for a secret of this program,
and so is reached only through this gate (:mod:`tactile_lab.view.inner_door`). The gate accepts a visitor who has the
token: once in the address, then in a cookie. A page of the loopback interface also wants one of its known host names;
no other web site open in the same browser can press a button there. Elsewhere any name will do: a web site that takes
the page's address for its own has no cookie.
"""

from __future__ import annotations

import asyncio
import contextlib
import hashlib
import hmac
import ipaddress
import re
import secrets
import ssl
from dataclasses import dataclass
from http import HTTPStatus

from tactile_lab.view.inner_door import InnerDoor

COOKIE = "tactile_lab_token"
"""Begins a cookie's name. Browsers keep one of a name for all ports of a computer, so each token has its own."""
_HEAD_BYTES, _HEAD_TIMEOUT_s, _BLOCK = 16_384, 10.0, 65_536


def is_loopback(address: str) -> bool:
    """Whether an address can be reached from this computer only."""
    if address == "localhost":
        return True
    try:
        return ipaddress.ip_address(address).is_loopback
    except ValueError:
        return False


def new_token() -> str:
    """A token that cannot be guessed."""
    return secrets.token_urlsafe(24)


@dataclass(frozen=True)
class Head:
    """The head of an HTTP request: path with query, and headers by lower-case name."""

    path: str
    headers: dict[str, str]


def parse_head(data: bytes) -> Head | None:
    """The head of a GET request; None for anything else."""
    lines = data.decode("latin-1").split("\r\n")
    words = lines[0].split(" ")
    if len(words) != 3 or words[0] != "GET" or not words[2].startswith("HTTP/1."):
        return None
    pairs = (line.partition(":") for line in lines[1:] if line)
    return Head(words[1], {name.strip().lower(): value.strip() for name, _, value in pairs})


class Gate:
    """Decides about requests.

    Args:
        names: host names and addresses of the page; None for any, which needs a token.
        token: "" for none.
        encrypted: the cookie is then never sent without encryption.
    """

    def __init__(self, names: frozenset[str] | None, token: str, *, encrypted: bool = False) -> None:
        assert names is not None or token
        self._names, self._token = names, token
        self._cookie = f"{COOKIE}_{hashlib.sha256(token.encode()).hexdigest()[:12]}={token}"
        self._marks = "HttpOnly; SameSite=Strict; Path=/" + ("; Secure" if encrypted else "")

    def verdict(self, head: Head) -> tuple[HTTPStatus, str]:
        """OK: pass it on; SEE_OTHER with the cookie to set; anything else with the reason."""
        host = head.headers.get("host", "")
        if self._names is not None and _host_name(host) not in self._names:
            return HTTPStatus.FORBIDDEN, f"this page is not known as {host[:80]}"
        origin = head.headers.get("origin")
        if origin is not None and origin.partition("://")[2] != host:
            return HTTPStatus.FORBIDDEN, "the request comes from another web site"
        if not self._token:
            return HTTPStatus.OK, ""
        if any(self._same(shown) for shown in _cookies(head.headers.get("cookie", ""))):
            return HTTPStatus.OK, ""
        shown = re.search(r"[?&]token=([A-Za-z0-9_-]+)", head.path)
        if shown and self._same(shown[1]):
            return HTTPStatus.SEE_OTHER, f"{self._cookie}; {self._marks}"
        return HTTPStatus.FORBIDDEN, "the token is missing or wrong: use the address that the session printed"

    def _same(self, shown: str) -> bool:
        return hmac.compare_digest(shown.encode(), self._token.encode())


def _host_name(host: str) -> str:
    if host.startswith("["):
        return host[1:].partition("]")[0]
    return host.partition(":")[0].lower()


def _cookies(header: str) -> list[str]:
    """The tokens that a visitor has, of this page and of others on this computer."""
    pairs = (part.strip().partition("=") for part in header.split(";"))
    return [value for name, _, value in pairs if name.startswith(COOKIE)]


async def serve(
    gate: Gate, address: str, port: int, inner: InnerDoor, encryption: ssl.SSLContext | None = None
) -> asyncio.Server:
    """Listen, and forward accepted requests to ``inner``. Raises OSError if the address is not available."""

    async def visit(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        with contextlib.suppress(OSError, asyncio.IncompleteReadError, asyncio.LimitOverrunError, TimeoutError):
            await _visit(gate, reader, writer, inner)
        writer.close()

    return await asyncio.start_server(visit, address, port, limit=_HEAD_BYTES, ssl=encryption)


async def _visit(gate: Gate, reader: asyncio.StreamReader, writer: asyncio.StreamWriter, inner: InnerDoor) -> None:
    data = await asyncio.wait_for(reader.readuntil(b"\r\n\r\n"), _HEAD_TIMEOUT_s)
    head = parse_head(data)
    status, text = (HTTPStatus.BAD_REQUEST, "not a page request") if head is None else gate.verdict(head)
    if status is not HTTPStatus.OK:
        writer.write(_answer(status, text))
        await writer.drain()
        return
    inner_reader, inner_writer = await inner.connect()
    inner_writer.write(inner.marked(_closing(data)))
    await asyncio.gather(_carry(reader, inner_writer), _carry(inner_reader, writer))


def _closing(head: bytes) -> bytes:
    """Every page request has a separate connection, so that each one is checked; a websocket keeps its connection."""
    if re.search(rb"(?im)^upgrade:", head):
        return head
    without = re.sub(rb"(?im)^connection:[^\r\n]*\r\n", b"", head)
    return without[:-2] + b"Connection: close\r\n\r\n"


def _answer(status: HTTPStatus, text: str) -> bytes:
    """A response without a page; a cookie is set with a redirect."""
    extra = f"Set-Cookie: {text}\r\nLocation: /\r\n" if status is HTTPStatus.SEE_OTHER else ""
    body = b"" if extra else f"{status.value} {status.phrase}: {text}\n".encode()
    head = f"HTTP/1.1 {status.value} {status.phrase}\r\n{extra}Content-Type: text/plain; charset=utf-8\r\n"
    return f"{head}Content-Length: {len(body)}\r\nConnection: close\r\n\r\n".encode() + body


async def _carry(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
    with contextlib.suppress(OSError):
        while block := await reader.read(_BLOCK):
            writer.write(block)
            await writer.drain()
    with contextlib.suppress(OSError):
        writer.close()
