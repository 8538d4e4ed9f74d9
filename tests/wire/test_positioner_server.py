"""The example server of the docs, in a process of its own, takes a positioner's commands."""

from __future__ import annotations

import struct
import subprocess
import sys
from collections.abc import Iterator

import numpy as np
import pytest

from drivers.core.clock import MonotonicClock
from drivers.hardware.udp import UdpTransport
from drivers.positioner.positioner import Positioner
from drivers.positioner.settings import PositionerSettings
from tests.support.repository import REPOSITORY

SERVER = REPOSITORY / "docs" / "examples" / "positioner_server.py"
THERE = np.array([0.02, -0.01, 0.31, 0.05, 0.0, 0.0])


@pytest.fixture
def port() -> Iterator[int]:
    with subprocess.Popen([sys.executable, str(SERVER), "127.0.0.1", "0"], stdout=subprocess.PIPE) as server:
        assert server.stdout is not None
        yield int(server.stdout.readline().rsplit(b":", 1)[1])
        server.kill()


def test_the_example_server_moves_where_it_is_sent(port: int) -> None:
    clock = MonotonicClock()
    device = Positioner(UdpTransport("base", "127.0.0.1", port, clock), clock, PositionerSettings(lost_limit=2000))
    device.connect()
    try:
        for _ in range(6000):
            device.set_target(THERE)
            if np.abs(device.exchange().q - THERE).max() < 1e-6:
                break
            clock.sleep_until_ns(clock.now_ns() + 10_000_000)
        else:
            pytest.fail("it never arrived")
    finally:
        device.close()


def test_it_is_short_and_answers_nothing_to_rubbish() -> None:
    lines = SERVER.read_text().splitlines()
    assert len(lines) <= 100
    space: dict[str, object] = {"__name__": "server"}
    exec(compile("\n".join(lines), str(SERVER), "exec"), space)
    arm = space["Arm"]()  # type: ignore[operator]
    answer = space["answer"]
    assert answer(arm, b"rubbish") is None  # type: ignore[operator]
    question = struct.pack("<I6d", 0, *[9.0] * 6)
    assert answer(arm, question) == struct.pack("<I6d", 0, *arm.place)  # type: ignore[operator]
    assert arm.target == arm.place
