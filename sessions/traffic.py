"""Writing a traffic file: MCAP, in small compressed chunks that survive a crash.

Messages stand in the file in the exact order in which they happened and are numbered across all topics, so that a
gap shows. ``publish_time`` is a message's own stamp; ``log_time`` never decreases, so that readers that sort by it
keep the order. A chunk is closed after 64 KiB or 100 ms of session time, which bounds what a killed process loses;
once a second of real time the file is forced to the disk, off the control thread, for the case of a power cut.
"""

from __future__ import annotations

import errno
import os
import threading
from collections import Counter
from collections.abc import Mapping
from contextlib import suppress
from importlib.metadata import version
from pathlib import Path

from sessions import schemas
from sessions.mcap_writer import McapWriter
from tactile_lab.errors import SessionError

PROFILE = "tactile-lab"
FORMAT = "tactile-traffic/1"
CHUNK_BYTES = 64 * 1024
FLUSH_PERIOD_ns = 100_000_000
SYNC_PERIOD_s = 1.0

_SEQUENCE_MASK = 0xFFFFFFFF


class TrafficWriter:
    """A new traffic file.

    Args:
        path: must not exist.
        info: facts about the session, kept in the file beside the format's name.

    Raises:
        SessionError: the file exists or can not be made.
    """

    def __init__(self, path: Path, info: Mapping[str, str] | None = None) -> None:
        self.path = path
        self.counts: Counter[str] = Counter()
        """Messages by topic."""
        self.complete = False
        """The file was finished with everything in it."""
        self._failure: SessionError | None = None
        self._channels: dict[str, int] = {}
        self._log_ns = self._sequence = 0
        self._flushed_ns: int | None = None
        self._file = _CutBackFile(path)
        self._guard = _Guard(self)
        self._syncer: _Syncer | None = None
        with self._guard:
            self._writer = McapWriter(self._file, CHUNK_BYTES, PROFILE, f"tactile-lab {version('tactile-lab')}")
            self._writer.add_metadata(PROFILE, {**(info or {}), "format": FORMAT})
        self._syncer = _Syncer(self._file)
        self._syncer.start()

    def write(self, topic: str, data: bytes, stamp_ns: int) -> None:
        """Append one message.

        Raises:
            SessionError: the disk is full or failed; what was recorded before is kept and readable.
        """
        with self._guard:
            self._log_ns = max(self._log_ns, stamp_ns)
            self._writer.add_message(self._channel(topic), self._log_ns, data, stamp_ns, self._sequence)
            self._sequence = (self._sequence + 1) & _SEQUENCE_MASK
            self.counts[topic] += 1
            self._flush_when_due()

    def flush(self) -> None:
        """Hand everything so far to the operating system. Raises SessionError as :meth:`write`."""
        with self._guard:
            self._writer.flush()
            self._flushed_ns = self._log_ns

    def close(self) -> None:
        """Finish the file; idempotent. After a failed write the file stays as it was then.

        Raises:
            SessionError: the last part could not be written.
        """
        if self._syncer is None:
            return
        self._syncer.stop()
        self._syncer = None
        try:
            if self._failure is None:
                with self._guard:
                    self._writer.finish()
                    self._file.sync()
                self.complete = True
        finally:
            self._file.close()

    def _channel(self, topic: str) -> int:
        channel = self._channels.get(topic)
        if channel is None:
            channel = self._channels[topic] = self._register(topic)
        return channel

    def _register(self, topic: str) -> int:
        schema = schemas.SCHEMAS.get(topic)
        if schema is None:
            encoding = "json" if topic == schemas.MARKS_TOPIC else schemas.RAW_ENCODING
            return self._writer.add_channel(topic, encoding)
        number = self._writer.add_schema(schema.name, "jsonschema", schema.to_bytes())
        return self._writer.add_channel(topic, "json", number)

    def _flush_when_due(self) -> None:
        if self._flushed_ns is None:
            self._flushed_ns = self._log_ns
        if self._log_ns - self._flushed_ns >= FLUSH_PERIOD_ns:
            self._writer.flush()
            self._flushed_ns = self._log_ns

    def keep(self) -> None:
        """What the file holds now is complete."""
        self._file.keep()

    def check(self) -> None:
        """Raise the failure that ended the recording, if one did."""
        if self._failure is not None:
            raise self._failure
        if self._syncer is not None and self._syncer.error is not None:
            raise self.fail(self._syncer.error)

    def fail(self, error: OSError) -> SessionError:
        """The disk failed: keep what is complete, and remember why the recording ended."""
        full = error.errno in (errno.ENOSPC, errno.EDQUOT)
        what = "the disk is full" if full else f"can not be written ({error.strerror or error})"
        return self._end(what, "free some space and start a new session" if full else "check the disk")

    def abandon(self) -> None:
        """Something (a second Ctrl+C) broke into a write: the chunk at hand may be torn and is not to be written."""
        self._end("writing was broken off", "start a new session")

    def _end(self, what: str, advice: str) -> SessionError:
        with suppress(OSError):  # a file that can not be shortened reads as truncated, which is told on reading
            self._file.cut_back()
        hint = f"The {self._file.kept} bytes recorded so far are kept; {advice}"
        self._failure = SessionError(what, where=str(self.path), hint=hint)
        return self._failure


class _Guard:
    """Turns a disk's failure into the writer's SessionError; refuses work after one."""

    def __init__(self, writer: TrafficWriter) -> None:
        self._writer = writer

    def __enter__(self) -> None:
        self._writer.check()

    def __exit__(self, kind: object, error: BaseException | None, trace: object) -> None:
        if error is None:
            self._writer.keep()
        elif isinstance(error, OSError):
            raise self._writer.fail(error) from error
        else:
            self._writer.abandon()


class _CutBackFile:
    """An unbuffered new file that can go back to the last point declared complete."""

    def __init__(self, path: Path) -> None:
        try:
            self._descriptor = os.open(path, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o644)
        except FileExistsError as error:
            raise SessionError("exists already", where=str(path), hint="Sessions are never overwritten") from error
        except OSError as error:
            raise SessionError(f"can not be made ({error.strerror})", where=str(path)) from error
        self._position = self.kept = 0

    def write(self, data: bytes) -> int:
        rest = memoryview(data)
        while rest:
            written = os.write(self._descriptor, rest)
            self._position += written
            rest = rest[written:]
        return len(data)

    def tell(self) -> int:
        return self._position

    def keep(self) -> None:
        self.kept = self._position

    def cut_back(self) -> None:
        os.ftruncate(self._descriptor, self.kept)

    def sync(self) -> None:
        os.fdatasync(self._descriptor)

    def close(self) -> None:
        os.close(self._descriptor)


class _Syncer(threading.Thread):
    """Forces the file to the disk once a second; an error waits in ``error`` for the next write."""

    def __init__(self, file: _CutBackFile) -> None:
        super().__init__(name="traffic sync", daemon=True)
        self.error: OSError | None = None
        self._file, self._ended = file, threading.Event()

    def run(self) -> None:
        while not self._ended.wait(SYNC_PERIOD_s):
            try:
                self._file.sync()
            except OSError as error:
                self.error = error
                return

    def stop(self) -> None:
        self._ended.set()
        self.join()
