"""A whole laboratory of emulators, started and ended together: cable, plant, hand, boxes, positioner and camera."""

from __future__ import annotations

import tempfile
from collections.abc import Mapping
from contextlib import ExitStack
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Self

from gtsam import Pose3

from drivers.core.clock import Clock
from drivers.core.errors import DeviceError
from drivers.emulators.laboratory.host_process import HostProcess
from drivers.emulators.laboratory.plant_mirror import PlantMirror
from drivers.emulators.laboratory.virtual_cable import virtual_cable
from drivers.fingertips.kinds import WIRES
from drivers.force.wire_settings import WireSettings
from drivers.positioner.kinds import POSITIONERS
from drivers.shadow.protocol.palm_images import PalmName
from drivers.simulation.plant import START_BASE
from drivers.simulation.settings import SimulationSettings

_GONE_ns = 2_000_000_000
"""If the physics has not stepped for this long, its process counts as dead."""

SERIAL = 634
"""Settings of the emulated hand."""

Place = tuple[str, int]


@dataclass(frozen=True)
class HandPlace:
    """The emulated hand: its interfaces and its identity.

    Attributes:
        near, far: the ends of the cable; the hand is at the far end.
        joints, motors: its calibration files, used in reverse.
        palm, serial: its identity.
    """

    near: str
    far: str
    joints: Path
    motors: Path
    palm: PalmName = "0220"
    serial: int = SERIAL


@dataclass(frozen=True)
class EmulationPlan:
    """A laboratory to emulate.

    Attributes:
        simulation: the plant, and the errors of the devices.
        seed: for all random numbers.
        hand: the hand.
        base: settings of the positioner's emulator: ``wiring``, ``settings`` and ``world_T_mount`` of the rig.
        tips: calibration file of the fingertips.
        wires: wires of fingertips with their own transports, by finger; each kind must have an emulator.
        camera: address and TCP port of the camera, if there is one.
    """

    simulation: SimulationSettings
    seed: int
    hand: HandPlace
    base: Mapping[str, Any]
    tips: Path
    wires: Mapping[str, WireSettings] = field(default_factory=dict)
    camera: Place | None = None


@dataclass(frozen=True)
class EmulatedTruth:
    """The true state; contacts are not available from the plant's process."""

    world_T_object: Pose3
    contacts: None = None


class EmulatedLaboratory:
    """The running laboratory, as a context manager.

    Args:
        plan: what to emulate.
        clock: the session's clock, in real time.

    Attributes:
        stations: the emulators by device: ``plant``, ``hand``, ``base``, ``camera``, ``ft/FF`` to ``ft/TH``.
    """

    def __init__(self, plan: EmulationPlan, clock: Clock) -> None:
        self._plan, self._clock = plan, clock
        self._open = ExitStack()
        self._mirror: PlantMirror | None = None
        self.hosts: dict[str, HostProcess] = {}

    def __enter__(self) -> Self:
        """Start all emulators and wait until they serve. After a failure none is left running.

        Raises:
            DeviceError: an emulator cannot serve; the message says which and why.
        """
        try:
            self._start()
        except BaseException:
            self._open.close()
            raise
        return self

    def __exit__(self, *ended: object) -> None:
        self._open.close()

    def truth(self) -> EmulatedTruth:
        """The object's true pose.

        Raises:
            DeviceError: the physics has stopped. The emulators continue, but nothing moves any more.
        """
        if self._memory.age_ns > _GONE_ns:
            hint = "Its process has ended, or this computer is too slow: run again"
            raise DeviceError("the emulated laboratory does not respond", where="plant", hint=hint)
        return EmulatedTruth(self._memory.world_T_object)

    @property
    def lost_s(self) -> float:
        """Time by which the plant fell behind the clock; more than zero on a machine too slow for real time."""
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
        world = {**_world(plan), "tips": str(plan.tips), "motors": str(plan.hand.motors)}
        positioner = POSITIONERS[plan.simulation.positioner]
        self._add("plant", "plant", memory, **world)
        self._add("base", positioner.emulator_host, memory, **plan.base)
        if plan.camera is not None:
            self._add("camera", "camera", memory, host=plan.camera[0], port=plan.camera[1], **world)
        for finger, wiring in plan.wires.items():
            start = {"finger": finger, "wiring": wiring.model_dump(mode="json"), **_world(plan)}
            self._add(f"ft/{finger}", WIRES[wiring.wire].emulator_host, memory, **start)
        self._add("hand", "hand", memory, **world, **_hand(plan.hand))
        for host in self.hosts.values():
            host.await_ready()

    def _add(self, device: str, role: str, memory: Path, **start: Any) -> None:
        host = HostProcess(device, role, mirror=str(memory), **start)
        self._open.callback(host.close)
        host.start()
        self.hosts[device] = host


def _world(plan: EmulationPlan) -> dict[str, Any]:
    return {"simulation": plan.simulation.model_dump(mode="json"), "seed": plan.seed}


def _hand(hand: HandPlace) -> dict[str, Any]:
    return {
        "far_end": hand.far,
        "joints": str(hand.joints),
        "palm": hand.palm,
        "serial": hand.serial,
    }
