"""The laboratory of a session: a simulated world in this program, devices on wires, or their emulators."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Protocol

from drivers.camera.markers import MarkerSettings
from drivers.core.clock import Clock, MonotonicClock
from drivers.core.configuration import load_model
from drivers.emulators.laboratory.emulated_laboratory import EmulatedLaboratory
from drivers.shadow.device.real_time import prefer
from drivers.simulation.object_names import MESH_PREFIX
from drivers.simulation.objects import CATALOGUE, ObjectModel, object_model
from drivers.simulation.world import SimulatedWorld, marker_settings
from sessions.recording.recorder import Recorder, TrafficSink
from sessions.rig_runtime.rig_runtime import RigRuntime
from tactile_lab.rigs.build import build_runtime, simulated_world
from tactile_lab.rigs.description import Rig
from tactile_lab.rigs.wired import emulation_plan, with_form, with_palm
from tactile_lab.rigs.wired_runtime import build_wired_runtime


class Laboratory(Protocol):
    """A place with devices.

    Attributes:
        rig: what is there: with the hand's side and fingers, and the palm that was found on its cable, where the file
            leaves them open.
        markers: of the rig with this object, for the truth.
        target: the object, where its shape is known.
    """

    @property
    def rig(self) -> Rig: ...
    @property
    def markers(self) -> MarkerSettings: ...
    @property
    def target(self) -> ObjectModel | None: ...

    def runtime(self, recorder: Recorder, *, first_move: bool | None = None) -> RigRuntime:
        """Its devices, not yet connected.

        Args:
            recorder: of the session.
            first_move: nudge each motor of a real hand when connecting; None for what the rig file says.
        """

    def remarks(self) -> tuple[str, ...]:
        """Problems of the laboratory itself so far."""


@dataclass(frozen=True)
class SimulatedLaboratory:
    """A simulated world in this program, with its own time."""

    rig: Rig
    world: SimulatedWorld

    @property
    def markers(self) -> MarkerSettings:
        return self.world.marker_settings

    @property
    def target(self) -> ObjectModel:
        return self.world.object_model

    def runtime(self, recorder: Recorder, *, first_move: bool | None = None) -> RigRuntime:
        """See :class:`Laboratory`."""
        return build_runtime(self.rig, self.world, recorder)

    def remarks(self) -> tuple[str, ...]:
        return ()


@dataclass(frozen=True)
class WiredLaboratory:
    """Devices on wires, or their emulators, in real time."""

    rig: Rig
    clock: Clock
    markers: MarkerSettings
    target: ObjectModel | None = None
    emulators: EmulatedLaboratory | None = None

    def runtime(self, recorder: Recorder, *, first_move: bool | None = None) -> RigRuntime:
        """See :class:`Laboratory`."""
        truth = None if self.emulators is None else self.emulators.truth
        return build_wired_runtime(self.rig, recorder, self.clock, truth=truth, first_move=first_move)

    def remarks(self) -> tuple[str, ...]:
        """Whether the physics could not keep up with the clock; see :class:`Laboratory`."""
        lost_s = 0.0 if self.emulators is None else self.emulators.lost_s
        words = (
            f"the emulated laboratory stalled for {1000 * lost_s:.0f} ms in all: this computer is too slow or too busy"
        )
        return (words,) if lost_s else ()


@contextmanager
def open_laboratory(rig: Rig, seed: int, object_name: str) -> Iterator[SimulatedLaboratory | WiredLaboratory]:
    """The laboratory of a rig with an object on its table; emulators run while the context lasts.

    A real laboratory takes any name for its object. A name of the catalogue, or of a mesh, gives its true shape.

    Raises:
        ConfigurationError: no such object in a simulation, a mesh that cannot be used, or emulators that this program
            does not have.
        DeviceError: a emulator cannot be started, or the rig leaves it to the hand's cable which palm there is, and
            none that can be driven is found.
    """
    rig = with_form(rig)
    if rig.description.kind == "simulated":
        yield SimulatedLaboratory(rig, simulated_world(rig, seed, object_name))
    elif rig.description.emulated:
        target, clock = object_model(object_name), MonotonicClock()
        with EmulatedLaboratory(emulation_plan(rig, seed, object_name), clock) as emulators, prefer():
            found, markers = with_palm(rig, clock), marker_settings(target, _markers(rig))
            yield WiredLaboratory(found, clock, markers, target, emulators)
    else:
        known = object_name in CATALOGUE or object_name.startswith(MESH_PREFIX)
        target_or_none, clock = object_model(object_name) if known else None, MonotonicClock()
        with prefer():
            yield WiredLaboratory(with_palm(rig, clock), clock, _markers(rig), target_or_none)


@contextmanager
def connected_runtime(
    rig: Rig, seed: int, object_name: str, onlooker: TrafficSink, *, first_move: bool | None = None
) -> Iterator[RigRuntime]:
    """The connected devices of a rig, for a wizard; they are closed in the end.

    Args:
        rig, seed, object_name: see :func:`open_laboratory`.
        onlooker: is shown what the devices say.
        first_move: see :meth:`Laboratory.runtime`.

    Raises:
        TactileLabError: as :func:`open_laboratory`; or a device does not connect.
    """
    with open_laboratory(rig, seed, object_name) as laboratory:
        runtime = laboratory.runtime(Recorder(onlooker), first_move=first_move)
        runtime.connect()
        try:
            yield runtime
        finally:
            runtime.close()


def _markers(rig: Rig) -> MarkerSettings:
    return load_model(rig.files["markers"], MarkerSettings) if "markers" in rig.files else MarkerSettings()
