"""Writing a traffic file: MCAP, in small compressed chunks that survive a crash.

Messages are stored in the exact order in which they happened and are numbered across all topics, so that a gap shows.
``publish_time`` is a message's own stamp; ``log_time`` never decreases, so that readers that sort by it keep the order.
A chunk is closed after 64 KiB, after 80 ms of session time or after 80 ms of real time, whichever comes first, which
bounds what a killed process loses to a tenth of a second, and its last messages are in shared memory too (see
:mod:`sessions.recording.traffic.tail`); once a second the file is flushed to disk in case of a power
cut. Both happen in separate threads (see :mod:`sessions.recording.traffic.disk`). A recording that exceeds the size
limit continues in ``traffic-2.mcap`` and so on; each of these files can be opened separately. The last one ends with a
record of the losses.
"""

from __future__ import annotations

import json
import threading
from collections import Counter
from collections.abc import Mapping
from contextlib import suppress
from importlib.metadata import version
from pathlib import Path

from drivers.core.clock import NANOSECONDS
from drivers.core.errors import SessionError
from sessions.recording.traffic import foxglove, raw_frames, schemas
from sessions.recording.traffic.disk import DiskThread, Segment, Syncer
from sessions.recording.traffic.files import END_RECORD, FORMAT, PROFILE, disk_failure, sealed, segment_path
from sessions.recording.traffic.mcap_writer import McapWriter, PendingChunk
from sessions.recording.traffic.raw_frames import UNSTAMPED, DeviceStamp, Stamper
from sessions.recording.traffic.settings import Attached, TrafficSettings
from sessions.recording.traffic.stream_counts import StreamCounts
from sessions.recording.traffic.tail import NullTail, TailMessage, open_tail

CHUNK_BYTES = 64 * 1024
FLUSH_PERIOD_ns = 80_000_000
STREAMS_PERIOD_ns = NANOSECONDS
CLOSE_TIMEOUT_s = 10.0

_SEQUENCE_MASK = 0xFFFFFFFF


