from __future__ import annotations

import os
import random

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from drivers.core.errors import CodecError
from drivers.core.records import Record, RecordKind, RecordPipe, RecordReader, encode_record
from drivers.shadow.device.cycle_statistics import CycleStatistics

records = st.builds(
    Record, kind=st.sampled_from(RecordKind), stamp_ns=st.integers(-(2**62), 2**62), payload=st.binary(max_size=300)
)


@settings(max_examples=40, derandomize=True)
@given(st.lists(records, max_size=6), st.integers(1, 50))
def test_records_survive_any_cutting_of_their_stream(sent: list[Record], piece: int) -> None:
    stream = b"".join(encode_record(each.kind, each.stamp_ns, each.payload) for each in sent)
    reader, read = RecordReader(), []
    for at in range(0, len(stream), piece):
        read += reader.feed(stream[at : at + piece])
    assert read == sent


def test_any_bytes_are_records_or_refused() -> None:
    rng = random.Random(2)
    for _ in range(500):
        try:
            RecordReader().feed(rng.randbytes(rng.randrange(200)))
        except CodecError:
            continue


def test_a_pipe_without_reader_never_blocks_and_counts_what_it_drops() -> None:
    reading, writing = os.pipe()
    pipe = RecordPipe(writing)
    for _ in range(120):
        pipe.put(RecordKind.RECEIVED, 1, bytes(60_000))
        pipe.flush()
    assert pipe.dropped_blocks > 10
    reader, read = RecordReader(), 0
    os.set_blocking(reading, False)
    for _ in range(2000):
        pipe.flush()
        try:
            read += len(reader.feed(os.read(reading, 65536)))
        except BlockingIOError:
            break
    assert read + pipe.dropped_blocks == pytest.approx(120, abs=0)
    os.close(reading)
    pipe.put(RecordKind.ERROR, 1, b"nobody reads")
    pipe.flush()
    pipe.close()
    os.close(writing)


def test_lateness_is_summed_up_in_microseconds() -> None:
    statistics = CycleStatistics()
    assert statistics.summary().median_us == 0.0
    for late_us in range(100):
        statistics.add(late_us * 1000)
    statistics.add(60_000_000, left_out=59)
    summary = statistics.summary()
    assert (summary.cycles, summary.left_out, summary.worst_us) == (101, 59, 60_000.0)
    assert summary.median_us == pytest.approx(50, abs=1)
    assert summary.p99_us == pytest.approx(99, abs=1)
    assert str(summary).startswith("101 cycles, 59 skipped, started late by 50 us")
