"""All kinds of positioners by the name that rig files call them.

Every kind is commanded and reports its position in the same six coordinates of the mount (metres and radians, see
:mod:`drivers.positioner.kinematics`), so that planning, calibration and replay know no other; a robot with other joints
does its inverse kinematics in its driver.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Literal, Protocol, runtime_checkable

from pydantic import Field

from drivers.core.clock import Clock
from drivers.core.configuration import StrictModel
from drivers.core.contacts import Array
from drivers.core.registry import Registry
from drivers.core.transports import Datagram, Transport
from drivers.force.wire_settings import Port
from drivers.hardware.udp import UdpTransport
from drivers.positioner.positioner import Positioner
from drivers.positioner.settings import PositionerCounters, PositionerSettings
from drivers.positioner.ur.device import UrPositioner
from drivers.positioner.ur.process import UrProcess
from drivers.positioner.ur.settings import UrSettings, UrWiring


class PlaceSample(Protocol):
    """Where a positioner stands: its coordinates, shape (6,), and when they arrived, session clock."""

    @property
    def stamp_ns(self) -> int: ...
    @property
    def q(self) -> Array: ...


class PositionerDevice(Protocol):
    """A positioner: the live device, and apart from it the decoder that a session listens with."""

    def connect(self) -> None:
        """Open the link and learn where it stands; nothing moves. All or nothing; repeatable. Raises DeviceError."""

    def close(self) -> None:
        """It holds its last target. Idempotent."""

    def set_target(self, q: Array, /) -> None:
        """Where to go, shape (6,), within its own limits of range and speed. Raises DeviceError."""

    def exchange(self) -> object:
        """One cycle: send the next step, receive. Raises DeviceError when not connected or stopped by a fault."""

    def stop(self) -> None:
        """Stay here until :meth:`resume`; never raises."""

    def resume(self) -> None:
        """Take back a stop or a fault; the target is where it stands."""

    def receive(self, datagram: Datagram) -> PlaceSample | None:
        """The sample in a message; None when it holds none. Raises CodecError."""

    def health(self) -> tuple[str, ...]:
        """What is wrong, in words; empty when all is well."""


@runtime_checkable
class LedPositioner(Protocol):
    """A positioner that a person can lead by hand."""

    def lead_by_hand(self) -> None:
        """From now on a person leads it, until ``stop`` or ``resume``."""


@runtime_checkable
class CountingPositioner(Protocol):
    """A positioner that counts its cycles and those that it lost."""

    @property
    def counters(self) -> PositionerCounters: ...


class UdpWiring(StrictModel):
    """The program that moves the positioner, spoken to in datagrams of 52 bytes (docs/real-laboratory.md)."""

    wire: Literal["udp"]
    host: str = Field(min_length=1)
    port: Port


@dataclass(frozen=True)
class PositionerKind:
    """A kind of positioner.

    Attributes:
        settings: model of what a rig file may say under ``base``; every value has a default.
        device: from a transport, a clock and settings.
        wiring: model of what a rig file says under ``wires.base``.
        transport: from such wiring, settings, the name in recordings and a clock.
        emulator_host: the module that serves such a device in emulated laboratories, from the wiring, the settings and
            where the mount stands; empty where there is none.
    """

    settings: type[StrictModel]
    device: Callable[[Transport, Clock, Any], PositionerDevice]
    wiring: type[StrictModel]
    transport: Callable[[Any, Any, str, Clock], Transport]
    emulator_host: str = ""


POSITIONERS: Registry[PositionerKind] = Registry("positioner", group="positioners", form=PositionerKind)
"""See ``docs/extending.md`` for adding one."""


def _udp(wiring: UdpWiring, settings: PositionerSettings, name: str, clock: Clock) -> Transport:
    return UdpTransport(name, wiring.host, wiring.port, clock)


def _ur(wiring: UrWiring, settings: UrSettings, name: str, clock: Clock) -> Transport:
    return UrProcess(wiring, settings, name)


POSITIONERS.register(
    "six-axis",
    PositionerKind(
        settings=PositionerSettings,
        device=Positioner,
        wiring=UdpWiring,
        transport=_udp,
        emulator_host="drivers.emulators.laboratory.positioner_host",
    ),
)
POSITIONERS.register(
    "ur",
    PositionerKind(
        settings=UrSettings,
        device=UrPositioner,
        wiring=UrWiring,
        transport=_ur,
        emulator_host="drivers.emulators.ur.host",
    ),
)
