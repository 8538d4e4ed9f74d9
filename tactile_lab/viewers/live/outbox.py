"""What one viewer has still to be sent: bounded, however slow it is."""

from __future__ import annotations

import asyncio
from collections import OrderedDict

MOST_PASSING = 256
"""Messages that wait, besides the newest of each lasting kind: six seconds of a session."""

Key = tuple[str, str]


class Outbox:
    """Frames in their order. Of lasting messages with the same key only the newest waits; of the others the oldest give
    way to new ones, and are counted.
    """

    def __init__(self) -> None:
        self.left_out = 0
        """Messages that gave way."""
        self._waiting: OrderedDict[Key | int, bytes] = OrderedDict()
        self._passing: OrderedDict[int, None] = OrderedDict()
        self._number = 0
        self._filled = asyncio.Event()

    def put(self, frame: bytes, key: Key | None = None) -> None:
        """Add a frame, without waiting."""
        if key is not None:
            self._waiting.pop(key, None)
            self._waiting[key] = frame
        else:
            self._number += 1
            self._waiting[self._number] = frame
            self._passing[self._number] = None
            if len(self._passing) > MOST_PASSING:
                oldest, _ = self._passing.popitem(last=False)
                del self._waiting[oldest]
                self.left_out += 1
        self._filled.set()

    async def take(self) -> bytes:
        """The next frame, once there is one."""
        while not self._waiting:
            self._filled.clear()
            await self._filled.wait()
        key, frame = self._waiting.popitem(last=False)
        if isinstance(key, int):
            del self._passing[key]
        return frame
