"""Fingertips that say through the palm who they are, and what a rig makes of that."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import pytest

from drivers.biotac.slot_codec import Slot, decode_slot
from drivers.fingertips.biotac import contradictions
from drivers.shadow.device.tactile_requests import TactileProtocol, TactileQuestion
from drivers.shadow.protocol.tactile_names import TactileNames
from tactile_lab.rigs.checks.tactile import TactileLook

ALL = 0b11111


def sample(question: int, *answers: bytes, valid: int = ALL, stride: int = 16) -> Any:
    """What the palm hands on, the same for the fingers that are not named."""
    slots = [*answers, *[answers[-1]] * (5 - len(answers))]
    tactile = b"".join(answer.ljust(stride, b"\0") for answer in slots)
    return SimpleNamespace(tactile_type=question, tactile_valid=valid, tactile=tactile, stamp_ns=0)


def told(*samples: Any) -> TactileNames:
    names = TactileNames()
    for each in samples:
        names.take(each)
    return names


def protocol(code: int) -> Any:
    return sample(TactileQuestion.PROTOCOL, code.to_bytes(2, "little"))


@pytest.mark.parametrize("stride", [16, 32])
def test_each_finger_says_who_it_is(stride: int) -> None:
    names = told(
        protocol(TactileProtocol.BIOTAC),
        sample(TactileQuestion.SERIAL, b"BTSP1", b"BT2\x00noise", stride=stride),
        sample(TactileQuestion.SOFTWARE, b"2.3", stride=stride),
        sample(TactileQuestion.FREQUENCY, b"\x64\x00", stride=stride),
    )
    assert names.words("FF") == "BioTac, serial BTSP1, software 2.3, 100 Hz"
    assert names.serial("MF") == "BT2"


def test_a_name_is_no_reading_of_the_sensor() -> None:
    assert decode_slot(b"BTSP-SIM-FF".ljust(16, b"\0"), TactileQuestion.SERIAL) == Slot((), {})


def test_what_is_not_valid_or_can_not_be_read_is_left_out() -> None:
    names = told(
        sample(TactileQuestion.SERIAL, b"BT1", valid=0b00010),
        sample(TactileQuestion.MANUFACTURER, bytes(range(0x80, 0x90))),
        protocol(0x1234),
    )
    assert (names.words("FF"), names.words("MF"), names.kind("FF")) == ("", "serial BT1", None)


@pytest.mark.parametrize(
    ("code", "serial", "electrodes", "wanted", "words"),
    [
        (TactileProtocol.BIOTAC, b"BTSP1", 24, "BTSP1", ""),
        (TactileProtocol.BIOTAC, b"", 24, "BTSP1", ""),
        (TactileProtocol.BIOTAC, b"BT7", 24, "", "has 19 electrodes by its serial number, but 24 by its calibration"),
        (TactileProtocol.BIOTAC, b"BTSP1", 24, "BTSP2", "its serial number is BTSP1, not BTSP2"),
        (TactileProtocol.PST3, b"", 19, "", "is not a BioTac: correct the fingertips in the rig file"),
    ],
)
def test_a_fingertip_that_is_not_the_rigs_is_told(
    code: int, serial: bytes, electrodes: Any, wanted: str, words: str
) -> None:
    names = told(protocol(code), sample(TactileQuestion.SERIAL, serial))
    problems = contradictions(names, "FF", electrodes, wanted)
    assert any(problem.startswith(words) for problem in problems) if words else problems == []


def test_fingertips_that_nobody_reads_are_told_with_what_to_do() -> None:
    look = TactileLook("none")
    look.take(protocol(TactileProtocol.BIOTAC))
    assert all(found.ok and "set hand.tactile to biotac" in found.detail for found in look.findings())
    look.take(protocol(TactileProtocol.PST3))
    assert look.findings()[0].detail == "PST; not read: there is no driver for it"
    look.take(protocol(TactileProtocol.NONE))
    assert look.findings() == []


def test_a_biotac_that_sends_nothing_is_not_ready() -> None:
    look = TactileLook("biotac")
    look.take(protocol(TactileProtocol.BIOTAC))
    assert [(found.ok, found.detail) for found in look.findings()] == [(False, "no reading received yet; BioTac")] * 5
