"""Where a recording meets the disk: files that can go back to their last complete point, and the thread that writes.

The control thread only hands over finished chunks. Compressing and writing them is the work of one thread, forcing
them to the disk that of another, so that a disk that stands still for a while delays no cycle. What waits is bounded.
"""

from __future__ import annotations

import fcntl
import os
import threading
from collections import deque
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path

from drivers.core.errors import SessionError
from sessions.recording.traffic.mcap_writer import McapWriter, PendingChunk

SYNC_PERIOD_s = 1.0


class CutBackFile:
    """An unbuffered new file that can go back to the last point declared complete.

    It is locked while it is open, so that others can tell a session that is being recorded from one that was left
    open by a crash (see :func:`being_written`).
    """

    def __init__(self, path: Path) -> None:
        try:
            self._descriptor = os.open(path, os.O_WRONLY | os.O_CREAT | os.O_EXCL | os.O_CLOEXEC, 0o644)
        except FileExistsError as error:
            raise SessionError("exists already", where=str(path), hint="Sessions are never overwritten") from error
        except OSError as error:
            raise SessionError(f"cannot be made ({error.strerror})", where=str(path)) from error
        with suppress(OSError):  # a file system without locks: a crashed session then looks like a running one
            fcntl.flock(self._descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
        self._position = self.kept = 0

    def write(self, data: bytes) -> int:
        """Append all of it. Raises OSError."""
        rest = memoryview(data)
        while rest:
            written = os.write(self._descriptor, rest)
            self._position += written
            rest = rest[written:]
        return len(data)

    def tell(self) -> int:
        """Bytes written so far."""
        return self._position

    def keep(self) -> None:
        """What the file holds now is complete."""
        self.kept = self._position

    def cut_back(self) -> None:
        """Shorten the file to what was last declared complete. Raises OSError."""
        os.ftruncate(self._descriptor, self.kept)

    def sync(self) -> None:
        """Force the file to the disk. Raises OSError."""
        os.fdatasync(self._descriptor)

    def close(self) -> None:
        """Close and unlock it."""
        os.close(self._descriptor)


def being_written(path: Path) -> bool:
    """Whether a program that is still alive has a file open for recording."""
    try:
        descriptor = os.open(path, os.O_RDONLY | os.O_CLOEXEC)
    except OSError:
        return False
    try:
        fcntl.flock(descriptor, fcntl.LOCK_SH | fcntl.LOCK_NB)
    except OSError:
        return True
    finally:
        os.close(descriptor)
    return False


@dataclass
class Segment:
    """One file of a recording and what writes it."""

    path: Path
    file: CutBackFile
    writer: McapWriter


@dataclass
class _Job:
    """A chunk for a segment, or without a chunk the end of that segment."""

    segment: Segment
    chunk: PendingChunk | None
    size: int


class DiskThread(threading.Thread):
    """Writes chunks in the order in which they were handed over.

    Args:
        first: the segment to begin with.
        next_segment: makes the segment after the one at hand when that is full; called in this thread.
        segment_bytes: size from which a segment is full.
        queue_bytes: uncompressed bytes that may wait.
        idle: called at least every ``idle_s`` seconds while nothing waits.

    Attributes:
        failure: why writing ended; nothing is written after that.
    """

    def __init__(
        self,
        first: Segment,
        next_segment: Callable[[], Segment],
        *,
        segment_bytes: int,
        queue_bytes: int,
        idle: Callable[[], None],
        idle_s: float,
    ) -> None:
        super().__init__(name="traffic disk", daemon=True)
        self.failure: OSError | SessionError | None = None
        self.failed_segment = first
        self.unwritten: list[tuple[Segment, PendingChunk]] = []
        self._current = self._newest = first
        self._next_segment, self._segment_bytes = next_segment, segment_bytes
        self._prepared: Segment | None = None
        self._queue_bytes, self._idle, self._idle_s = queue_bytes, idle, idle_s
        self._jobs: deque[_Job] = deque()
        self._waiting_bytes = 0
        self._condition = threading.Condition()
        self._ended = self._busy = False

    # --- for the recording thread ------------------------------------------------------------------------------

    def put(self, segment: Segment, chunk: PendingChunk, patience_s: float) -> bool:
        """Hand over a chunk; False when there is no room for it even after ``patience_s`` seconds."""
        size = len(chunk.records)
        with self._condition:
            if not self._condition.wait_for(lambda: self._has_room(size), patience_s):
                return False
            self._enqueue(_Job(segment, chunk, size))
        return True

    def end_segment(self, segment: Segment) -> None:
        """Finish a segment after all its chunks; takes no room in the queue."""
        with self._condition:
            self._enqueue(_Job(segment, None, 0))

    def take_prepared(self) -> Segment | None:
        """The next segment, once the one at hand is full."""
        prepared, self._prepared = self._prepared, None
        return prepared

    def settle(self, timeout_s: float) -> bool:
        """Wait until everything handed over is written, or writing has failed."""
        with self._condition:
            return self._condition.wait_for(lambda: not self._jobs and not self._busy, timeout_s)

    def end(self, timeout_s: float) -> bool:
        """Write what waits, and end; False when that takes longer than the time-out."""
        with self._condition:
            self._ended = True
            self._condition.notify_all()
        self.join(timeout_s)
        return not self.is_alive()

    def sync(self) -> None:
        """Force the segment at hand to the disk. Raises OSError."""
        self._current.file.sync()

    # --- the thread itself -------------------------------------------------------------------------------------

    def run(self) -> None:
        while True:
            job = self._take()
            if job is None:
                if self._ended:
                    return
                self._idle()
                continue
            self._carry_out(job)
            with self._condition:
                self._waiting_bytes -= job.size
                self._busy = False
                self._condition.notify_all()

    def _take(self) -> _Job | None:
        with self._condition:
            self._condition.wait_for(lambda: self._jobs or self._ended, self._idle_s)
            if not self._jobs:
                return None
            self._busy = True
            return self._jobs.popleft()

    def _carry_out(self, job: _Job) -> None:
        if self.failure is not None:
            self._note_unwritten(job)
            return
        try:
            self._write(job)
        except Exception as error:  # whatever it is, the next write raises it
            self.failure = error if isinstance(error, OSError | SessionError) else _defect(error, job.segment)
            self.failed_segment = job.segment
            self._note_unwritten(job)
            with suppress(OSError):  # a file that cannot be shortened reads as truncated, which is told on reading
                job.segment.file.cut_back()

    def _write(self, job: _Job) -> None:
        file = job.segment.file
        if job.chunk is None:
            job.segment.writer.finish()
            file.sync()
            file.keep()
            return
        self._current = job.segment
        job.segment.writer.write_chunk(job.chunk)
        file.keep()
        if file.tell() >= self._segment_bytes and self._newest is job.segment:
            self._newest = self._prepared = self._next_segment()

    def _note_unwritten(self, job: _Job) -> None:
        if job.chunk is not None:
            self.unwritten.append((job.segment, job.chunk))

    def _has_room(self, size: int) -> bool:
        return not self._waiting_bytes or self._waiting_bytes + size <= self._queue_bytes

    def _enqueue(self, job: _Job) -> None:
        self._jobs.append(job)
        self._waiting_bytes += job.size
        self._condition.notify_all()


def _defect(error: Exception, segment: Segment) -> SessionError:
    return SessionError(f"cannot be written ({error!r})", where=str(segment.path))


class Syncer(threading.Thread):
    """Forces a recording to the disk once a second; an error waits in ``error`` for the next write."""

    def __init__(self, sync: Callable[[], None]) -> None:
        super().__init__(name="traffic sync", daemon=True)
        self.error: OSError | None = None
        self._sync, self._ended = sync, threading.Event()

    def run(self) -> None:
        while not self._ended.wait(SYNC_PERIOD_s):
            try:
                self._sync()
            except OSError as error:
                if not self._ended.is_set():
                    self.error = error
                return

    def stop(self, timeout_s: float) -> bool:
        """End it; False when the disk holds it up for longer than the time-out."""
        self._ended.set()
        self.join(timeout_s)
        return not self.is_alive()
