"""How a recording is kept, and what goes into it beside the messages."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

from sessions.recording.traffic.disk import CutBackFile


@dataclass(frozen=True)
class TrafficSettings:
    """How a recording is kept.

    Attributes:
        segment_bytes: size at which the next file is begun; it bounds the index that is kept in memory, too.
        queue_bytes: uncompressed bytes that may wait for the disk; at 2 MB/s half a minute.
        when_full: "wait" delays the recording thread, for a rig whose time waits with it; "drop" leaves out whole
            chunks and counts their messages, for real time.
        patience_s: how long "wait" waits before the recording ends with an error.
        tell_streams: whether to write once a second what was lost so far; not for a copy of a recording.
        open_file: makes the files; another one than usual tries out what a bad disk does.
    """

    segment_bytes: int = 256 << 20
    queue_bytes: int = 64 << 20
    when_full: Literal["wait", "drop"] = "wait"
    patience_s: float = 10.0
    tell_streams: bool = True
    open_file: Callable[[Path], CutBackFile] = CutBackFile


@dataclass(frozen=True)
class Attached:
    """A file to be kept inside the recording."""

    name: str
    media_type: str
    content: bytes
