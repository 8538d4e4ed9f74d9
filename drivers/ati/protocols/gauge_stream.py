"""The raw stream of a Digital F/T sensor: 13 bytes a sample, no framing, a 7-bit checksum (protocols: Digital F/T)."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from drivers.core.contacts import Array
from drivers.core.errors import CodecError

SIZE = 13
WIRE_ORDER = (0, 2, 4, 1, 3, 5)
"""The gauge of each of the six words of a sample."""

_GAUGE_PLACE = np.argsort(WIRE_ORDER)
_STATUS_ERROR = 0x80
_SURE = 6  # valid samples in a row before a new alignment is accepted
_RUNS = np.arange(SIZE + 1)[:, None] + SIZE * np.arange(_SURE)  # where the samples of each alignment would begin


def encode_sample(gauges: tuple[int, ...], status_error: bool = False) -> bytes:
    """One sample of gauges 0 to 5. Raises CodecError when a word does not fit 16 bits."""
    words = [gauges[gauge] for gauge in WIRE_ORDER]
    if any(not -32768 <= word <= 32767 for word in words):
        raise CodecError(f"a gauge of {gauges} does not fit 16 bits", where="gauge sample")
    body = b"".join(word.to_bytes(2, "big", signed=True) for word in words)
    return body + bytes([sum(body) & 0x7F | (_STATUS_ERROR if status_error else 0)])


class GaugeStream:
    """Splits a stream into samples, and realigns after bytes were lost or damaged.

    Attributes:
        skipped_bytes: bytes that belonged to no valid sample.
        resyncs: how often the stream had to be realigned.
    """

    def __init__(self) -> None:
        self.skipped_bytes = self.resyncs = 0
        self._buffer = b""
        self._aligned = False
        self._before: Array | None = None

    def feed(self, piece: bytes) -> tuple[Array, NDArray[np.bool_], int]:
        """Take received bytes.

        Returns:
            Gauges 0 to 5 of the complete samples, shape (n, 6); whether the status error flag of each is set, shape
            (n,); how many samples were lost between them, judged by the number of bytes.
        """
        self._buffer += piece
        taken: list[NDArray[Any]] = []
        skipped_before = self.skipped_bytes
        while True:
            if not self._aligned:
                start = self._find()
                if start is None:
                    break
                self._skip(start)
                self._aligned = True
            rows = self._rows(self._buffer)
            good = _valid(rows)
            count = len(rows) if good.all() else int(np.argmin(good))
            taken.append(rows[:count])
            self._buffer = self._buffer[count * SIZE :]
            if count:
                self._before = _gauges(rows[count - 1 : count])[0]
            if count == len(rows):
                break
            self._aligned, self.resyncs = False, self.resyncs + 1
        skipped = self.skipped_bytes - skipped_before
        rows = np.concatenate(taken) if taken else np.zeros((0, SIZE), np.uint8)
        return _gauges(rows), (rows[:, -1] & _STATUS_ERROR).astype(bool), -(-skipped // SIZE)

    def _skip(self, count: int) -> None:
        self._buffer = self._buffer[count:]
        self.skipped_bytes += count

    def _find(self) -> int | None:
        """Where the next run of valid samples begins; None until there are enough bytes.

        A steady signal can stay valid at a wrong alignment. If several alignments are valid, the one closest to the
        last good sample is taken.
        """
        needed = (_SURE + 1) * SIZE
        while len(self._buffer) >= needed + SIZE:
            window = self._buffer[: needed + SIZE]
            starts = np.flatnonzero(_sample_at(window)[_RUNS].all(axis=1)).tolist()
            if starts:
                return min(starts, key=lambda start: self._distance(window, start))
            self._skip(SIZE)
        return None

    def _distance(self, window: bytes, start: int) -> float:
        if self._before is None:
            return 0.0
        return float(np.abs(_gauges(self._rows(window[start : start + SIZE]))[0] - self._before).sum())

    @staticmethod
    def _rows(content: bytes) -> NDArray[Any]:
        whole = len(content) // SIZE
        return np.frombuffer(content, np.uint8, whole * SIZE).reshape(whole, SIZE)


def _valid(rows: NDArray[Any]) -> NDArray[np.bool_]:
    return np.asarray((rows[:, :-1].sum(axis=1, dtype=np.int64) & 0x7F) == (rows[:, -1] & 0x7F))


def _sample_at(window: bytes) -> NDArray[np.bool_]:
    """Whether a sample could begin at each byte, judged by the check byte; shape (bytes - 12,)."""
    values = np.frombuffer(window, np.uint8)
    totals = np.concatenate(([0], np.cumsum(values, dtype=np.int64)))
    sums = totals[SIZE - 1 : -1] - totals[:-SIZE]
    return np.asarray((sums & 0x7F) == (values[SIZE - 1 :] & 0x7F))


def _gauges(rows: NDArray[Any]) -> Array:
    words = np.ascontiguousarray(rows[:, :-1]).view(">i2").astype(np.float64)
    return np.asarray(words[:, _GAUGE_PLACE])
