"""Records from a device's own process to the session: traffic with its stamps, errors, reports.

Each is a head of kind, length and stamp, and a payload; whole blocks of them go through a pipe. The writer never waits:
what a full pipe does not accept is kept up to a limit, further blocks are dropped and counted.
"""

from __future__ import annotations

import fcntl
import os
import struct
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from enum import IntEnum

from drivers.core.child_process import failure
from drivers.core.clock import Clock
from drivers.core.errors import CodecError, TactileLabError

_HEAD = struct.Struct("<BIq")
_BACKLOG_BYTES, _PIPE_BYTES = 4_000_000, 1_048_576
LONGEST = 65_536
"""Default limit of a payload; longer ones count as damage."""


class RecordKind(IntEnum):
    """What a record holds."""

    TRANSMITTED = 1
    RECEIVED = 2
    READY = 3
    REPORT = 4
    ERROR = 5
    MOVES = 6


@dataclass(frozen=True)
class Record:
    """One record; ``stamp_ns`` is of the session clock, ``payload`` device bytes or text as ``kind`` says."""

    kind: RecordKind
    stamp_ns: int
    payload: bytes


def encode_record(kind: RecordKind, stamp_ns: int, payload: bytes) -> bytes:
    """A record's bytes; its parts as in :class:`Record`."""
    return _HEAD.pack(kind, len(payload), stamp_ns) + payload


class RecordReader:
    """Cuts a stream of bytes into records, however it arrives.

    Args:
        longest: payloads of more bytes are damage.
        where: the process they come from, for errors.
    """

    def __init__(self, longest: int = LONGEST, where: str = "records") -> None:
        self._rest, self._longest, self._where = b"", longest, where

    def feed(self, data: bytes) -> list[Record]:
        """The records that are complete now.

        Raises:
            CodecError: bytes that are no records.
        """
        self._rest += data
        records, at = [], 0
        while len(self._rest) - at >= _HEAD.size:
            kind, length, stamp_ns = _HEAD.unpack_from(self._rest, at)
            if kind not in set(RecordKind) or length > self._longest:
                raise CodecError(f"a record of kind {kind}, {length} bytes", where=self._where)
            if len(self._rest) - at < _HEAD.size + length:
                break
            start = at + _HEAD.size
            records.append(Record(RecordKind(kind), stamp_ns, self._rest[start : start + length]))
            at = start + length
        self._rest = self._rest[at:]
        return records


class RecordPipe:
    """The writing end; a tap for the device's transport.

    Args:
        descriptor: of the pipe.
    """

    def __init__(self, descriptor: int) -> None:
        self._descriptor = descriptor
        self._block, self._backlog = bytearray(), bytearray()
        self.dropped_blocks = 0
        flags = fcntl.fcntl(descriptor, fcntl.F_GETFL)
        fcntl.fcntl(descriptor, fcntl.F_SETFL, flags | os.O_NONBLOCK)
        fcntl.fcntl(descriptor, fcntl.F_SETPIPE_SZ, _PIPE_BYTES)

    def on_transmitted(self, transport: str, payload: bytes, stamp_ns: int) -> None:
        """The device was sent ``payload``."""
        self.put(RecordKind.TRANSMITTED, stamp_ns, payload)

    def on_received(self, transport: str, payload: bytes, stamp_ns: int) -> None:
        """The device sent ``payload``."""
        self.put(RecordKind.RECEIVED, stamp_ns, payload)

    def put(self, kind: RecordKind, stamp_ns: int, payload: bytes) -> None:
        """Add a record to the present block."""
        self._block += encode_record(kind, stamp_ns, payload)

    def flush(self) -> None:
        """Write the present block, as far as the pipe accepts it now."""
        if len(self._backlog) + len(self._block) > _BACKLOG_BYTES:
            self.dropped_blocks += 1
        else:
            self._backlog += self._block
        self._block.clear()
        try:
            del self._backlog[: os.write(self._descriptor, self._backlog)]
        except BlockingIOError:
            return  # the reader is slow: the backlog waits for the next block
        except BrokenPipeError:
            self._backlog.clear()  # nobody reads any more; the orders' end tells the worker

    def close(self) -> None:
        """Write the remainder; waits for the reader, as no cycles run any more."""
        os.set_blocking(self._descriptor, True)
        self.flush()
        while self._backlog:
            self.flush()


@contextmanager
def report_failure(pipe: RecordPipe, clock: Clock) -> Iterator[None]:
    """Around all that a device's own process does: a failure becomes its last record, and the pipe is closed.

    Raises:
        SystemExit: with the exit code of the error, after its record.
    """
    try:
        yield
    except TactileLabError as error:
        pipe.put(RecordKind.ERROR, clock.now_ns(), str(error).encode())
        sys.exit(error.exit_code)
    except Exception as error:
        pipe.put(RecordKind.ERROR, clock.now_ns(), failure(error).encode())
        sys.exit(1)
    finally:
        pipe.close()
