"""Each cause that stops the rig, on the simulated one: zero demands within the stated cycles, and a report of it."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator
from dataclasses import dataclass

import numpy as np
import pytest

from drivers.core.errors import DeviceError, TactileLabError
from drivers.shadow.protocol.palm_images import PALMS
from drivers.simulation.world import SimulatedWorld
from sessions.motion.motion import Motion
from sessions.motion.safety import SafetySettings, SafetySupervisor
from sessions.recording.recorder import Recorder
from sessions.recording.traffic import schemas
from sessions.rig_runtime.rig_runtime import RigRuntime
from tactile_lab.rigs.build import build_runtime, simulated_world
from tactile_lab.rigs.description import load_rig

SENT, CYCLE_ns = schemas.transmitted_topic("hand"), 10_000_000


class Sink:
    """Keeps what goes to the hand, and reports of stops."""

    def __init__(self) -> None:
        self.demands: list[tuple[int, bool]] = []
        self.reports: list[dict[str, object]] = []

    def write(self, topic: str, data: bytes, stamp_ns: int) -> None:
        if topic == SENT:
            self.demands.append((stamp_ns, bool(np.any(PALMS["0220"].decode_command(data).motor_data))))
        if topic == schemas.SAFETY_TOPIC:
            self.reports.append(json.loads(data))


@dataclass
class Running:
    """A rig whose hand is moving."""

    world: SimulatedWorld
    runtime: RigRuntime
    motion: Motion
    supervisor: SafetySupervisor
    sink: Sink

    def until_stopped(self, each: Callable[[int], None] = lambda cycle: None, cycles: int = 400) -> TactileLabError:
        """Cycles as a session does, fingers to and fro, until something stops it; ends as the conductor does."""
        for cycle in range(cycles):
            try:
                each(cycle)
                self.runtime.hand.set_targets({"FFJ3": 0.2 + 0.1 * (cycle % 2)})
                self.motion.tick()
            except TactileLabError as error:
                self.supervisor.stop(error)
                return error
        raise AssertionError("nothing stopped it")

    def cycles_with_demands_after(self, stamp_ns: int) -> int:
        """Cycles with demands from then on; the hand was moving before."""
        assert any(driven for sent_ns, driven in self.sink.demands if sent_ns <= stamp_ns)
        return sum(driven for sent_ns, driven in self.sink.demands if sent_ns > stamp_ns)


@pytest.fixture
def rig() -> Iterator[Running]:
    loaded = load_rig("sim")
    sink, world = Sink(), simulated_world(loaded, 0, "cube-6")
    runtime = build_runtime(loaded, world, Recorder(sink))
    runtime.connect()
    supervisor = SafetySupervisor(runtime, SafetySettings(), runtime.cycle_ns)
    running = Running(world, runtime, Motion(runtime, supervisor), supervisor, sink)
    for cycle in range(60):  # beyond the soft start, with readings from all
        runtime.hand.set_targets({"FFJ3": 0.2 + 0.1 * (cycle % 2)})
        running.motion.tick()
    yield running
    runtime.close()


@pytest.mark.parametrize(
    ("device", "words", "cycles"),
    [
        ("ft/MF", "MF: no reading from the fingertip", 22),
        ("hand", "hand: no new status|stopped: no valid status for 2 s", 2),
        ("base", "cycles in a row without a status", 12),
    ],
)
def test_lost_devices(rig: Running, device: str, words: str, cycles: int) -> None:
    rig.world.unplug(device)
    lost_ns = rig.world.clock.now_ns()
    error = rig.until_stopped()
    assert any(word in str(error) for word in words.split("|"))
    assert rig.cycles_with_demands_after(lost_ns) <= cycles
    ((report,)) = rig.sink.reports
    assert report["cause"] == str(error)
    assert len(report["cycles"]) > 20  # type: ignore[arg-type]


def test_too_much_force(rig: Running, monkeypatch: pytest.MonkeyPatch) -> None:
    tip = rig.runtime.fingertips["RF"]
    since_ns = rig.world.clock.now_ns()
    monkeypatch.setattr(type(tip), "load_N", lambda self, rotation: 7.0 if self is tip else 0.0)
    error = rig.until_stopped()
    assert "RF: fingertip force 7.0 N is over the limit of 6.0 N" in str(error)
    assert rig.cycles_with_demands_after(since_ns) <= SafetySettings().force_cycles


def test_a_hot_motor(rig: Running) -> None:
    motors = rig.world._devices[0]
    motors._celsius[5] = 57.0  # type: ignore[attr-defined]
    heard = rig.runtime.observer.interpreter.newest
    told_ns = []

    def look(cycle: int) -> None:
        if not told_ns and np.nanmax(heard["hand"].sample.motor.temperature_C) >= 55.0:
            told_ns.append(heard["hand"].stamp_ns)

    error = rig.until_stopped(look)
    assert "motor 5): stopped: 57 C, limit 55 C" in str(error)
    assert rig.cycles_with_demands_after(told_ns[0] if told_ns else rig.world.clock.now_ns()) <= 1


def test_the_operator(rig: Running) -> None:
    rig.motion.tick()
    rig.supervisor.stop(KeyboardInterrupt())
    assert rig.cycles_with_demands_after(rig.runtime.snapshot().stamp_ns - 5 * CYCLE_ns) == 0
    assert rig.sink.reports[0]["cause"] == "stopped immediately by the operator"


def test_a_silent_camera_is_an_error_that_stops(rig: Running) -> None:
    rig.world.unplug("camera")
    with pytest.raises(DeviceError, match="camera: no picture within 1000 ms") as caught:
        rig.runtime.truth_frame()
    rig.supervisor.stop(caught.value)
    assert "no picture" in str(rig.sink.reports[0]["cause"])
    assert not rig.sink.demands[-1][1]
