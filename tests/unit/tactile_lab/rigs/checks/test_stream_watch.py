"""How regularly messages arrive, once all devices are connected."""

from __future__ import annotations

import pytest

from sessions.recording.traffic.schemas import received_topic
from tactile_lab.rigs.checks.stream_watch import StreamWatch, in_words

TOPIC = received_topic("base")


def test_the_pause_while_other_devices_connect_is_not_counted() -> None:
    watch = StreamWatch()
    watch.write(TOPIC, b"", 0)
    watch.begin()
    for number in range(101):
        watch.write(TOPIC, b"", 3_000_000_000 + 10_000_000 * number)
    figures = watch.figures("base")
    assert figures["rate_Hz"] == pytest.approx(100.0)
    assert figures["longest_gap_ms"] == pytest.approx(10.0)
    assert in_words(figures) == "100 messages/s, jitter 0.00 ms"


def test_two_messages_tell_no_rate() -> None:
    watch = StreamWatch()
    watch.write(TOPIC, b"", 0)
    watch.write(TOPIC, b"", 10_000_000)
    assert watch.figures("base") == {}
    assert in_words({}) == ""
