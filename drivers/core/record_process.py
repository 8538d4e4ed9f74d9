"""A child process that writes records, including traffic, instead of lines of JSON."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

from drivers.core.child_process import ChildProcess, read_answer
from drivers.core.clock import NANOSECONDS, MonotonicClock
from drivers.core.errors import DeviceError
from drivers.core.orders import Order
from drivers.core.records import LONGEST, Record, RecordKind, RecordReader
from drivers.core.transports import Datagram


class RecordProcess(ChildProcess):
    """A child that writes to a :class:`~drivers.core.records.RecordPipe`.

    Args:
        module, name: as :class:`ChildProcess`.
        longest: payloads of more bytes are damage.
    """

    def __init__(self, module: str, name: str, longest: int = LONGEST) -> None:
        super().__init__(module, name)
        self._longest = longest
        self._records = RecordReader(longest, f"{name} process")

    def start(self, first: Order) -> None:
        """As :meth:`ChildProcess.start`."""
        self._records = RecordReader(self._longest, f"{self.name} process")
        super().start(first)

    def read_records(self, patience_s: float = 0.0) -> list[Record] | None:
        """Records completed by what arrives in this time, oldest first; None if nothing arrives.

        Raises:
            DeviceError: as :meth:`ChildProcess.read`.
            CodecError: bytes that are no records.
        """
        data = self.read(patience_s)
        return None if data is None else self._records.feed(data)

    def datagrams(self, on_record: Callable[[Record], None], before: Sequence[Record] = ()) -> list[Datagram]:
        """What its device has sent since the last call, oldest first.

        Args:
            on_record: sees every record, and may raise its error.
            before: records that were read earlier.

        Raises:
            DeviceError, CodecError: as :meth:`read_records`.
        """
        records = list(before)
        while (more := self.read_records()) is not None:
            records += more
        for record in records:
            on_record(record)
        return [Datagram(record.payload, record.stamp_ns) for record in records if record.kind is RecordKind.RECEIVED]

    def await_record(self, kind: RecordKind, patience_s: float, aside: Callable[[Record], None]) -> dict[str, Any]:
        """The JSON content of the next record of a kind.

        Others are passed to ``aside``, which may raise their errors.

        Raises:
            DeviceError: none comes in this time; and as :meth:`read_records`.
        """
        clock = MonotonicClock()
        until_ns = clock.now_ns() + round(patience_s * NANOSECONDS)
        wanted: Record | None = None
        while wanted is None and (left_ns := until_ns - clock.now_ns()) > 0:
            for record in self.read_records(left_ns / NANOSECONDS) or []:
                if record.kind is kind and wanted is None:
                    wanted = record
                else:
                    aside(record)
        if wanted is None:
            raise DeviceError("its process does not answer", where=self.name, hint="Connect again")
        return read_answer(wanted.payload, self.name)

    def last_records(self, patience_s: float) -> list[Record]:
        """Close it, as :meth:`ChildProcess.close`; the records it said last."""
        return self._records.feed(self.close(patience_s))
