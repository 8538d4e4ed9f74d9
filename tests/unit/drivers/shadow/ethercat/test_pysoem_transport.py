"""The hand's transport over SOEM where SOEM itself is absent, or stands in: how often it looks before it refuses."""

from __future__ import annotations

import sys
from types import SimpleNamespace
from typing import Any

import pytest

from drivers.core.clock import VirtualClock
from drivers.core.errors import ConfigurationError, DeviceError
from drivers.ethercat.master import MasterSettings
from drivers.shadow.ethercat.hand_transport import EthercatSettings
from drivers.shadow.ethercat.pysoem_transport import LOOKS, PysoemTransport
from drivers.shadow.protocol.palm_images import PALMS

OP, REFUSED, USUAL_us = 8, 0x12, 2000
SIZES = PALMS["0220"].command_bytes, PALMS["0220"].status_bytes


def board(product: int, serial: int = 0, vendor: int = 0x530, sizes: tuple[int, int] = (0, 0), state: int = OP) -> Any:
    """A slave as SOEM shows it."""
    words = serial.to_bytes(4, "little")
    output, images = bytes(sizes[0]), bytes(sizes[1])
    return SimpleNamespace(
        man=vendor,
        id=product,
        rev=1,
        eeprom_read=lambda word: words,
        output=output,
        input=images,
        state=state,
        al_status=0x1E,
    )


HAND = (board(0), board(6, 634, sizes=SIZES))
NAMELESS = (board(0, vendor=0), board(0, vendor=0))
UNMAPPED = (board(0), board(6, 634))
REFUSING = (board(0), board(6, 634, sizes=SIZES, state=REFUSED))
WITHOUT_SERIAL = (board(0), board(6, sizes=SIZES))


class Soem:
    """Stands in for the module: each look at the ring shows what is next in line, the last for ever."""

    INIT_STATE, SAFEOP_STATE, OP_STATE = 1, 4, OP

    def __init__(self, *looks: tuple[Any, ...]) -> None:
        self._looks, self.patience_us = looks, list[int]()
        self.settings = SimpleNamespace(timeouts=SimpleNamespace(ret=USUAL_us))
        self.slaves: tuple[Any, ...] = ()
        self.is_open, self.state, self.requested = False, 0, 0
        self.awaited: set[int] = set()

    @property
    def looked(self) -> int:
        """How often the ring was looked at."""
        return len(self.patience_us)

    def Master(self) -> Soem:
        return self

    def open(self, interface: str) -> None:
        self.is_open = True

    def close(self) -> None:
        self.is_open = False

    def config_init(self) -> int:
        self.slaves = self._looks[min(self.looked, len(self._looks) - 1)]
        self.patience_us.append(self.settings.timeouts.ret)
        self.awaited.clear()
        return len(self.slaves) or -1

    def config_map(self) -> None:
        """The process data are those of the look."""

    def write_state(self) -> None:
        """Slaves obey what is requested, and nothing else; to OP they go from SAFEOP alone, which takes its time."""
        if self.state != OP or self.SAFEOP_STATE in self.awaited:
            self.requested = self.state

    def read_state(self) -> None:
        """The states are those of the look."""

    def state_check(self, state: int, timeout_us: int) -> int:
        self.awaited.add(state)
        return OP if self.requested == OP and all(slave.state == OP for slave in self.slaves) else REFUSED

    def send_processdata(self) -> None:
        """Nothing moves."""

    def receive_processdata(self, timeout_us: int) -> int:
        return 3


def opened(monkeypatch: pytest.MonkeyPatch, soem: Soem, **settings: Any) -> PysoemTransport:
    monkeypatch.setitem(sys.modules, "pysoem", soem)
    transport = PysoemTransport("hand", EthercatSettings(interface="lo", **settings), VirtualClock())
    transport.open()
    return transport


def test_without_pysoem_the_message_says_how_to_get_it(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "pysoem", None)
    with pytest.raises(ConfigurationError, match=r"pysoem is not installed. Install it: .* install pysoem"):
        PysoemTransport("hand", EthercatSettings(interface="lo"), VirtualClock())


@pytest.mark.parametrize("misread", [NAMELESS, UNMAPPED, (), HAND[:1], WITHOUT_SERIAL, REFUSING])
def test_a_hand_that_was_misread_is_looked_at_again_and_that_is_told(
    monkeypatch: pytest.MonkeyPatch, misread: tuple[Any, ...]
) -> None:
    soem = Soem(misread, HAND)
    transport = opened(monkeypatch, soem, serial=634)
    assert (transport.hand.serial, transport.counts.misread, soem.looked) == (634, 1, 2)
    assert transport.health() == ("the hand was not found in the first 1 scans of its EtherCAT ring",)


def test_a_hand_that_is_read_rightly_is_looked_at_once_with_the_patience_of_the_settings(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    soem = Soem(HAND)
    transport = opened(monkeypatch, soem, master=MasterSettings(setup_answer_s=0.03))
    assert (soem.patience_us, soem.settings.timeouts.ret) == ([30_000], USUAL_us)
    assert transport.health() == ()
    assert soem.requested == OP
    transport.close()
    assert (soem.requested, soem.is_open) == (Soem.INIT_STATE, False)


@pytest.mark.parametrize(
    ("ring", "words"),
    [
        (NAMELESS, r"slave is from vendor 0x0, not from Shadow Robot \(0x530\), at the last of 5 scans of the ring"),
        ((board(0), board(77, sizes=SIZES)), r"second slave is .* \(product 0x4d\)"),
        ((board(0), board(6, 3, sizes=SIZES)), "hand 3, not hand 634"),
    ],
)
def test_what_is_foreign_in_every_look_is_refused(
    monkeypatch: pytest.MonkeyPatch, ring: tuple[Any, ...], words: str
) -> None:
    soem = Soem(ring)
    with pytest.raises(DeviceError, match=words):
        opened(monkeypatch, soem, serial=634)
    assert soem.looked == LOOKS
    assert not soem.is_open
