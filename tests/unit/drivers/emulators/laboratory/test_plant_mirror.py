"""The plant's shared memory: whole states, and readers that no writer holds up."""

from __future__ import annotations

import threading
from pathlib import Path

import numpy as np
import pytest
from gtsam import Pose3

from drivers.core.clock import VirtualClock
from drivers.core.contacts import FINGERS, Array
from drivers.emulators.laboratory.plant_mirror import PlantMirror
from drivers.simulation.hand_plant import TrueContact


class Broken:
    """A pose at which the plant's process ends, in the middle of writing."""

    def matrix(self) -> Array:
        raise InterruptedError


class Counted:
    """A memory that counts how often it is looked at."""

    def __init__(self, memory: np.ndarray) -> None:
        self.memory, self.looks = memory, 0

    def __getitem__(self, key: str) -> np.ndarray:
        self.looks += 1
        return self.memory[key]


@pytest.fixture
def mirror(tmp_path: Path) -> PlantMirror:
    return PlantMirror.create(tmp_path / "plant", VirtualClock(), np.zeros(6))


def publish(mirror: PlantMirror, value: float, world_T_object: object = None) -> None:
    pose = Pose3() if world_T_object is None else world_T_object
    mirror.publish(
        0,
        np.full(24, value),
        np.full(20, value),
        np.full(6, value),
        np.full((5, 6), value),
        pose,  # type: ignore[arg-type]
    )


def contact(finger: str, value: float) -> TrueContact:
    return TrueContact(finger, "object", np.full(3, value), np.full(3, value), np.full(3, value), value)


def test_what_was_written_is_read(mirror: PlantMirror) -> None:
    for value in range(20):
        publish(mirror, value)
        mirror.publish_touches([contact("FF", value)], [Pose3()] * len(FINGERS))
        assert mirror.joints_rad[0] == mirror.wrenches[4, 5] == value
        assert mirror.contacts()[0].point_world_m[2] == mirror.contacts()[0].slides_m_s == value


def test_a_plant_that_stops_while_it_writes_holds_up_no_reader(mirror: PlantMirror) -> None:
    publish(mirror, 1.0)
    with pytest.raises(InterruptedError):
        publish(mirror, 2.0, Broken())
    mirror._memory = counted = Counted(mirror._memory)  # type: ignore[assignment]
    assert mirror.base[0] == 1.0
    assert counted.looks < 10


def test_states_are_read_whole_while_others_are_written(mirror: PlantMirror) -> None:
    publish(mirror, 0.0)
    ended = threading.Event()

    def write() -> None:
        for value in range(3000):
            publish(mirror, value)
        ended.set()

    writer = threading.Thread(target=write)
    writer.start()
    while not ended.is_set():
        state = mirror._state()
        assert len({*state["joints_rad"], *state["motor_torque_Nm"], *state["wrenches"].ravel()}) == 1
    writer.join()
