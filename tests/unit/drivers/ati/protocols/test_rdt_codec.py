"""Bytes of RDT requests and records (protocols: Net F/T)."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from drivers.ati.protocols import rdt_codec
from drivers.ati.protocols.rdt_codec import Command, Severity
from drivers.core.errors import CodecError

WORD = st.integers(0, 2**32 - 1)
COUNT = st.integers(-(2**31) + 1, 2**31 - 1)


def test_requests_match_the_golden_vectors(lab_data: Path) -> None:
    golden = json.loads((lab_data / "golden_vectors.json").read_text())["rdt"]
    requests = {
        "start_rt_inf": (Command.START, 0),
        "stop": (Command.STOP, 0),
        "one": (Command.START, 1),
        "buffered": (Command.START_BUFFERED, 0),
        "latch": (Command.CLEAR_CONDITION_LATCH, 0),
        "bias": (Command.SET_SOFTWARE_BIAS, 0),
    }
    assert {name: rdt_codec.encode_request(*request).hex() for name, request in requests.items()} == golden


def test_a_record_matches_the_golden_vector(lab_data: Path) -> None:
    golden = json.loads((lab_data / "golden_vectors.json").read_text())["rdt_record_example"]
    payload = bytes.fromhex(golden["hex"])
    ((*words, counts),) = np.frombuffer(payload, rdt_codec.RECORD).tolist()
    assert [*words, *counts] == golden["fields"]
    assert list(rdt_codec.records(payload)) == [tuple(golden["fields"])]


@settings(max_examples=40, derandomize=True)
@given(st.lists(st.tuples(WORD, WORD, WORD, st.tuples(*[COUNT] * 6)), min_size=1, max_size=40))
def test_records_survive_encoding_and_decoding(rows: list[tuple[int, int, int, tuple[int, ...]]]) -> None:
    rdt, ft, status, counts = (np.array(column) for column in zip(*rows, strict=True))
    payload = rdt_codec.encode_records(rdt, ft, status, counts)
    plain = [(*words, *six) for *words, six in rows]
    assert list(rdt_codec.records(payload)) == plain
    assert [(*words, *six) for *words, six in np.frombuffer(payload, rdt_codec.RECORD).tolist()] == plain


@settings(max_examples=60, derandomize=True)
@given(st.binary(max_size=120))
def test_any_bytes_decode_or_raise_a_codec_error(payload: bytes) -> None:
    if payload and len(payload) % 36 == 0:
        decoded = np.frombuffer(payload, rdt_codec.RECORD)
        assert [(*row[:3], *row[3]) for row in decoded.tolist()] == list(rdt_codec.records(payload))
    else:
        with pytest.raises(CodecError, match="whole number"):
            rdt_codec.records(payload)
    if len(payload) != 8:
        with pytest.raises(CodecError):
            rdt_codec.decode_request(payload)


def test_a_request_is_read_back_by_an_emulator() -> None:
    request = rdt_codec.decode_request(rdt_codec.encode_request(Command.START_BUFFERED, 12))
    assert (request.command, request.count) == (Command.START_BUFFERED, 12)


@pytest.mark.parametrize("payload", ["1235000200000000", "1234009900000000"])
def test_a_foreign_request_is_refused(payload: str) -> None:
    with pytest.raises(CodecError, match=r"header|command"):
        rdt_codec.decode_request(bytes.fromhex(payload))


def test_sequences_wrap_at_32_bits() -> None:
    one, row = np.array([2**32 + 5]), np.zeros((1, 6), int)
    assert next(rdt_codec.records(rdt_codec.encode_records(one, one, one * 0, row)))[0] == 5


@pytest.mark.parametrize("counts", [np.zeros((2, 5), int), np.full((1, 6), 2**31), np.zeros((3, 6), int)])
def test_counts_that_do_not_fit_are_refused(counts: np.ndarray) -> None:
    with pytest.raises(CodecError):
        rdt_codec.encode_records(np.zeros(1), np.zeros(1), np.zeros(1), counts)


def test_one_record_is_encoded_as_many_are() -> None:
    one, row = np.array([7]), np.arange(-3, 3)
    assert rdt_codec.encode_record(2**32 + 7, 7, 7, row.tolist()) == rdt_codec.encode_records(one, one, one, row[None])
    for counts in ([0] * 5, [2**31] * 6):
        with pytest.raises(CodecError, match="do not fit"):
            rdt_codec.encode_record(1, 1, 0, counts)


@pytest.mark.parametrize("count", [-1, 2**32])
def test_a_sample_count_beyond_32_bits_is_refused(count: int) -> None:
    with pytest.raises(CodecError, match="32 bits"):
        rdt_codec.encode_request(Command.START, count)


@pytest.mark.parametrize(
    ("status", "severity", "word"),
    [
        (0, Severity.OK, ""),
        (0x80010000, Severity.WARNING, "monitor"),
        (0x80020000, Severity.FAULT, "saturated"),
        (0x80000004, Severity.WARNING, "temperature"),
        (0x80000000, Severity.FAULT, "without naming"),
        (0x00008000, Severity.WARNING, "undocumented"),
        (0x82020002, Severity.FAULT, "halted"),
    ],
)
def test_status_words_are_told_in_english_with_their_severity(status: int, severity: Severity, word: str) -> None:
    report = rdt_codec.describe_status(status)
    assert report.severity is severity
    assert word in "; ".join(report.messages)
    assert bool(report.messages) == (severity is not Severity.OK)
