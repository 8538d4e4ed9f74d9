from __future__ import annotations

import pytest

from drivers.links import Datagram, MemoryLink, ReplayLink, TappedLink
from tactile_lab.clock import VirtualClock
from tactile_lab.errors import DeviceError


class Echo:
    """Answers every message with itself, stamped by count."""

    def __init__(self):
        self._waiting = []
        self._count = 0

    def write(self, payload):
        self._count += 1
        self._waiting.append(Datagram(payload, self._count))

    def read(self):
        waiting, self._waiting = self._waiting, []
        return waiting


class Diary:
    def __init__(self):
        self.entries = []

    def transmitted(self, link, payload, stamp_ns):
        self.entries.append(("tx", link, payload, stamp_ns))

    def received(self, link, payload, stamp_ns):
        self.entries.append(("rx", link, payload, stamp_ns))


def opened(link):
    link.open()
    return link


def test_a_memory_link_carries_messages_both_ways_in_order():
    link = opened(MemoryLink("hand", Echo()))
    link.send(b"one")
    link.send(b"two")
    assert link.receive() == [Datagram(b"one", 1), Datagram(b"two", 2)]
    assert link.receive() == []


@pytest.mark.parametrize("action", [lambda link: link.send(b"x"), lambda link: link.receive()])
def test_a_link_that_is_not_open_says_so_by_name(action):
    link = MemoryLink("hand", Echo())
    with pytest.raises(DeviceError, match="hand: link is not open"):
        action(link)
    opened(link).close()
    link.close()
    with pytest.raises(DeviceError, match="hand: link is not open"):
        action(link)


def test_a_replayed_link_gives_the_recorded_batches_and_keeps_what_was_sent():
    first, second, third = (Datagram(bytes([number]), number) for number in range(3))
    link = opened(ReplayLink("hand", [first, [second, third], []]))
    link.send(b"demand")
    assert [link.receive() for _ in range(3)] == [[first], [second, third], []]
    assert link.sent == [b"demand"]
    with pytest.raises(DeviceError, match="hand: the recording has ended"):
        link.receive()


def test_a_tap_sees_every_byte_with_its_stamp():
    diary, clock = Diary(), VirtualClock(50)
    link = opened(TappedLink(MemoryLink("hand", Echo()), diary, clock))
    link.send(b"ask")
    assert link.receive() == [Datagram(b"ask", 1)]
    assert diary.entries == [("tx", "hand", b"ask", 50), ("rx", "hand", b"ask", 1)]
    assert link.name == "hand"
    link.close()
    with pytest.raises(DeviceError):
        link.send(b"lost")
    assert diary.entries[-1] == ("tx", "hand", b"lost", 50)
