"""A hand on a fake palm, cycle by cycle: what is demanded of its motors, what it says of itself, why it stops."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import pytest

from drivers.core.errors import TactileLabError
from drivers.shadow.device.cycle_pace import CyclePace
from drivers.shadow.device.cycle_statistics import CycleStatistics
from drivers.shadow.device.hand_settings import HandSettings
from drivers.shadow.device.joint_watch import SensorLimits
from drivers.shadow.device.motor_load import LoadLimits
from drivers.shadow.model.gains import GainTable, JointGains
from drivers.shadow.protocol.motor_data import MotorFlag
from tests.support.baseline import assert_baseline
from tests.support.fake_palm import Rig
from tests.support.plain_values import plain

GAINS = GainTable(
    flexion=JointGains(
        pwm_per_rad=3000.0, deadband_rad=0.01, max_pwm=250.0, damping=20.0, integral=900.0, integral_max=60.0
    )
)
SETTINGS: dict[str, Any] = {"gains": GAINS, "soft_start_s": 0.1, "connect_tries": 4, "link_patience_s": 0.3}


class Bench:
    """A hand and notes of every few cycles."""

    def __init__(self, **changes: Any) -> None:
        self.rig = Rig(HandSettings(**{**SETTINGS, **changes}))
        self.palm, self.hand = self.rig.palm, self.rig.hand
        self.told: list[Any] = []

    def do(self, what: str, act: Callable[[], object]) -> None:
        """Do something, and note how it ended."""
        try:
            act()
            ended = ""
        except TactileLabError as error:
            ended = str(error)
        self.note(what, ended)

    def note(self, what: str, ended: str = "") -> None:
        hand = self.hand
        said = [plain(vars(hand.counters)), dict(hand.losses()), dict(hand.targets_rad), list(hand.health())]
        self.told.append([what, ended, self.rig.clock.now_ns() // 1_000_000, self.palm.pwm, *said])

    def run(self, what: str, cycles: int) -> None:
        self.do(what, lambda: self.rig.run(cycles))


def test_targets_are_followed_within_their_gains_and_limits() -> None:
    bench = Bench()
    hand = bench.hand
    bench.do("connect", hand.connect)
    asked = [vars(command) for command in bench.palm.commands[:6]]
    bench.run("idle", 3)
    bench.do("targets", lambda: hand.set_targets({"FFJ3": 0.9, "FFJ0": 0.2, "THJ4": 0.5, "WRJ1": -0.1}))
    for _ in range(8):
        bench.run("follow", 3)
    bench.do("beyond", lambda: hand.set_targets({"MFJ3": 9.0, "THJ5": -9.0}))
    bench.run("beyond", 6)
    bench.do("unknown", lambda: hand.set_targets({"XXJ3": 0.1}))
    bench.do("not a number", lambda: hand.set_targets({"MFJ3": float("nan")}))
    bench.do("stop", hand.stop)
    bench.run("stopped", 2)
    bench.do("resume", hand.resume)
    bench.run("resumed", 4)
    bench.do("demands", lambda: hand.set_demands({"RFJ3": 120.0, "RFJ4": -5000.0}))
    bench.run("demands", 4)
    bench.do("nudge", lambda: hand.nudge("LFJ5", 90.0))
    bench.run("nudged", 4)
    bench.do("close", hand.close)
    found = {f"{number} {what}": rest for number, (what, *rest) in enumerate(bench.told)}
    drivable = [list(hand.drivable), len(bench.palm.commands)]
    assert_baseline("hand/targets", {"connecting": asked, "drivable": drivable, **found}, rtol=1e-6, atol=1.01)


def _damaged(bench: Bench) -> None:
    bench.palm.garbage = b"12345"


FAULTS: dict[str, Callable[[Bench], object]] = {
    "mute": lambda bench: setattr(bench.palm, "mute", True),
    "unwritten": lambda bench: setattr(bench.palm, "unwritten", True),
    "repeated": lambda bench: setattr(bench.palm, "frozen", True),
    "damaged": _damaged,
    "silent motor": lambda bench: bench.palm.silent.add(3),
    "halted": lambda bench: bench.palm.flags.__setitem__(5, int(MotorFlag.BRIDGE_FAULT)),
    "gauge": lambda bench: bench.palm.flags.__setitem__(6, int(MotorFlag.GAUGE_LEFT_FAULT)),
    "no demand": lambda bench: bench.palm.flags.__setitem__(7, int(MotorFlag.NO_DEMAND)),
    "warm": lambda bench: bench.palm.temperature_C.__setitem__(1, 52),
    "hot": lambda bench: bench.palm.temperature_C.__setitem__(8, 90),
    "late": lambda bench: setattr(bench.palm, "delay_ns", 25_000_000),
    "jump": lambda bench: bench.palm.joints_rad.__setitem__(2, bench.palm.joints_rad[2] + 0.8),
}


@pytest.mark.parametrize("fault", FAULTS)
def test_how_a_moving_hand_meets_each_fault(fault: str) -> None:
    bench = Bench(sensors=SensorLimits(frozen_s=0.2), load=LoadLimits(stall_s=0.5))
    bench.hand.connect()
    bench.do("targets", lambda: bench.hand.set_targets({"FFJ3": 1.2, "MFJ3": 0.3}))
    bench.run("sound", 6)
    FAULTS[fault](bench)
    for cycles in (1, 2, 5, 10, 20, 90):
        bench.run("faulty", cycles)
    bench.palm.mute = bench.palm.unwritten = bench.palm.frozen = False
    bench.palm.garbage, bench.palm.delay_ns = b"", 0
    bench.palm.silent.clear()
    bench.palm.flags[:], bench.palm.temperature_C[:] = 0, 30
    bench.run("mended", 6)
    bench.do("resume", bench.hand.resume)
    bench.run("resumed", 6)
    found = {f"{number} {what}": rest for number, (what, *rest) in enumerate(bench.told)}
    assert_baseline(f"hand/{fault.replace(' ', '_')}", found, rtol=1e-6, atol=1.01)


def test_a_palm_that_does_not_answer_is_not_connected() -> None:
    bench = Bench()
    bench.palm.mute = True
    bench.do("mute", bench.hand.connect)
    bench.palm.mute, bench.palm.unwritten = False, True
    bench.do("unwritten", bench.hand.connect)
    bench.palm.unwritten, bench.palm.garbage = False, bytes(7)
    bench.do("other", bench.hand.connect)
    assert_baseline("hand/connecting", {str(n): told for n, told in enumerate(bench.told)})


def test_paces_and_statistics_of_cycles() -> None:
    rig = Rig()
    pace, statistics, told = CyclePace(rig.clock, 2_000_000), CycleStatistics(), []
    for late_ns in (0, 300_000, 1_999_999, 2_000_000, 9_000_001, 0, 0):
        rig.clock.sleep_until_ns(rig.clock.now_ns() + 2_000_000 + late_ns)
        waited = pace.wait()
        statistics.add(*waited)
        told.append([*waited, rig.clock.now_ns()])
    summary = statistics.summary()
    empty = CycleStatistics().summary()
    assert_baseline("hand/pace", {"told": told, "summary": summary, "empty": empty})
