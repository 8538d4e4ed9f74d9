"""The hand's own process without a process: a fake hand, orders from a list, records in a list, a virtual clock."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import pytest

from drivers.core.clock import VirtualClock
from drivers.core.errors import DeviceError
from drivers.core.orders import Order
from drivers.core.records import RecordKind
from drivers.shadow.device import hand_worker
from drivers.shadow.device.hand_worker import HandWorker
from tests.support.baseline import assert_baseline

MS = 1_000_000


@dataclass
class Counts:
    """Stands for what is counted on the wire, and in the hand."""

    lost: int = 3
    late: int = 0


@dataclass
class Hand:
    """Notes what is asked of it; fails when it is told to."""

    told: list[Any]
    counters: Counts = field(default_factory=Counts)
    targets_rad: dict[str, float] = field(default_factory=dict)
    fault: str = ""
    cycles: int = 0

    def exchange(self) -> str:
        self.cycles += 1
        if self.fault:
            raise DeviceError(self.fault, where="hand", hint="Look at it")
        return "sample"

    def set_targets(self, targets: Mapping[str, float]) -> None:
        self.told.append(["targets", dict(targets)])
        self.targets_rad = dict(targets)

    def stop(self) -> None:
        self.told.append(["stop"])

    def resume(self) -> None:
        self.told.append(["resume"])
        self.fault = ""

    def health(self) -> tuple[str, ...]:
        return ("warm",)


class Transport:
    name, counts = "hand wire", Counts(lost=1)

    def health(self) -> tuple[str, ...]:
        return ("lossy",)


class Bench:
    """A worker with its orders by the number of the cycle."""

    def __init__(self, orders: Mapping[int, list[Order]], faults: Mapping[int, str] | None = None) -> None:
        self.told: list[Any] = []
        self.clock, self.hand = VirtualClock(), Hand(self.told)
        self.dropped_blocks = 4
        self._orders, self._faults = dict(orders), dict(faults or {})
        pipe, given = self, self
        cycle_ns, patience_ns = 2 * MS, 100 * MS
        self.worker = HandWorker(
            self.hand,
            Transport(),
            None,
            pipe,
            given,
            self.clock,
            cycle_ns,
            patience_ns,  # type: ignore[arg-type]
        )

    def waiting(self, patience_s: float = 0.0) -> list[Order]:
        self.hand.fault = self._faults.get(self.hand.cycles, self.hand.fault)
        return self._orders.pop(self.hand.cycles, [])

    def put(self, kind: RecordKind, stamp_ns: int, payload: bytes) -> None:
        words = payload.decode()
        content = json.loads(words) if kind is not RecordKind.ERROR else words
        if kind is RecordKind.REPORT:
            del content["processor_s"]
        self.told.append([kind.name, self.hand.cycles, stamp_ns // MS, content])

    def flush(self) -> None:
        self.told.append(["flush", self.clock.now_ns() // MS])

    def run(self) -> list[Any]:
        self.worker.run()
        return [*self.told, ["cycles", self.hand.cycles, self.clock.now_ns() // MS]]


def test_orders_are_obeyed_and_records_handed_over_every_ten_milliseconds() -> None:
    bench = Bench(
        {
            3: [{"targets": {"FFJ3": 0.4}}, {"report": True}],
            12: [{"stop": True}],
            14: [{"resume": True, "targets": {"FFJ3": 0.1}}],
            20: [{"end": False}],
            21: [{"end": True, "report": True}],
        }
    )
    assert_baseline("hand_worker/orders", {"told": bench.run()})


def test_a_fault_is_told_once_until_the_hand_is_resumed() -> None:
    faults = {4: "motor 3 halted", 9: "motor 5 halted", 30: "motor 7 halted"}
    bench = Bench({25: [{"resume": True}], 40: [{"end": True}]}, faults)
    told = bench.run()
    assert [entry[3] for entry in told if entry[0] == "ERROR"] == [
        "hand: motor 3 halted. Look at it",
        "hand: motor 7 halted. Look at it",
    ]
    assert bench.hand.cycles == 40


@pytest.mark.parametrize(("targets", "stopped"), [({"FFJ3": 0.4}, True), ({}, False)])
def test_a_session_that_has_moved_something_and_says_nothing_for_long_loses_its_demands(
    targets: dict[str, float], stopped: bool
) -> None:
    bench = Bench({10: [{"targets": targets}], 63: [{"end": True}]})
    told = bench.run()
    lost = [entry for entry in told if entry[0] == "ERROR"]
    # heard at 20 ms, silent for more than 100 ms at the cycle of 122 ms
    assert [entry[2:] for entry in lost] == (
        [[122, "no command from the session for 0.1 s: demands set to zero"]] if stopped else []
    )
    assert (["stop"] in told) == stopped


def test_the_check_of_the_motors_moves_the_hand_without_being_taken_for_a_silent_session(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    @dataclass
    class Finding:
        joint: str
        moved_rad: float

    def check(hand: Hand, motors: object, turn: Any, clock: VirtualClock, joints: list[str] | None) -> list[Finding]:
        for _ in range(80):
            assert turn() == "sample"
        return [Finding(joint, 0.1) for joint in joints or ()]

    monkeypatch.setattr(hand_worker, "check_motor_map", check)
    bench = Bench({2: [{"targets": {"FFJ3": 0.4}}, {"first_move": ["FFJ3"]}], 100: [{"end": True}]})
    told = bench.run()
    assert [entry for entry in told if entry[0] in ("MOVES", "ERROR")] == [
        ["MOVES", 82, 164, {"moved": [{"joint": "FFJ3", "moved_rad": 0.1}]}]
    ]
    ended = Bench({2: [{"first_move": None}], 9: [{"end": True}]}).run()
    assert [entry[3] for entry in ended if entry[0] == "MOVES"] == [
        {"error": "hand wire: the check of its motors was interrupted"}
    ]
    failed = Bench({2: [{"first_move": None}], 20: [{"end": True}]}, {5: "motor 3 halted"}).run()
    assert [entry[3] for entry in failed if entry[0] in ("ERROR", "MOVES")] == [
        "hand: motor 3 halted. Look at it",
        {"error": "hand: motor 3 halted. Look at it"},
    ]
