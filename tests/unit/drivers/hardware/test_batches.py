"""Many datagrams at once: the same as one by one, in the codec, the device, the emulator and the socket."""

from __future__ import annotations

import socket
import struct
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

from drivers.ati.nano17 import Nano17, Nano17Settings
from drivers.ati.protocols import rdt_codec
from drivers.ati.protocols.rdt_codec import Command
from drivers.ati.wires.rdt_wire import RdtWire
from drivers.core.clock import MonotonicClock, VirtualClock
from drivers.core.fingertip import load_fingertips
from drivers.core.transports import Datagram, ReplayTransport
from drivers.emulators.ati.net_box_unit import NetBoxUnit
from drivers.emulators.ati.sensor import EmulatedSensor
from drivers.force.force_fingertip import WrenchSample
from drivers.hardware import udp
from drivers.hardware.batches import AT_ONCE, SO_RXQ_OVFL, SO_TIMESTAMPNS, BatchReceiver, _words, can_batch
from drivers.hardware.udp import UdpTransport
from tactile_lab import rigs

TIPS = Path(rigs.__file__).parent / "calibrations" / "simulated-hand" / "fingertips.yaml"


def datagrams(seed: int = 1) -> list[Datagram]:
    """Datagrams of one to five records, and some that are none."""
    rng = np.random.default_rng(seed)
    found, sequence = [], 0
    for number in range(60):
        count = int(rng.integers(1, 6))
        numbers = np.arange(sequence, sequence + count)
        counts = rng.integers(-(2**31) + 1, 2**31, (count, 6))
        status = rng.integers(0, 2**32, count)
        found.append(Datagram(rdt_codec.encode_records(numbers, 7 * numbers, status, counts), 1000 * number))
        sequence += count
    return [*found, Datagram(b"", 1), Datagram(bytes(35), 2)]


def same(a: WrenchSample, b: WrenchSample) -> bool:
    others = (a.stamp_ns, a.sent, a.measured, a.status) == (
        b.stamp_ns,
        b.sent,
        b.measured,
        b.status,
    )
    return others and bool((a.wrench == b.wrench).all())


def test_many_datagrams_decode_as_one_by_one() -> None:
    wire = RdtWire(1e6, 2e6)
    one_by_one = [sample for each in datagrams()[:-2] for sample in wire.receive(each)]
    together, foreign = wire.receive_many(datagrams())
    assert foreign == 2
    assert len(together) == len(one_by_one)
    assert all(map(same, together, one_by_one))
    assert wire.receive_many([]) == ([], 0)


def test_the_device_decodes_what_waits_together_and_counts_strangers() -> None:
    class Waiting(ReplayTransport):
        def receive(self) -> list[Datagram]:
            return datagrams()

    calibration = load_fingertips(TIPS)["FF"]
    device = Nano17("FF", Waiting("ft/FF", ()), VirtualClock(), calibration, Nano17Settings())
    samples = device.poll()
    assert len(samples) == sum(len(each.payload) // 36 for each in datagrams()[:-2])
    assert device.foreign_datagrams == 2


def test_an_emulated_box_sends_the_same_counters_together_as_one_by_one() -> None:
    boxes = [NetBoxUnit(EmulatedSensor(noise_counts=0.0), rate_hz=1000) for _ in range(2)]
    for box in boxes:
        assert box.ticks(3) == []  # nobody listens yet
        box.handle(rdt_codec.encode_request(Command.START, 10))
    together = [*boxes[0].ticks(4), *boxes[0].ticks(0), *boxes[0].ticks(20)]
    one_by_one = [record for _ in range(24) if (record := boxes[1].tick())]
    assert len(together) == 10
    heads = [[next(rdt_codec.records(record))[:3] for record in box] for box in (together, one_by_one)]
    assert heads[0] == heads[1]
    assert not boxes[0].streaming


@pytest.fixture
def pair() -> Iterator[tuple[socket.socket, socket.socket]]:
    with (
        socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as near,
        socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as far,
    ):
        for end in (near, far):
            end.bind(("127.0.0.1", 0))
        near.setblocking(False)
        yield near, far


@pytest.mark.skipif(not can_batch(), reason="this system has no recvmmsg as laid out here")
def test_a_batch_holds_payloads_senders_and_stamps(pair: tuple[socket.socket, socket.socket]) -> None:
    near, far = pair
    near.setsockopt(socket.SOL_SOCKET, SO_TIMESTAMPNS, 1)
    near.setsockopt(socket.SOL_SOCKET, SO_RXQ_OVFL, 1)
    receiver = BatchReceiver(near)
    assert receiver.receive().payloads == []
    sent = [bytes([number % 256]) * (number % 300) for number in range(AT_ONCE + 20)]
    for payload in sent:
        far.sendto(payload, near.getsockname())
    first, second = receiver.receive(), receiver.receive()
    assert first.payloads + second.payloads == sent
    assert len(first.payloads) == AT_ONCE
    assert set(first.ports.tolist()) == {far.getsockname()[1]}
    assert set(first.hosts.tolist()) == {0x7F000001}
    assert (np.diff(first.walls_ns) >= 0).all()
    assert first.walls_ns[0] > 1_600_000_000_000_000_000
    near.close()
    with pytest.raises(OSError, match="Bad file"):
        receiver.receive()


def test_ancillary_words_are_found_in_any_order() -> None:
    drops = struct.pack("@niiI4x", 20, 1, SO_RXQ_OVFL, 7)
    stamp = struct.pack("@niiqq", 32, 1, SO_TIMESTAMPNS, 3, 5)
    assert _words(drops + stamp) == {SO_RXQ_OVFL: 7, SO_TIMESTAMPNS: 3_000_000_005}
    assert _words(b"") == {}
    assert _words(bytes(64)) == {}


def test_without_batches_datagrams_are_read_one_by_one(
    pair: tuple[socket.socket, socket.socket], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(udp, "can_batch", lambda: False)
    _, far = pair
    transport = UdpTransport("ft/FF", "127.0.0.1", far.getsockname()[1], MonotonicClock(), local=("127.0.0.1", 0))
    transport.open()
    transport.send(b"start")
    _, client = far.recvfrom(10)
    for payload in (b"one", b"", b"three"):
        far.sendto(payload, client)
    assert [each.payload for each in transport.receive()] == [b"one", b"", b"three"]
    assert not transport.kernel_stamps
    transport.close()
