from __future__ import annotations

import random

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from drivers.core.errors import CodecError
from drivers.ethercat.frames import LARGEST_DATA, Command, Telegram, decode_frame, encode_frame, physical
from drivers.ethercat.registers import AlState, AlStatus

SOURCE = bytes.fromhex("02003c000100")

telegrams = st.builds(
    Telegram,
    command=st.sampled_from(Command),
    address=st.integers(0, 2**32 - 1),
    data=st.binary(max_size=200),
    index=st.integers(0, 255),
    working_counter=st.integers(0, 2**16 - 1),
    interrupt=st.integers(0, 2**16 - 1),
    circulated=st.booleans(),
)


def test_a_frame_has_the_bytes_of_the_standard() -> None:
    frame = encode_frame((Telegram(Command.APRD, physical(-1, 0x0130), bytes(2), index=7),), SOURCE)
    head = bytes.fromhex("ffffffffffff 02003c000100 88a4")
    assert frame == (head + bytes.fromhex("0e10 01 07 ffff 3001 0200 0000 0000 0000")).ljust(60, b"\0")


def test_all_but_the_last_telegram_say_that_more_follow() -> None:
    first, second = Telegram(Command.BRD, 0, bytes(1)), Telegram(Command.LRW, 0x10000, bytes(3))
    frame = encode_frame((first, second), SOURCE)
    assert frame[22:24] == bytes.fromhex("0180")
    assert frame[35:37] == bytes.fromhex("0300")


@settings(max_examples=60, derandomize=True)
@given(st.lists(telegrams, min_size=1, max_size=5))
def test_decoding_undoes_encoding(sent: list[Telegram]) -> None:
    assert decode_frame(encode_frame(sent, SOURCE)) == tuple(sent)


def test_any_bytes_decode_or_are_refused_in_our_words() -> None:
    rng = random.Random(11)
    good = encode_frame((Telegram(Command.LRW, 0x10000, bytes(40)), Telegram(Command.BRD, 0, bytes(2))), SOURCE)
    refused = 0
    for _ in range(3000):
        frame = bytearray(good[: rng.randrange(len(good) + 1)])
        for _ in range(rng.randrange(4)):
            if frame:
                frame[rng.randrange(len(frame))] = rng.randrange(256)
        try:
            decode_frame(bytes(frame))
        except CodecError:
            refused += 1
    assert 1000 < refused < 3000


@pytest.mark.parametrize(
    ("frame", "words"),
    [
        (b"", "a frame of 0 bytes"),
        (bytes(60), "EtherType 0x0000"),
        (bytes(12) + b"\x88\xa4\x0e\x40" + bytes(44), "type 4"),
        (bytes(12) + b"\x88\xa4\xff\x17" + bytes(44), "shorter than its stated length"),
        (bytes(12) + b"\x88\xa4\x05\x10" + bytes(44), "truncated"),
        (bytes(12) + b"\x88\xa4\x0c\x10\x63" + bytes(43), "unknown command 99"),
    ],
)
def test_a_damaged_frame_says_what_is_wrong(frame: bytes, words: str) -> None:
    with pytest.raises(CodecError, match=words):
        decode_frame(frame)


@pytest.mark.parametrize(
    "bad",
    [
        [],
        [Telegram(Command.LRW, 0, bytes(LARGEST_DATA + 1))],
        [Telegram(Command.LRW, 0, bytes(800)), Telegram(Command.LRW, 0, bytes(800))],
        [Telegram(Command.LRW, 2**32, b"")],
    ],
)
def test_what_does_not_fit_a_frame_is_refused(bad: list[Telegram]) -> None:
    with pytest.raises(CodecError):
        encode_frame(bad, SOURCE)


def test_an_answer_is_told_from_anything_else() -> None:
    request = Telegram(Command.APRD, physical(0, 0x130), bytes(6), index=3)
    passed = Telegram(Command.APRD, physical(2, 0x130), b"123456", index=3, working_counter=1)
    assert passed.answers(request)
    assert not Telegram(Command.APRD, physical(2, 0x130), b"123456", index=4).answers(request)
    assert not Telegram(Command.APRD, physical(2, 0x120), b"123456", index=3).answers(request)
    assert not Telegram(Command.APRD, physical(2, 0x130), b"1234", index=3).answers(request)


@pytest.mark.parametrize(
    ("status", "words"),
    [
        (AlStatus(AlState.OP), "OP"),
        (AlStatus(AlState.SAFEOP, True, 0x1B), "SAFEOP with error 0x001B, watchdog: no process data arrived in time"),
        (AlStatus(AlState.PREOP, True, 0x1E), "PREOP with error 0x001E, input SyncManagers have a wrong address"),
        (AlStatus(AlState.INIT, True, 0x7777), "INIT with error 0x7777, a code without published meaning"),
        (AlStatus(5), "unknown state 5"),
    ],
)
def test_a_slaves_state_is_told_in_words(status: AlStatus, words: str) -> None:
    assert str(status).startswith(words)
    assert AlStatus.decode(status.encode()) == status


def test_a_status_of_wrong_length_is_refused() -> None:
    with pytest.raises(CodecError, match="5 bytes"):
        AlStatus.decode(bytes(5))
