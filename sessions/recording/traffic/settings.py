"""How a recording is stored, and what it contains besides messages."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

from sessions.recording.traffic.disk import CutBackFile


@dataclass(frozen=True)
class TrafficSettings:
    """How a recording is stored.

    Attributes:
        segment_bytes: size at which the next file is started; it also bounds the index in memory.
        queue_bytes: uncompressed bytes that may wait for the disk; half a minute at 2 MB/s.
        when_full: "wait" delays the recording thread, for a rig whose time waits with it; "drop" discards whole chunks
            and counts their messages, for real time.
        patience_s: how long "wait" waits before the recording ends with an error.
        tell_streams: whether to write the losses so far once a second; not for a copy of a recording.
        tail: whether the last moments are kept in shared memory as well; not for a copy of a recording.
        open_file: creates the files; replaceable to test a bad disk.
    """

    segment_bytes: int = 256 << 20
    queue_bytes: int = 64 << 20
    when_full: Literal["wait", "drop"] = "wait"
    patience_s: float = 10.0
    tell_streams: bool = True
    tail: bool = True
    open_file: Callable[[Path], CutBackFile] = CutBackFile


@dataclass(frozen=True)
class Attached:
    """A file to store inside the recording."""

    name: str
    media_type: str
    content: bytes
