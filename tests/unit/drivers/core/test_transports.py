from __future__ import annotations

import pytest

from drivers.core.clock import VirtualClock
from drivers.core.errors import DeviceError
from drivers.core.transports import Datagram, MemoryTransport, ReplayTransport, TappedTransport


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

    def on_transmitted(self, transport, payload, stamp_ns):
        self.entries.append(("tx", transport, payload, stamp_ns))

    def on_received(self, transport, payload, stamp_ns):
        self.entries.append(("rx", transport, payload, stamp_ns))


def opened(transport):
    transport.open()
    return transport


def test_a_memory_link_carries_messages_both_ways_in_order():
    transport = opened(MemoryTransport("hand", Echo()))
    transport.send(b"one")
    transport.send(b"two")
    assert transport.receive() == [Datagram(b"one", 1), Datagram(b"two", 2)]
    assert transport.receive() == []


@pytest.mark.parametrize("action", [lambda transport: transport.send(b"x"), lambda transport: transport.receive()])
def test_a_link_that_is_not_open_says_so_by_name(action):
    transport = MemoryTransport("hand", Echo())
    with pytest.raises(DeviceError, match="hand: the transport is not open"):
        action(transport)
    opened(transport).close()
    transport.close()
    with pytest.raises(DeviceError, match="hand: the transport is not open"):
        action(transport)


def test_a_replayed_link_gives_the_recorded_batches_and_keeps_what_was_sent():
    first, second, third = (Datagram(bytes([number]), number) for number in range(3))
    transport = opened(ReplayTransport("hand", [first, [second, third], []]))
    transport.send(b"demand")
    assert [transport.receive() for _ in range(3)] == [[first], [second, third], []]
    assert transport.sent == [b"demand"]
    with pytest.raises(DeviceError, match="hand: the recording has ended"):
        transport.receive()


def test_a_tap_sees_every_byte_with_its_stamp():
    diary, clock = Diary(), VirtualClock(50)
    transport = opened(TappedTransport(MemoryTransport("hand", Echo()), diary, clock))
    transport.send(b"ask")
    assert transport.receive() == [Datagram(b"ask", 1)]
    assert diary.entries == [("tx", "hand", b"ask", 50), ("rx", "hand", b"ask", 1)]
    assert transport.name == "hand"
    transport.close()
    with pytest.raises(DeviceError):
        transport.send(b"lost")
    assert diary.entries[-1] == ("tx", "hand", b"lost", 50)
