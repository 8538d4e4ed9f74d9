"""Every telegram from an open cable to a hand in operation and back, and what the emulated slaves answer."""

from __future__ import annotations

from typing import Any

import pytest

from drivers.emulators.ethercat.shadow_chain import ChainSettings, EepromKind
from drivers.ethercat.frames import decode_frame
from drivers.shadow.protocol.palm_images import PalmName
from drivers.shadow.protocol.palm_messages import PalmCommand
from tests.support.baseline import assert_baseline
from tests.support.digest import digest
from tests.support.emulated_hand_wire import Wire
from tests.support.plain_values import plain


class Overheard:
    """Stands between the port and the slaves, and notes what passes."""

    def __init__(self, wire: Wire) -> None:
        self.told: list[str] = []
        self.sent = self.answered = b""
        self._process, self._wire = wire.hand.ring.process, wire
        wire.hand.ring.process = self.process  # type: ignore[method-assign]

    def process(self, frame: bytes) -> list[bytes]:
        answers = self._process(frame)
        self.sent += frame
        self.answered += b"".join(answers)
        for asked, answer in zip(decode_frame(frame), decode_frame(answers[0]) if answers else (), strict=False):
            data = f"{asked.data[:12].hex()} -> {answer.data[:12].hex()}, {len(answer.data)} bytes"
            now_us = self._wire.clock.now_ns() // 1000
            self.told.append(
                f"{now_us} {asked.command.name} {asked.address:08x} {asked.index}: {data}, {answer.working_counter}"
            )
        return answers


@pytest.mark.parametrize(
    ("palm", "eeprom", "settings"),
    [
        ("0220", "bare", {}),
        ("0230", "mapped", {"watchdog_s": 0.05}),
        ("0240", "mapped", {}),
        ("0250", "mapped", {"serial": 634}),
    ],
)
def test_a_hand_is_opened_served_and_closed(palm: PalmName, eeprom: EepromKind, settings: dict[str, Any]) -> None:
    wire = Wire(ChainSettings(palm=palm, eeprom=eeprom), **settings)
    overheard = Overheard(wire)
    wire.transport.open()
    opened = list(overheard.told)
    for cycle in range(6):
        wire.cycle(PalmCommand(1, 5 + cycle, cycle % 2, 2, tuple(range(20))))
    transport = wire.transport
    found: dict[str, Any] = {
        "opened": opened if palm == "0220" else opened[:12] + opened[-12:],
        "telegrams": len(opened),
        "cycles": overheard.told[len(opened) :][:8],
        "hand": plain(transport.hand),
        "counts": plain(transport.counts),
        "health": list(transport.health()),
        "states": [int(state) for state in wire.states],
        "slaves": [plain(slave.counts) for slave in wire.hand.ring.slaves],
        "sent": digest(list(overheard.sent)),
    }
    overheard.told.clear()
    transport.close()
    found["closed"] = overheard.told
    found["states then"] = [int(state) for state in wire.states]
    assert_baseline(f"ring/{palm}", found)


def test_an_unplugged_slave_and_a_silent_one_are_told_of() -> None:
    wire = Wire().open()
    told: list[Any] = []
    ring = wire.hand.ring
    for connected in (1, 2, 0, 2):
        ring.faults.connected = connected
        for _ in range(4):
            try:
                answered = wire.cycle() is not None
            except Exception as error:  # the words are compared
                told.append([connected, str(error)])
                break
            told.append([connected, answered])
    told.append(plain(wire.transport.counts))
    assert_baseline("ring/unplugged", {"told": told})
