"""The plant's host without its process: it follows the clock, skips what it is too late for, and shows what is true."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from gtsam import Pose3

from drivers.core.clock import VirtualClock
from drivers.core.contacts import FINGERS
from drivers.emulators.laboratory.plant_host import PlantHost

MS = 1_000_000


class Plant:
    """Notes how far it is advanced, and with which demands."""

    stamp_ns = 0
    joints_rad, motor_torque_Nm, base = np.full(24, 0.1), np.full(20, 0.2), np.full(6, 0.3)
    wrenches, world_T_object = np.zeros((5, 6)), Pose3()

    def __init__(self) -> None:
        self.told: list[Any] = []

    def drive(self, duty: float) -> None:
        self.told.append(["drive", duty])

    def move_base(self, target: float) -> None:
        self.told.append(["base", target])

    def advance(self, steps: int) -> None:
        self.told.append(["advance", steps])
        self.stamp_ns += 2 * MS * steps

    def contacts(self) -> tuple[str, ...]:
        return ("touch",)

    def world_T_distal(self, finger: str) -> str:
        return f"{finger} distal"


class Mirror:
    def __init__(self) -> None:
        self.demands = (0.5, 0.7)
        self.told: list[Any] = []

    def publish(self, stamp_ns: int, *values: Any) -> None:
        self.told.append(["published", stamp_ns, [float(np.ravel(value)[0]) for value in values[:4]]])

    def publish_touches(self, contacts: tuple[str, ...], places: list[str]) -> None:
        self.told.append(["touches", contacts, places])

    def count_lost(self, lost_ns: int) -> None:
        self.told.append(["lost", lost_ns])


@pytest.mark.parametrize("touches", [True, False])
def test_it_steps_up_to_its_time_and_skips_what_is_more_than_twenty_milliseconds(touches: bool) -> None:
    plant, mirror, clock = Plant(), Mirror(), VirtualClock()
    host = PlantHost(plant, mirror, clock, touches=touches)  # type: ignore[arg-type]
    published = ["published", 0, [0.1, 0.2, 0.3, 0.0]]
    shown = [published, *([["touches", ("touch",), [f"{finger} distal" for finger in FINGERS]]] if touches else [])]
    assert mirror.told == shown
    mirror.told.clear()
    assert host._catch_up(7 * MS) == 0
    assert plant.told == [["drive", 0.5], ["base", 0.7], ["advance", 3]]
    assert mirror.told == [["lost", 0], *shown]
    assert host._catch_up(26 * MS) == 0  # 20 ms late: the most that is made up for
    assert host._catch_up(26 * MS + 50 * MS) == 30 * MS
    assert plant.told[-1] == ["advance", 10]
    assert mirror.told.count(["lost", 30 * MS]) == 1
    assert plant.stamp_ns == 46 * MS
