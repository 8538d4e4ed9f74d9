"""Two viewers of a running session: one reads all topics, the other none of those that it asked for.

python -m tests.support.live_viewers ADDRESS

watches until a line arrives on standard input, then prints how many frames the first one received.
"""

from __future__ import annotations

import json
import sys
import threading

from websockets.exceptions import ConnectionClosed
from websockets.sync.client import ClientConnection, connect

PATIENCE_s = 600.0


def connected(url: str) -> ClientConnection:
    """The server announces its topics to it once the session has said something."""
    return connect(url, subprotocols=["foxglove.sdk.v1"], max_size=None, open_timeout=PATIENCE_s, close_timeout=1.0)  # type: ignore[list-item]


def read(socket: ClientConnection, sizes: list[int]) -> None:
    """Ask for every topic and take every frame."""
    try:
        for frame in socket:
            if isinstance(frame, bytes):
                sizes.append(len(frame))
            else:
                ask(socket, frame)
    except ConnectionClosed:
        return


def subscribe(socket: ClientConnection) -> None:
    """Ask for the topics that are announced first, and read nothing of them."""
    try:
        while not ask(socket, socket.recv()):
            pass
    except ConnectionClosed:
        return


def ask(socket: ClientConnection, frame: str | bytes) -> bool:
    """Whether the frame announced topics, which are now asked for."""
    channels = json.loads(frame).get("channels") if isinstance(frame, str) else None
    if channels:
        wanted = [{"id": one["id"] + 100, "channelId": one["id"]} for one in channels]
        socket.send(json.dumps({"op": "subscribe", "subscriptions": wanted}))
    return bool(channels)


def main() -> None:
    """Watch until told to end."""
    sizes: list[int] = []
    with connected(sys.argv[1]) as reading, connected(sys.argv[1]) as idle:
        threading.Thread(target=read, args=(reading, sizes), daemon=True).start()
        threading.Thread(target=subscribe, args=(idle,), daemon=True).start()
        sys.stdin.readline()
        print(len(sizes), flush=True)


if __name__ == "__main__":
    main()
