"""Transports to real sockets, ports and buses, and what they say when something is wrong."""

from __future__ import annotations

import os
import pty
import socket
import time
from collections.abc import Iterator

import can
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from drivers.core.clock import MonotonicClock
from drivers.core.errors import CodecError, DeviceError
from drivers.core.transports import Datagram, Transport
from drivers.hardware.can_bus import CanFrame, CanTransport, decode_frame, encode_frame
from drivers.hardware.serial_port import SerialTransport
from drivers.hardware.udp import UdpTransport

CLOCK = MonotonicClock()


def wait_for(transport: Transport, count: int = 1) -> list[Datagram]:
    """What arrives, at least ``count`` messages within two seconds."""
    taken: list[Datagram] = []
    for _ in range(2000):
        taken += transport.receive()
        if len(taken) >= count:
            return taken
        time.sleep(0.001)
    raise AssertionError(f"{len(taken)} messages where {count} were expected")


@pytest.fixture
def device() -> Iterator[socket.socket]:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as made:
        made.bind(("127.0.0.1", 0))
        made.settimeout(2.0)
        yield made


@pytest.fixture
def udp(device: socket.socket) -> Iterator[UdpTransport]:
    transport = UdpTransport("ft/FF", "127.0.0.1", device.getsockname()[1], CLOCK, local=("127.0.0.1", 0))
    transport.open()
    transport.open()
    yield transport
    transport.close()
    transport.close()


def test_datagrams_come_in_order(udp: UdpTransport, device: socket.socket) -> None:
    udp.send(b"hello")
    _, client = device.recvfrom(100)
    for number in range(5):
        device.sendto(bytes([number]), client)
    arrived = wait_for(udp, 5)
    assert [datagram.payload for datagram in arrived] == [bytes([number]) for number in range(5)]
    stamps = [datagram.stamp_ns for datagram in arrived]
    assert stamps == sorted(stamps)
    assert udp.health() == ()


def test_datagrams_are_stamped_when_they_arrive_however_late_the_program_reads(
    udp: UdpTransport, device: socket.socket
) -> None:
    udp.send(b"hello")
    _, client = device.recvfrom(100)
    if not udp.kernel_stamps:
        pytest.skip("the kernel of this machine stamps no datagrams")

    def lateness_ns() -> int:
        before_ns = CLOCK.now_ns()
        device.sendto(b"reading", client)
        sent_ns = CLOCK.now_ns()
        time.sleep(0.05)
        (arrived,) = wait_for(udp, 1)
        assert arrived.stamp_ns >= before_ns - 1_000_000
        return arrived.stamp_ns - sent_ns

    # A busy machine may deliver one of them late; a program that stamps what it reads stamps all of them late.
    assert any(lateness_ns() < 10_000_000 for _ in range(20))


def test_a_stranger_is_counted_and_left_out(udp: UdpTransport, device: socket.socket) -> None:
    udp.send(b"hello")
    _, client = device.recvfrom(100)
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as stranger:
        stranger.bind(("127.0.0.9", 0))
        stranger.sendto(b"forged", client)
    device.sendto(b"real", client)
    assert [datagram.payload for datagram in wait_for(udp)] == [b"real"]
    assert udp.health() == ("1 datagrams from other addresses than 127.0.0.1 ignored",)


def test_what_the_kernel_drops_is_known(device: socket.socket) -> None:
    transport = UdpTransport("ft/FF", "127.0.0.1", device.getsockname()[1], CLOCK, receive_buffer=4096)
    transport.open()
    transport.send(b"hello")
    _, client = device.recvfrom(100)
    for _ in range(300):
        device.sendto(bytes(500), client)
    taken = wait_for(transport)
    device.sendto(b"last", client)
    taken += wait_for(transport)
    transport.close()
    assert len(taken) < 301
    assert transport.dropped == 301 - len(taken)
    assert "dropped by the kernel" in transport.health()[0]


def test_an_address_that_does_not_exist_is_named() -> None:
    transport = UdpTransport("ft/FF", "no-such-box.invalid", 49152, CLOCK)
    with pytest.raises(DeviceError, match=r"ft/FF: cannot open a UDP socket to no-such-box.invalid:49152"):
        transport.open()
    with pytest.raises(DeviceError, match="the transport is not open"):
        transport.receive()


def test_a_serial_port_carries_bytes_both_ways_and_is_ours_alone() -> None:
    master, slave = pty.openpty()
    transport = SerialTransport("ft/MF", os.ttyname(slave), 115200, CLOCK)
    transport.open()
    transport.send(b"\x00\x0a\xff")
    assert os.read(master, 100) == b"\x00\x0a\xff"
    os.write(master, b"\x0d\x11\x13")
    assert b"".join(datagram.payload for datagram in wait_for(transport)) == b"\x0d\x11\x13"
    with pytest.raises(DeviceError, match="in use by another program"):
        SerialTransport("ft/RF", os.ttyname(slave), 115200, CLOCK).open()
    os.close(slave)
    os.close(master)
    with pytest.raises(DeviceError, match=r"ft/MF: the serial port .* was disconnected"):
        wait_for(transport)
    transport.close()
    transport.close()


