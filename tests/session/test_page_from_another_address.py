"""The page and a raw client on another computer: in a network of its own, at the far end of a virtual cable."""

from __future__ import annotations

import subprocess
import sys
from urllib.parse import urlsplit

from tactile_lab.view.feed import ViewFeed
from tests.support.ethercat_wire import cable

TOKEN = "a-token-of-the-tests-0123456789"
OURS, THEIRS = "198.51.100.1", "198.51.100.2"

STRANGER = f"""
import socket, sys
print("ready", flush=True)
port = int(input())
upgrade = "GET / HTTP/1.1\\r\\nHost: {OURS}:%d\\r\\nUpgrade: websocket\\r\\nConnection: Upgrade\\r\\n" \
    "Sec-WebSocket-Version: 13\\r\\nSec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ==\\r\\n%s\\r\\n"
for cookie in ("", "Cookie: tactile_lab_token=wrong\\r\\n", "Cookie: tactile_lab_token={TOKEN}\\r\\n"):
    with socket.create_connection(("{OURS}", port), timeout=60) as page:
        page.sendall((upgrade % (port, cookie)).encode() + (b"" if "{TOKEN}" in cookie else b"\\x82\\x05press" * 100))
        print(page.recv(4096).split()[1].decode(), flush=True)
"""


def ip(*words: str) -> None:
    subprocess.run(["ip", *words], check=True, capture_output=True)


def test_without_the_token_nothing_from_another_computer_reaches_the_page() -> None:
    with cable("p") as (ours, theirs), ViewFeed("0.0.0.0", 0, TOKEN, "test") as feed:
        ip("address", "add", f"{OURS}/30", "dev", ours)
        words = ["unshare", "-n", sys.executable, "-c", STRANGER]
        with subprocess.Popen(words, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True) as stranger:
            assert stranger.stdout is not None
            assert stranger.stdout.readline() == "ready\n"
            ip("link", "set", theirs, "netns", str(stranger.pid))
            enter = ("nsenter", "-t", str(stranger.pid), "-n", "ip")
            for more in (("address", "add", f"{THEIRS}/30", "dev", theirs), ("link", "set", theirs, "up")):
                subprocess.run([*enter, *more], check=True, capture_output=True)
            answered, _ = stranger.communicate(f"{urlsplit(feed.url).port}\n", timeout=120)
        assert answered.split() == ["403", "403", "101"]
        assert not feed.requests()
