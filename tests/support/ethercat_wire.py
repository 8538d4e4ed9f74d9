"""Helpers of the EtherCAT tests: a cable between two virtual network interfaces, and a hand at its far end."""

from __future__ import annotations

import os
import shutil
import subprocess
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest

from drivers.shadow.device.hand import ShadowHand
from tactile_lab import rigs

JOINTS = Path(rigs.__file__).parent / "calibrations" / "simulated-hand" / "joints.yaml"


@contextmanager
def cable(tag: str = "") -> Iterator[tuple[str, str]]:
    """Names of the two ends; the test is skipped, with the reason, if no cable can be created."""
    if shutil.which("ip") is None:
        pytest.skip("no ip command to make virtual interfaces with")
    ends = f"tlm{tag}{os.getpid()}", f"tls{tag}{os.getpid()}"
    made = _ip("link", "add", ends[0], "type", "veth", "peer", "name", ends[1])
    if made.returncode:
        pytest.skip(f"no right to make virtual interfaces: {made.stderr.strip()}")
    try:
        for end in ends:
            assert _ip("link", "set", end, "up").returncode == 0
        yield ends
    finally:
        _ip("link", "del", ends[0])


def _ip(*words: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run(["ip", *words], capture_output=True, text=True, check=False)


def check_it_moves(hand: ShadowHand) -> None:
    """Connect a hand, let it turn a joint, and close it."""
    hand.connect()
    before = hand.exchange().joints_rad[2]
    hand.set_targets({"FFJ3": before + 0.3})
    for _ in range(300):
        time.sleep(0.002)
        sample = hand.exchange()
    assert sample.joints_rad[2] == pytest.approx(before + 0.3, abs=0.05)
    hand.close()
