"""A network interface without a network: a socket that does what it is told, and the words for each of its failures."""

from __future__ import annotations

import errno
import socket
from typing import Any

import pytest

from drivers.core.errors import DeviceError
from drivers.ethercat import ports
from drivers.ethercat.ports import RawPort


class Socket:
    """Stands for a packet socket."""

    def __init__(self) -> None:
        self.told: list[Any] = []
        self.fails: OSError | None = None
        self.waiting: list[bytes] = []

    def __getattr__(self, name: str) -> Any:
        def called(*arguments: object) -> Any:
            self.told.append([name, *arguments])
            if self.fails is not None and name in ("bind", "send", "recv"):
                raise self.fails
            return {"getsockname": ("lo", 0, 0, 0, b"\x02\x01")}.get(name)

        return called

    def recv(self, most: int) -> bytes:
        self.told.append(["recv", most])
        if self.fails is not None:
            raise self.fails
        return self.waiting.pop(0)


@pytest.fixture
def raw(monkeypatch: pytest.MonkeyPatch) -> Socket:
    made = Socket()
    monkeypatch.setattr(socket, "socket", lambda *kind: made)
    monkeypatch.setattr(socket, "if_nameindex", lambda: [(1, "lo"), (2, "eth1")])
    monkeypatch.setattr(
        ports.select, "select", lambda reading, *others: (reading if made.waiting or made.fails else [], [], [])
    )
    return made


def test_frames_go_out_and_come_in_once_it_is_open(raw: Socket) -> None:
    port = RawPort("eth1")
    with pytest.raises(DeviceError, match="eth1: the interface is not open"):
        port.send(b"frame")
    port.open()
    port.open()
    assert port.hardware_address == b"\x02\x01"
    assert raw.told == [["setblocking", False], ["bind", ("eth1", 0x88A4)], ["getsockname"]]
    port.send(b"frame")
    assert raw.told[-1] == ["send", b"frame"]
    assert port.receive(0.0) is None
    raw.waiting = [b"answer"]
    assert port.receive(0.01) == b"answer"
    port.close()
    port.close()
    assert raw.told[-1] == ["close"]
    with pytest.raises(DeviceError, match="not open"):
        port.receive(0.0)


def test_a_full_queue_is_a_lost_frame_and_no_failure(raw: Socket) -> None:
    port = RawPort("eth1")
    port.open()
    raw.fails = BlockingIOError(errno.EAGAIN, "later")
    port.send(b"frame")
    assert port.receive(0.0) is None


@pytest.mark.parametrize(
    ("number", "words"),
    [
        (errno.ENETDOWN, "is down or gone. Plug the cable in and set it up: sudo ip link set eth1 up"),
        (errno.ENXIO, "is down or gone"),
        (errno.ENODEV, "is down or gone"),
        (errno.EIO, r"the network interface failed \(.*broken\). Check the adapter"),
    ],
)
def test_a_failing_interface_is_told_with_what_to_do(raw: Socket, number: int, words: str) -> None:
    port = RawPort("eth1")
    port.open()
    raw.fails = OSError(number, "broken")
    for act in (lambda: port.send(b""), lambda: port.receive(0.0)):
        with pytest.raises(DeviceError, match=f"eth1: .*{words}"):
            act()
    other = RawPort("eth1")
    with pytest.raises(DeviceError, match=words):
        other.open()
    assert raw.told[-1] == ["close"]


def test_an_interface_that_is_not_there_is_named_beside_those_that_are(raw: Socket) -> None:
    with pytest.raises(DeviceError, match=r"eth9: no such network interface\. Available interfaces: lo, eth1"):
        RawPort("eth9").open()
