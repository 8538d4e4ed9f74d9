"""Messages over TCP: cut from the stream however they come, and what is said when the other side fails."""

from __future__ import annotations

import socket
import threading
from collections.abc import Iterator
from contextlib import contextmanager

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from drivers.core.clock import MonotonicClock
from drivers.core.errors import CodecError, DeviceError
from drivers.hardware.tcp import LONGEST, MessageReader, TcpTransport, frame


@contextmanager
def device() -> Iterator[tuple[TcpTransport, socket.socket]]:
    """A connected transport, and the device's end of it."""
    with socket.create_server(("127.0.0.1", 0)) as server:
        transport = TcpTransport("camera", "127.0.0.1", server.getsockname()[1], MonotonicClock())
        opening = threading.Thread(target=transport.open)
        opening.start()
        far, _ = server.accept()
        opening.join()
        with far:
            yield transport, far
        transport.close()
        transport.close()


def received(transport: TcpTransport, count: int) -> list[bytes]:
    messages: list[bytes] = []
    for _ in range(5000):
        messages += [datagram.payload for datagram in transport.receive()]
        if len(messages) >= count:
            break
        threading.Event().wait(0.002)
    return messages


@given(st.lists(st.binary(max_size=50), max_size=8), st.lists(st.integers(1, 30), min_size=1, max_size=20))
@settings(max_examples=80, derandomize=True)
def test_messages_come_out_whole_however_the_stream_is_cut(messages: list[bytes], cuts: list[int]) -> None:
    stream, reader, out = b"".join(map(frame, messages)), MessageReader(), list[bytes]()
    while stream:
        for cut in cuts:
            out += reader.feed(stream[:cut])
            stream = stream[cut:]
    assert out == messages


def test_a_length_that_no_message_has() -> None:
    with pytest.raises(CodecError, match="Is this the device's port"):
        MessageReader().feed((LONGEST + 1).to_bytes(4, "little"))


def test_both_ways() -> None:
    with device() as (transport, far):
        transport.send(b"TRIGGER")
        assert far.recv(100) == frame(b"TRIGGER")
        picture = bytes(range(256)) * 1000
        far.sendall(frame(picture) + frame(b""))
        assert received(transport, 2) == [picture, b""]
        assert transport.receive() == []


def test_a_device_that_goes_is_told() -> None:
    with device() as (transport, far):
        far.sendall(frame(b"last"))
        far.close()
        assert received(transport, 1) == [b"last"]
        with pytest.raises(DeviceError, match=r"camera: lost the connection to 127.0.0.1:\d+ \(the device closed"):
            received(transport, 1)


def test_another_protocol_at_the_port_is_told() -> None:
    with device() as (transport, far):
        far.sendall(b"HTTP/1.1 400 Bad Request")
        with pytest.raises(DeviceError, match="speaks another protocol"):
            received(transport, 1)


def test_nobody_there() -> None:
    with socket.create_server(("127.0.0.1", 0)) as server:
        port = server.getsockname()[1]
    with pytest.raises(DeviceError, match=f"camera: cannot connect to 127.0.0.1:{port}"):
        TcpTransport("camera", "127.0.0.1", port, MonotonicClock()).open()
    with pytest.raises(DeviceError, match="the transport is not open"):
        TcpTransport("camera", "127.0.0.1", port, MonotonicClock()).receive()
