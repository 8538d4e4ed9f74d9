"""The wires of ATI's sensors: the transport and the decoder of each."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import TypeVar

from drivers.ati.protocols import cal_file
from drivers.ati.wires import controller_wire, digital_wire
from drivers.ati.wires.can_wire import CanWire
from drivers.ati.wires.controller_wire import ControllerWire
from drivers.ati.wires.digital_wire import DigitalWire
from drivers.ati.wires.gauge_volts import GaugeVoltsWire
from drivers.ati.wires.rdt_wire import BoxPages, RdtWire
from drivers.ati.wiring import CanWiring, ControllerWiring, DigitalWiring, NetBoxWiring, VoltsWiring, open_bus
from drivers.core.clock import Clock
from drivers.core.errors import ConfigurationError
from drivers.core.transports import Transport
from drivers.fingertips.wires import WireKind
from drivers.hardware.can_bus import CanTransport
from drivers.hardware.serial_port import SerialTransport
from drivers.hardware.udp import UdpTransport


class NetBoxKind(WireKind[NetBoxWiring]):
    """A Net F/T box over UDP and http."""

    settings = NetBoxWiring
    emulator_host = "drivers.emulators.laboratory.net_box_host"

    def transport(self, settings: NetBoxWiring, name: str, clock: Clock) -> Transport:
        return UdpTransport(name, settings.host, settings.port, clock)

    def decoder(self, settings: NetBoxWiring, folder: Path) -> RdtWire:
        pages = BoxPages(settings.host, settings.http_port, settings.rate_hz, settings.serial)
        return RdtWire(settings.counts_per_N, settings.counts_per_Nm, pages)

    def place(self, settings: NetBoxWiring) -> str:
        return f"the box at {settings.host}:{settings.port}"


class DigitalKind(WireKind[DigitalWiring]):
    """A Digital F/T sensor on RS-485."""

    settings = DigitalWiring

    def transport(self, settings: DigitalWiring, name: str, clock: Clock) -> Transport:
        return SerialTransport(name, settings.port, settings.baud, clock, parity=settings.parity)

    def decoder(self, settings: DigitalWiring, folder: Path) -> DigitalWire:
        return DigitalWire(settings.slot, settings.serial)

    def place(self, settings: DigitalWiring) -> str:
        return f"port {settings.port}"

    def alternatives(self, settings: DigitalWiring) -> tuple[DigitalWiring, ...]:
        return _other_rates(settings, digital_wire.BAUD_RATES)


class ControllerKind(WireKind[ControllerWiring]):
    """A stand-alone controller on RS-232."""

    settings = ControllerWiring

    def transport(self, settings: ControllerWiring, name: str, clock: Clock) -> Transport:
        return SerialTransport(name, settings.port, settings.baud, clock)

    def decoder(self, settings: ControllerWiring, folder: Path) -> ControllerWire:
        return ControllerWire(settings.mode, settings.counts_per_N, settings.counts_per_Nm)

    def place(self, settings: ControllerWiring) -> str:
        return f"port {settings.port}"

    def alternatives(self, settings: ControllerWiring) -> tuple[ControllerWiring, ...]:
        return _other_rates(settings, controller_wire.BAUD_RATES)


class CanKind(WireKind[CanWiring]):
    """A Net CAN OEM board."""

    settings = CanWiring

    def transport(self, settings: CanWiring, name: str, clock: Clock) -> Transport:
        return CanTransport(name, lambda: open_bus(settings), clock)

    def decoder(self, settings: CanWiring, folder: Path) -> CanWire:
        return CanWire(settings.base, settings.slot, settings.serial)

    def place(self, settings: CanWiring) -> str:
        return f"{settings.interface} {settings.channel}, base 0x{settings.base:x}"


class VoltsKind(WireKind[VoltsWiring]):
    """Gauge volts in datagrams of a data acquisition program."""

    settings = VoltsWiring

    def transport(self, settings: VoltsWiring, name: str, clock: Clock) -> Transport:
        return UdpTransport(name, settings.host, 0, clock, local=("", settings.local_port))

    def decoder(self, settings: VoltsWiring, folder: Path) -> GaugeVoltsWire:
        return GaugeVoltsWire(_own_calibration(folder / settings.calibration, settings.serial))

    def place(self, settings: VoltsWiring) -> str:
        return f"local port {settings.local_port}"

    def files(self, settings: VoltsWiring) -> Mapping[str, str]:
        return {"calibration": settings.calibration}


Serial = TypeVar("Serial", DigitalWiring, ControllerWiring)


def _other_rates(settings: Serial, rates: Iterable[int]) -> tuple[Serial, ...]:
    return tuple(settings.model_copy(update={"baud": baud}) for baud in rates if baud != settings.baud)


def _own_calibration(path: Path, serial: str) -> cal_file.AtiCalibration:
    calibration = cal_file.load(path)
    if serial and calibration.serial != serial:
        what = f"is the calibration of {calibration.serial}, but the sensor is {serial}"
        raise ConfigurationError(what, where=str(path), hint="Give the file that came with this sensor")
    return calibration