def test_a_serial_port_that_was_never_opened_says_so() -> None:
    port = SerialTransport("ft/MF", "/dev/nothing-here", 9600, CLOCK)
    for act in (port.receive, lambda: port.send(b"x")):
        with pytest.raises(DeviceError, match=r"ft/MF: the transport is not open\. Connect the device first"):
            act()


def test_a_serial_port_that_is_none_says_so() -> None:
    with pytest.raises(DeviceError, match=r"ft/MF: there is no serial port /dev/nothing-here"):
        SerialTransport("ft/MF", "/dev/nothing-here", 9600, CLOCK).open()
    with pytest.raises(DeviceError, match="/dev/null cannot be opened"):
        SerialTransport("ft/MF", "/dev/null", 9600, CLOCK).open()


def test_a_pseudo_terminal_that_refuses_even_parity_says_so() -> None:
    master, slave = pty.openpty()
    path = os.ttyname(slave)

    def open_twice() -> None:  # some kernels refuse it at once, others when it is opened again
        for _ in range(2):
            transport = SerialTransport("ft/MF", path, 115200, CLOCK, parity="E")
            transport.open()
            transport.close()

    with pytest.raises(DeviceError, match="does not support 115200 baud with parity E"):
        open_twice()
    os.close(master)
    os.close(slave)


def test_frames_pass_a_can_bus_and_others_are_counted() -> None:
    transport = CanTransport("ft/TH", lambda: can.Bus(interface="virtual", channel="links"), CLOCK)
    with can.Bus(interface="virtual", channel="links") as other:
        transport.open()
        transport.open()
        transport.send(encode_frame(CanFrame(0x205, b"\x01")))
        asked = other.recv(2.0)
        assert asked is not None
        assert (asked.arbitration_id, bytes(asked.data), asked.is_extended_id) == (0x205, b"\x01", False)
        other.send(can.Message(arbitration_id=0x12345, is_extended_id=True, data=b"1"))
        other.send(can.Message(arbitration_id=0x205, is_extended_id=False, is_error_frame=True))
        other.send(can.Message(arbitration_id=0x205, is_extended_id=False, data=b"FT001"))
        assert [decode_frame(datagram.payload) for datagram in wait_for(transport)] == [CanFrame(0x205, b"FT001")]
        assert transport.health() == ("1 error frames on the bus", "1 frames of another kind ignored")
        transport.close()
        transport.close()


def test_a_bus_that_can_not_be_opened_says_why() -> None:
    transport = CanTransport("ft/TH", lambda: can.Bus(interface="no-such-adapter", channel="0"), CLOCK)
    with pytest.raises(DeviceError, match="ft/TH: the CAN bus cannot be opened"):
        transport.open()


def test_a_damaged_line_of_a_text_adapter_is_counted() -> None:
    class Damaged:
        lines: list[object]

        def recv(self, timeout: float) -> can.Message | None:
            if not self.lines:
                return None
            if self.lines.pop(0) is None:
                raise ValueError("invalid literal for int()")
            return can.Message(arbitration_id=5, is_extended_id=False, data=b"1")

        def shutdown(self) -> None:
            """Nothing to close."""

    bus = Damaged()
    bus.lines = [None, 1, None]
    transport = CanTransport("ft/TH", lambda: bus, CLOCK)  # type: ignore[arg-type,return-value]
    transport.open()
    assert len(transport.receive()) == 1
    assert transport.health() == ("2 damaged readings of the adapter",)
    transport.close()


@settings(max_examples=60, derandomize=True)
@given(st.integers(0, 2047), st.binary(max_size=8))
def test_can_frames_survive_encoding_and_decoding(identifier: int, data: bytes) -> None:
    assert decode_frame(encode_frame(CanFrame(identifier, data))) == CanFrame(identifier, data)


@settings(max_examples=60, derandomize=True)
@given(st.binary(max_size=14))
def test_any_bytes_are_a_can_frame_or_a_codec_error(payload: bytes) -> None:
    try:
        assert encode_frame(decode_frame(payload)) == payload
    except CodecError:
        assert not (2 <= len(payload) <= 10) or payload[0] >= 8


@pytest.mark.parametrize("frame", [CanFrame(2048, b""), CanFrame(-1, b""), CanFrame(1, bytes(9))])
def test_a_frame_that_does_not_fit_is_refused(frame: CanFrame) -> None:
    with pytest.raises(CodecError):
        encode_frame(frame)