class TrafficWriter:
    """A new recording. Every method may be called from any thread.

    Args:
        path: of its first file; must not exist.
        info: facts about the session, stored in each file with the format's name.
        attachments: files stored in each file.
        stampers: by transport, the reader of the device's own stamp.
        settings: see there.

    Raises:
        SessionError: the file exists or cannot be created.
    """

    def __init__(
        self,
        path: Path,
        info: Mapping[str, str] | None = None,
        *,
        attachments: tuple[Attached, ...] = (),
        stampers: Mapping[str, Stamper] | None = None,
        settings: TrafficSettings | None = None,
    ) -> None:
        self.path, self.streams = path, StreamCounts()
        self.complete = False
        """Whether the recording was finished completely."""
        self._settings = settings or TrafficSettings()
        self._stampers = {schemas.received_topic(transport): stamper for transport, stamper in (stampers or {}).items()}
        self._info, self._attachments = dict(info or {}), attachments
        self._files: list[Segment] = []
        self._failure: SessionError | None = None
        self._channels: dict[str, int] = {}
        self._names: dict[tuple[Path, int], str] = {}
        self._log_ns = self._sequence = 0
        self._handed_ns: int | None = None
        self._told_ns: int | None = None
        self._lock = threading.Lock()
        self._closed = False
        self._segment = self._make_segment()
        self._tail = open_tail(path) if self._settings.tail else NullTail()
        self._disk = DiskThread(
            self._segment,
            self._make_segment,
            segment_bytes=self._settings.segment_bytes,
            queue_bytes=self._settings.queue_bytes,
            idle=self._flush_in_time,
            idle_s=FLUSH_PERIOD_ns / NANOSECONDS,
        )
        self._syncer = Syncer(self._disk.sync)
        self._disk.start()
        self._syncer.start()

    # --- recording ---------------------------------------------------------------------------------------------

    def write(self, topic: str, data: bytes, stamp_ns: int, device: DeviceStamp | None = None) -> None:
        """Append one message.

        Args:
            device: the device's own stamp; by default read from the message.

        Raises:
            SessionError: the disk is full or failed; the earlier recording stays readable.
        """
        with self._lock:
            self._check()
            try:
                self._append(topic, data, stamp_ns, device)
                self._tell_streams()
                self._hand_over_when_due()
            except BaseException:
                self._abandon()
                raise

    def flush(self) -> None:
        """Pass everything so far to the operating system, and wait for it. Raises SessionError
        as :meth:`write` does.
        """
        with self._lock:
            self._check()
            self._hand_over()
        self.settle()
        with self._lock:
            self._check()

    def settle(self) -> None:
        """Wait until everything queued is written, or writing has failed."""
        self._disk.settle(CLOSE_TIMEOUT_s)

    def close(self, end: Mapping[str, str] | None = None) -> None:
        """Finish the file; idempotent. After a failed write the file remains unchanged.

        Args:
            end: facts for the record at the end, besides the losses of each stream.

        Raises:
            SessionError: the last part could not be written, or the disk does not answer.
        """
        with self._lock:
            if self._closed:
                return
            self._closed, known = True, self._failure
            with suppress(SessionError):  # told below
                self._finish(end or {})
        answered = self._disk.end(CLOSE_TIMEOUT_s)
        if not (self._syncer.stop(CLOSE_TIMEOUT_s if answered else 0.0) and answered):
            # the threads are left behind: they wait inside the operating system
            raise self._end(f"the disk has written nothing for {CLOSE_TIMEOUT_s:g} s", "check the disk")
        self._close_files()
        try:
            if known is None:
                self._check()
                self.complete = True
        finally:
            self._tail.close(complete=self.complete)

    # --- one message -------------------------------------------------------------------------------------------

    def _append(self, topic: str, data: bytes, stamp_ns: int, device: DeviceStamp | None = None) -> None:
        if device is None:
            stamper = self._stampers.get(topic)
            device = UNSTAMPED if stamper is None else stamper(data)
        self.streams.take(topic, stamp_ns, device)
        content = raw_frames.encode(data, stamp_ns, device) if schemas.is_raw(topic) else data
        self._log_ns = max(self._log_ns, stamp_ns)
        channel = self._channels.get(topic) or self._register(topic)
        self._segment.writer.add_message(channel, self._log_ns, content, stamp_ns, self._sequence)
        self._tail.append(TailMessage(topic, self._sequence, self._log_ns, stamp_ns, content))
        self._sequence = (self._sequence + 1) & _SEQUENCE_MASK

    def _register(self, topic: str) -> int:
        writer, schema = self._segment.writer, schemas.SCHEMAS.get(topic) or schemas.schema_by_form(topic)
        if schema is not None:
            number = writer.add_schema(schema.name, "jsonschema", schema.to_bytes())
            channel = writer.add_channel(topic, "json", number)
        elif schemas.is_raw(topic):
            number = writer.add_schema(
                raw_frames.SCHEMA_NAME, raw_frames.SCHEMA_ENCODING, raw_frames.DEFINITION.encode()
            )
            channel = writer.add_channel(topic, raw_frames.MESSAGE_ENCODING, number)
        else:
            channel = writer.add_channel(
                topic, "json" if topic == schemas.SESSION_EVENTS_TOPIC else schemas.RAW_ENCODING
            )
        self._channels[topic] = channel
        self._names[self._segment.path, channel] = topic
        return channel

    def _tell_streams(self) -> None:
        """Write the losses so far, once a second, so that they survive a crash."""
        now_ns = self.streams.now_ns
        if self._told_ns is None:
            self._told_ns = now_ns
        if self._settings.tell_streams and now_ns - self._told_ns >= STREAMS_PERIOD_ns:
            self._told_ns = now_ns
            content = {"timestamp": foxglove.time(now_ns), "streams": self.streams.plain()}
            self._append(schemas.STREAMS_TOPIC, schemas.encode(content), now_ns)

    # --- chunks ------------------------------------------------------------------------------------------------

    def _hand_over_when_due(self) -> None:
        if self._handed_ns is None:
            self._handed_ns = self._log_ns
        due = self._log_ns - self._handed_ns >= FLUSH_PERIOD_ns
        if due or self._segment.writer.pending_bytes > CHUNK_BYTES:
            self._hand_over()

    def _hand_over(self) -> None:
        self._handed_ns = self._log_ns
        if (chunk := self._segment.writer.detach()) is None:
            return
        patience_s = self._settings.patience_s if self._settings.when_full == "wait" else 0.0
        if not self._disk.put(self._segment, chunk, patience_s):
            self._do_without(chunk)
        elif (following := self._disk.take_prepared()) is not None:
            self._disk.end_segment(self._segment)
            self._segment = following
            self._channels.clear()

    def _do_without(self, chunk: PendingChunk) -> None:
        self._segment.writer.drop(chunk)
        self._count(self.streams.dropped, self._segment, chunk)
        if self._settings.when_full == "wait":
            raise self._end(f"the disk has written nothing for {self._settings.patience_s:g} s", "check the disk")

    def _flush_in_time(self) -> None:
        """Nothing was queued for a while: queue the current chunk now, unless the recording thread is doing so."""
        if self._lock.acquire(blocking=False):
            try:
                if self._failure is None and not self._closed:
                    self._hand_over()
            finally:
                self._lock.release()

    def _count(self, counter: Counter[str], segment: Segment, chunk: PendingChunk) -> None:
        for channel, number in chunk.message_counts().items():
            counter[self._names[segment.path, channel]] += number

    # --- files -------------------------------------------------------------------------------------------------

    def _make_segment(self) -> Segment:
        number = len(self._files) + 1
        path = segment_path(self.path, number)
        file = self._settings.open_file(path)
        try:
            writer = McapWriter(file, None, PROFILE, f"tactile-lab {version('tactile-lab')}")
            info = sealed({**self._info, "segment": str(number), "format": FORMAT})
            writer.add_metadata(PROFILE, info)
            for attached in self._attachments:
                writer.add_attachment(attached.name, attached.media_type, attached.content)
            writer.add_metadata(PROFILE, info)
        except OSError as error:
            file.close()
            raise disk_failure(path, error, 0) from error
        file.keep()
        self._files.append(Segment(path, file, writer))
        return self._files[-1]

    def _finish(self, end: Mapping[str, str]) -> None:
        self._check()
        self._hand_over()
        facts = {"streams": json.dumps(self.streams.plain()), "lost": json.dumps(self.streams.losses())}
        self._segment.writer.add_closing_metadata(END_RECORD, {**end, **facts})
        self._disk.end_segment(self._segment)

    def _close_files(self) -> None:
        for segment, chunk in self._disk.unwritten:
            self._count(self.streams.unwritten, segment, chunk)
        for segment in self._files:
            segment.file.close()
        if (spare := self._disk.take_prepared()) is not None:  # begun for messages that did not come
            spare.path.unlink(missing_ok=True)

    # --- failures ----------------------------------------------------------------------------------------------

    def _check(self) -> None:
        """Raise the failure that ended the recording, if any."""
        if self._failure is not None:
            raise self._failure
        self._check_disk()

    def _check_disk(self) -> None:
        error = self._disk.failure or self._syncer.error
        if error is not None:
            self._failure = disk_failure(self._disk.failed_segment.path, error, self._disk.failed_segment.file.kept)
            raise self._failure

    def _abandon(self) -> None:
        """A write was interrupted (by a second Ctrl+C): the current chunk may be incomplete and must not be written."""
        self._segment.writer.discard()
        if self._failure is None:
            self._end("writing was interrupted", "start a new session")

    def _end(self, what: str, advice: str) -> SessionError:
        hint = f"The {self._segment.file.kept} bytes recorded so far are kept; {advice}"
        self._failure = SessionError(what, where=str(self._segment.path), hint=hint)
        return self._failure
