"""What the web page of a Net F/T box must report before its stream is started, and the rate it is set to."""

from __future__ import annotations

from dataclasses import replace

import pytest

from drivers.ati.protocols.rdt_codec import Command, encode_request
from drivers.ati.wires import net_box
from drivers.ati.wires.conversation import Conversation
from drivers.ati.wires.net_box import NetBoxPage
from drivers.ati.wires.rdt_wire import BoxPages, RdtWire
from drivers.core.clock import VirtualClock
from drivers.core.errors import DeviceError
from drivers.core.transports import Datagram, MemoryTransport
from drivers.emulators.ati.net_box_unit import NetBoxUnit
from tests.support.unit_peer import UnitPeer

PAGE = NetBoxPage("Net F/T", "2.0", "FT12345", 1e6, 1e6, 1000, True, 0, (0.0,) * 6)
WANTED = BoxPages("192.168.1.1", 80, 1000, "FT12345")


class Sent(MemoryTransport):
    """Keeps what is sent."""

    def __init__(self, clock: VirtualClock) -> None:
        super().__init__("ft/FF", UnitPeer(NetBoxUnit(), clock))
        self.sent: list[bytes] = []

    def send(self, payload: bytes) -> None:
        self.sent.append(payload)
        super().send(payload)


def started(page: NetBoxPage, wanted: BoxPages, patch: pytest.MonkeyPatch) -> tuple[RdtWire, list[bytes]]:
    """A wire after its start beside a box with that page, and the requests that the box got before."""
    patch.setattr(net_box, "fetch_page", lambda host, port: page)
    clock = VirtualClock()
    transport, wire = Sent(clock), RdtWire(1e6, 1e6, wanted)
    transport.open()

    def listen(datagram: Datagram) -> None:
        wire.receive(datagram)

    try:
        wire.start(Conversation(transport, clock, listen))
    except DeviceError as error:
        if "no record arrives" not in error.what:
            assert encode_request(Command.START) not in transport.sent
            raise
    return wire, transport.sent


def test_a_box_as_the_rig_names_it_is_started_after_an_old_stream_was_stopped(monkeypatch: pytest.MonkeyPatch) -> None:
    for wanted in (WANTED, replace(WANTED, serial="")):
        wire, sent = started(PAGE, wanted, monkeypatch)
        assert sent == [encode_request(Command.STOP), encode_request(Command.START)]
        assert wire.page == PAGE


@pytest.mark.parametrize(
    ("page", "words"),
    [
        (replace(PAGE, serial="FT9"), "uses the calibration of FT9, but the rig file names FT12345"),
        (replace(PAGE, counts_per_N=2e6), r"2e\+06 per N|2e\+06 counts per N and 1e\+06 per N m"),
        (replace(PAGE, counts_per_Nm=2e6), r"1e\+06 counts per N and 2e\+06 per N m"),
        (replace(PAGE, tool=(0.0, 0.0, 5.0, 0.0, 0.0, 0.0)), "applies its own tool transform"),
        (replace(PAGE, rdt_enabled=False), "RDT interface is switched off"),
    ],
)
def test_another_box_or_other_settings_are_refused_before_anything_streams(
    monkeypatch: pytest.MonkeyPatch, page: NetBoxPage, words: str
) -> None:
    with pytest.raises(DeviceError, match=words):
        started(page, WANTED, monkeypatch)


def test_another_rate_is_set_and_the_same_one_left_alone(monkeypatch: pytest.MonkeyPatch) -> None:
    asked: list[int] = []

    def set_rate(host: str, port: int, rate_hz: int) -> NetBoxPage:
        asked.append(rate_hz)
        return replace(PAGE, rate_hz=rate_hz)

    monkeypatch.setattr(net_box, "set_rate", set_rate)
    started(PAGE, WANTED, monkeypatch)
    assert asked == []
    wire, _ = started(replace(PAGE, rate_hz=7000), WANTED, monkeypatch)
    assert asked == [1000]
    assert wire.page == PAGE


@pytest.mark.parametrize(("stays_hz", "refused"), [(1000, False), (990, True), (2333, True)])
def test_a_rate_the_box_does_not_take_is_told(monkeypatch: pytest.MonkeyPatch, stays_hz: int, refused: bool) -> None:
    visited: list[str] = []
    monkeypatch.setattr(net_box, "fetch_page", lambda *_: replace(PAGE, rate_hz=stays_hz))
    monkeypatch.setattr(net_box, "_get", lambda host, port, path, timeout_s: visited.append(path))
    if refused:
        with pytest.raises(DeviceError, match=f"1000 records per second .* stays at {stays_hz}"):
            net_box.set_rate("box", 80, 1000)
    else:
        assert net_box.set_rate("box", 80, 1000).rate_hz == 1000
    assert visited == ["/comm.cgi?comrdtrate=1000"]
