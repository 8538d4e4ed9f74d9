"""Writing a recording to disk: files that can be truncated to their last complete point, and the writing threads.

The control thread only queues finished chunks. One thread compresses and writes them, another flushes them to disk, so
that a disk that stalls for a while delays no cycle. The queue is bounded.
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
    """An unbuffered new file that can be truncated to the last point declared complete.

    It is locked while it is open, to distinguish a session that is being recorded from one left open by a crash (see
    :func:`being_written`).
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
        """Declare the present content complete."""
        self.kept = self._position

    def cut_back(self) -> None:
        """Shorten the file to what was last declared complete. Raises OSError."""
        os.ftruncate(self._descriptor, self.kept)

    def sync(self) -> None:
        """Flush the file to disk. Raises OSError."""
        os.fdatasync(self._descriptor)

    def close(self) -> None:
        """Close and unlock it."""
        os.close(self._descriptor)


def being_written(path: Path) -> bool:
    """Whether a running program has a file open for recording."""
    try:
        descriptor = os.open(path, os.O_RDONLY | os.O_NONBLOCK | os.O_CLOEXEC)  # a pipe is not waited for
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
    """One file of a recording and its writer."""

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
        next_segment: creates the segment after a full one; called in this thread.
        segment_bytes: size at which a segment is full.
        queue_bytes: uncompressed bytes that may wait.
        idle: called at least every ``idle_s`` seconds while the queue is empty.

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
        """Queue a chunk. Returns False if there is no room for it even after ``patience_s`` seconds."""
        size = len(chunk.records)
        with self._condition:
            if not self._condition.wait_for(lambda: self._has_room(size), patience_s):
                return False
            self._enqueue(_Job(segment, chunk, size))
        return True

    def end_segment(self, segment: Segment) -> None:
        """Finish a segment after all its chunks; needs no room in the queue."""
        with self._condition:
            self._enqueue(_Job(segment, None, 0))

    def take_prepared(self) -> Segment | None:
        """The next segment, once the current one is full."""
        prepared, self._prepared = self._prepared, None
        return prepared

    def settle(self, patience_s: float) -> bool:
        """Wait until everything queued is written, or writing has failed.

        A slow disk is given the time it needs. Returns False if it has written nothing for ``patience_s``.
        """
        with self._condition:
            while self._jobs or self._busy:
                if not self._condition.wait(patience_s):
                    return False
        return True

    def end(self, patience_s: float) -> bool:
        """Write the queue, and end. Returns False if the disk has written nothing for ``patience_s``."""
        with self._condition:
            self._ended = True
            self._condition.notify_all()
        if self.settle(patience_s):
            self.join(patience_s)
        return not self.is_alive()

    def sync(self) -> None:
        """Flush the current segment to disk. Raises OSError."""
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
    """Flushes a recording to disk once a second; an error is kept in ``error`` for the next write."""

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
        """End the thread. Returns False if the disk blocks it for longer than the timeout."""
        self._ended.set()
        self.join(timeout_s)
        return not self.is_alive()
