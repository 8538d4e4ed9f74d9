"""A whole laboratory of emulators: cable, plant, hand, boxes, positioner, camera; started and ended together."""

from __future__ import annotations

import tempfile
from collections.abc import Mapping
from contextlib import ExitStack
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Self

from gtsam import Pose3

from drivers.ati.wiring import NetBoxWiring
from drivers.emulators.wired.plant_mirror import PlantMirror
from drivers.emulators.wired.station_process import StationProcess
from drivers.emulators.wired.virtual_cable import virtual_cable
from drivers.shadow.palm_images import PalmName
from drivers.simulation.plant import START_BASE
from drivers.simulation.settings import SimulationSettings
from tactile_lab.clock import Clock
from tactile_lab.errors import DeviceError

_GONE_ns = 2_000_000_000
"""Without a step of the physics for so long there is none."""

SERIAL = 634
"""Of the emulated hand."""

Place = tuple[str, int]


@dataclass(frozen=True)
class HandPlace:
    """Where the emulated hand is, and what it is.

    Attributes:
        near, far: the cable's ends; the hand is at the far one.
        joints, motors: its calibration files, read backwards.
        palm, serial: its identity.
        biotacs: calibration of its fingertips, where these send through the palm.
    """

    near: str
    far: str
    joints: Path
    motors: Path
    palm: PalmName = "0220"
    serial: int = SERIAL
    biotacs: Path | None = None


@dataclass(frozen=True)
class StandInPlan:
    """A laboratory to emulate.

    Attributes:
        simulation: the plant, and how imperfect the devices are.
        seed: of everything random.
        hand: the hand.
        boxes: Net F/T boxes, by finger.
        base: address and UDP port of the positioner.
        camera: address and TCP port of the camera, if there is one.
    """

    simulation: SimulationSettings
    seed: int
    hand: HandPlace
    base: Place
    boxes: Mapping[str, NetBoxWiring] = field(default_factory=dict)
    camera: Place | None = None


@dataclass(frozen=True)
class StandInTruth:
    """What really is; the plant's process does not tell its contacts."""

    world_T_object: Pose3
    contacts: None = None


class StandIns:
    """The running laboratory, a context.

    Args:
        plan: what to emulate.
        clock: the session's; real time.

    Attributes:
        stations: the emulators by device: ``plant``, ``hand``, ``base``, ``camera``, ``ft/FF`` to ``ft/TH``.
    """

    def __init__(self, plan: StandInPlan, clock: Clock) -> None:
        self._plan, self._clock = plan, clock
        self._open = ExitStack()
        self._mirror: PlantMirror | None = None
        self.stations: dict[str, StationProcess] = {}

    def __enter__(self) -> Self:
        """Start everything and wait until it serves. All or nothing.

        Raises:
            DeviceError: something can not be served; says what and why.
        """
        try:
            self._start()
        except BaseException:
            self._open.close()
            raise
        return self

    def __exit__(self, *ended: object) -> None:
        self._open.close()

    def truth(self) -> StandInTruth:
        """The object's true pose.

        Raises:
            DeviceError: the physics does not run any more; every emulator goes on, in a world that stands still.
        """
        if self._memory.age_ns > _GONE_ns:
            hint = "Its process has ended, or this computer is far too slow; run again"
            raise DeviceError("the emulated laboratory stands still", where="plant", hint=hint)
        return StandInTruth(self._memory.world_T_object)

    @property
    def lost_s(self) -> float:
        """Time by which the plant stayed behind the clock: a machine too slow for real time."""
        return self._memory.lost_ns / 1e9

    @property
    def _memory(self) -> PlantMirror:
        if self._mirror is None:
            raise DeviceError("is not running", where="stand-ins", hint="Start them first")
        return self._mirror

    def _start(self) -> None:
        plan = self._plan
        self._open.enter_context(virtual_cable(plan.hand.near, plan.hand.far))
        memory = Path(self._open.enter_context(tempfile.TemporaryDirectory(prefix="tactile-lab-"))) / "plant"
        self._mirror = PlantMirror.create(memory, self._clock, START_BASE)
        world = {"simulation": plan.simulation.model_dump(mode="json"), "seed": plan.seed}
        self._add("plant", "plant", memory, **world)
        self._add("base", "base", memory, host=plan.base[0], port=plan.base[1])
        if plan.camera is not None:
            self._add("camera", "camera", memory, host=plan.camera[0], port=plan.camera[1], **world)
        for finger, wiring in plan.boxes.items():
            self._add(f"ft/{finger}", "box", memory, **_box(plan, finger, wiring))
        self._add("hand", "hand", memory, **_hand(plan))
        for station in self.stations.values():
            station.await_ready()

    def _add(self, device: str, role: str, memory: Path, **start: Any) -> None:
        station = StationProcess(device, role, mirror=str(memory), **start)
        self._open.callback(station.close)
        station.start()
        self.stations[device] = station


def _hand(plan: StandInPlan) -> dict[str, Any]:
    hand = plan.hand
    return {
        "far_end": hand.far,
        "joints": str(hand.joints),
        "motors": str(hand.motors),
        "palm": hand.palm,
        "serial": hand.serial,
        "seed": plan.seed,
        "joint_sensors": plan.simulation.joint_sensors.model_dump(mode="json"),
        "biotacs": None if hand.biotacs is None else str(hand.biotacs),
        "biotac": plan.simulation.biotac.model_dump(mode="json"),
    }


def _box(plan: StandInPlan, finger: str, wiring: NetBoxWiring) -> dict[str, Any]:
    return {
        "finger": finger,
        "serial": wiring.serial or f"FT-{finger}",
        "host": wiring.host,
        "port": wiring.port,
        "http_port": wiring.http_port,
        "rate_hz": wiring.rate_hz,
        "seed": plan.seed,
        "force_sensors": plan.simulation.force_sensors.model_dump(mode="json"),
    }
