"""The physics in real time: driven by what emulators demand, at the clock's pace, what it is late for made up."""

from __future__ import annotations

import os
import sys
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from gtsam import Pose3

from drivers.core.clock import VirtualClock
from drivers.emulators.laboratory.plant_host import PlantHost
from drivers.emulators.laboratory.plant_mirror import PlantMirror
from drivers.simulation.plant import STEP_ns

BASE = np.array([0.1, 0.2, 0.3, 0.0, 0.0, 0.0])


class CountedPlant:
    """Counts its steps instead of taking them, and stands where it was told to."""

    def __init__(self) -> None:
        self.steps, self.duty, self.base = 0, np.zeros(20), np.zeros(6)
        self.motor_torque_Nm, self.wrenches, self.world_T_object = np.zeros(20), np.zeros((5, 6)), Pose3()

    @property
    def stamp_ns(self) -> int:
        return self.steps * STEP_ns

    @property
    def joints_rad(self) -> np.ndarray:
        return np.full(24, float(self.steps))

    def drive(self, duty: np.ndarray) -> None:
        self.duty = duty

    def move_base(self, target: np.ndarray) -> None:
        self.base = target

    def advance(self, steps: int) -> None:
        self.steps += steps


class Ending(VirtualClock):
    """A clock that ends the program's input after some sleeps, and is once late."""

    def __init__(self, sleeps: int, input_end: int, late_ns: int = 0) -> None:
        super().__init__(start_ns=5_000_000_000)
        self._left, self._input_end, self._late_ns = sleeps, input_end, late_ns

    def sleep_until_ns(self, deadline_ns: int) -> None:
        super().sleep_until_ns(deadline_ns + self._late_ns)
        self._late_ns = 0
        self._left -= 1
        if self._left == 0:
            os.close(self._input_end)


@pytest.fixture(autouse=True)
def own_scheduling() -> Iterator[None]:
    """The plant asks for the real-time scheduler, which is the thread's own beyond the test."""
    policy, parameters = os.sched_getscheduler(0), os.sched_getparam(0)
    yield
    os.sched_setscheduler(0, policy, parameters)


@pytest.fixture
def input_end(monkeypatch: pytest.MonkeyPatch) -> Iterator[int]:
    """The far end of this program's standard input."""
    reading, writing = os.pipe()
    with os.fdopen(reading) as stream:
        monkeypatch.setattr(sys, "stdin", stream)
        yield writing


def serve(clock: VirtualClock, folder: Path) -> tuple[CountedPlant, PlantMirror]:
    plant, mirror = CountedPlant(), PlantMirror.create(folder / "plant", clock, BASE)
    mirror.drive(np.linspace(-1.0, 1.0, 20))
    PlantHost(plant, mirror, clock).serve()
    return plant, mirror


def test_the_plant_does_what_is_demanded_a_step_at_a_time_and_shows_where_it_is(tmp_path: Path, input_end: int) -> None:
    plant, mirror = serve(Ending(100, input_end), tmp_path)
    assert plant.steps == 99  # the first turn comes at once, before a step is due
    np.testing.assert_allclose(plant.duty, np.linspace(-1.0, 1.0, 20))
    np.testing.assert_allclose(mirror.base, BASE)
    np.testing.assert_allclose(mirror.joints_rad, 99.0)
    assert mirror.lost_ns == 0


@pytest.mark.parametrize(("late_ns", "lost_ns"), [(16_000_000, 0), (250_000_000, 230_000_000 + STEP_ns)])
def test_a_delay_is_made_up_for_up_to_a_fiftieth_of_a_second(
    tmp_path: Path, input_end: int, late_ns: int, lost_ns: int
) -> None:
    plant, mirror = serve(Ending(50, input_end, late_ns), tmp_path)
    assert mirror.lost_ns == lost_ns
    assert plant.stamp_ns + lost_ns == late_ns + 49 * STEP_ns
