"""Rare losses are told, and no reason to call a device unfit; anything else is."""

from __future__ import annotations

from dataclasses import asdict
from types import SimpleNamespace
from typing import Any

import pytest

from drivers.core.transports import ReplayTransport
from drivers.shadow.ethercat.hand_transport import EthercatCounts
from sessions.rig_runtime.sensor_stream import SensorStream
from tactile_lab.rigs.checks.check import check_rig
from tactile_lab.rigs.checks.findings import LOSSY, TOLERATED_LOSS, told_losses

COUNTS = EthercatCounts(cycles=1000, lost=2, empty=3)
HEALTH = ("5 of 1000 cycles lost", *COUNTS.problems(), "FFJ3 (motor 1): silent")


@pytest.mark.parametrize("share", [0.005, 0.05])
def test_rare_losses_are_told_apart_from_what_is_wrong(share: float) -> None:
    wrong, told = told_losses(HEALTH, share, EthercatCounts(**asdict(COUNTS)).problems())
    assert (len(wrong), len(told)) == ((1, 3) if share < TOLERATED_LOSS else (5, 0))
    assert "FFJ3 (motor 1): silent" in wrong
    assert (LOSSY in wrong) is (share >= TOLERATED_LOSS)


def test_the_check_tells_the_warmest_motor_and_the_motors_firmware() -> None:
    hand = next(finding for finding in check_rig("sim") if finding.device == "hand")
    assert hand.ok
    assert float(hand.figures["warmest_C"]) > 15.0
    assert "warmest motor" in hand.detail
    assert "firmware revision 1200" in hand.detail


def test_a_stream_passes_on_who_its_device_is() -> None:
    named: Any = SimpleNamespace(connect=None, close=None, identity="FT12345, firmware 2.1")
    assert SensorStream(named, ReplayTransport("ft/FF", ())).identity == "FT12345, firmware 2.1"
    unnamed: Any = SimpleNamespace(connect=None, close=None)
    assert SensorStream(unnamed, ReplayTransport("ft/FF", ())).identity == ""
