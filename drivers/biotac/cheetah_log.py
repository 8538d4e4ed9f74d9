"""The text log of stand-alone BioTacs on SPI, as written by the manufacturer's program for the Cheetah adapter.

Header lines, an empty line and ``Begin File``, then one line per sample: time, batch, frame, channel, and the value and
parity of each sensor (protocols: BioTac on SPI). Some logs have no header, and in some the time is always zero. Then
the time follows from the line number, since the sensors sample one channel every 1/4400 s.

Channel numbers are the manufacturer's: 0 PAC, 1 PDC, 2 TAC, 3 TDC, 17 to 40 electrodes 1 to 24. Only the BioTac SP has
electrodes 20 to 24.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from drivers.biotac.slot_codec import LARGEST_COUNT, Channel, Slot, electrode_channel
from drivers.core.clock import NANOSECONDS
from drivers.core.errors import CodecError

SAMPLE_RATE_Hz = 4400.0
BEGIN = "Begin File"
PAC, FIRST_ELECTRODE, LAST_CHANNEL = 0, 17, 40

_FIXED = 4
"""Time, batch, frame and channel come before the sensors."""

_LONGEST = 120


@dataclass(frozen=True, eq=False)
class CheetahLog:
    """One log.

    Attributes:
        header: the header's values by name.
        times_s: of the samples, shape (n,).
        frames: batch and frame of each, shape (n, 2).
        channels: the manufacturer's channel numbers, shape (n,).
        values: counts, shape (n, sensors).
        parity_errors: which samples of each sensor have wrong parity, shape (n, sensors), boolean.
    """

    header: dict[str, str]
    times_s: NDArray[np.float64]
    frames: NDArray[np.int64]
    channels: NDArray[np.int64]
    values: NDArray[np.int64]
    parity_errors: NDArray[np.bool_]

    @property
    def sensors(self) -> int:
        """How many sensors were on the adapter."""
        return int(self.values.shape[1])

    @property
    def electrodes(self) -> int:
        """24 if there are channels of a BioTac SP, else 19."""
        return 24 if (self.channels >= FIRST_ELECTRODE + 19).any() else 19

    def slots(self, sensor: int) -> Iterator[tuple[int, Slot]]:
        """The sensor's readings one after the other, with their times in nanoseconds, without those of wrong parity.

        :meth:`drivers.biotac.biotac.BioTac.take` takes them.
        """
        rows = np.flatnonzero(~self.parity_errors[:, sensor])
        stamps = np.rint(self.times_s[rows] * NANOSECONDS).astype(np.int64)
        for stamp_ns, channel, value in zip(
            stamps.tolist(), self.channels[rows].tolist(), self.values[rows, sensor].tolist(), strict=True
        ):
            yield stamp_ns, Slot((value,), {}) if channel == PAC else Slot((), {_ours(channel): value})


def decode_log(text: str, where: str = "Cheetah log") -> CheetahLog:
    """Decode a whole log.

    Raises:
        CodecError: a line is not a sample; the message names it.
    """
    header, first, lines = _header(text.splitlines())
    rows: list[list[float]] = []
    for number, line in enumerate(lines, first):
        if line.strip():
            rows.append(_sample(line, f"{where}, line {number}"))
            if len(rows[-1]) != len(rows[0]):
                what = f"{(len(rows[-1]) - _FIXED) // 2} sensors, but {(len(rows[0]) - _FIXED) // 2} before"
                raise CodecError(what, where=f"{where}, line {number}")
    if not rows:
        raise CodecError(
            "no samples", where=where, hint="Give a log of the manufacturer's program for the Cheetah adapter"
        )
    return _log(header, np.array(rows))


def encode_log(log: CheetahLog) -> str:
    """The text of a log."""
    lines = [f"{name}: {value}" for name, value in log.header.items()]
    lines += ["", BEGIN] if lines else []
    for time_s, frame, channel, values, wrong in zip(
        log.times_s.tolist(), log.frames.tolist(), log.channels.tolist(), log.values.tolist(), log.parity_errors,
        strict=True,
    ):  # fmt: skip
        cells = " ".join(f"{value} {int(bad)}" for value, bad in zip(values, wrong, strict=True))
        lines.append(f"{time_s:.6f} {frame[0]} {frame[1]} {channel} {cells}")
    return "\n".join(lines) + "\n"


def _header(lines: list[str]) -> tuple[dict[str, str], int, list[str]]:
    """The header, the number of the first line that is a sample, and the lines from there on."""
    begin = next((number for number, line in enumerate(lines) if line.strip() == BEGIN), None)
    if begin is None:
        return {}, 1, lines
    pairs = (line.partition(":") for line in lines[:begin] if line.strip())
    return {name.strip(): value.strip() for name, _, value in pairs}, begin + 2, lines[begin + 1 :]


def _sample(line: str, where: str) -> list[float]:
    cells = line.split()
    try:
        numbers = [float(cells[0]), *(int(cell) for cell in cells[1:])]
    except (ValueError, IndexError):
        numbers = []
    pairs = len(numbers) - _FIXED
    if pairs < 2 or pairs % 2 or not 0.0 <= numbers[0] < 1e9 or not _possible(numbers):
        raise CodecError(
            f"is not a sample: {line[:_LONGEST]!r}", where=where, hint="The line may be damaged: remove it"
        )
    return numbers


def _possible(numbers: list[float]) -> bool:
    channel = numbers[3]
    known = channel in (PAC, *Channel) or FIRST_ELECTRODE <= channel <= LAST_CHANNEL
    counted = all(0 <= number < 1 << 31 for number in numbers[1:3])
    counts = all(0 <= value <= LARGEST_COUNT for value in numbers[_FIXED::2])
    return known and counted and counts and all(flag in (0, 1) for flag in numbers[_FIXED + 1 :: 2])


def _log(header: dict[str, str], table: NDArray[np.float64]) -> CheetahLog:
    times = table[:, 0] if table[:, 0].any() else np.arange(len(table)) / SAMPLE_RATE_Hz
    return CheetahLog(
        header=header,
        times_s=times,
        frames=table[:, 1:3].astype(np.int64),
        channels=table[:, 3].astype(np.int64),
        values=table[:, _FIXED::2].astype(np.int64),
        parity_errors=table[:, _FIXED + 1 :: 2] != 0,
    )


def _ours(channel: int) -> int:
    """The channel number in the palm's slots for one of the manufacturer's."""
    return channel if channel in tuple(Channel) else electrode_channel(channel - FIRST_ELECTRODE + 1)
