"""How a rig file says where a Nano17's readings come from, and the link and wire that this makes."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Literal

import can
from pydantic import Field

from drivers.ati import cal_file, rdt_codec
from drivers.ati.can_codec import DEFAULT_BASE
from drivers.ati.can_wire import CanWire
from drivers.ati.controller_wire import ControllerWire
from drivers.ati.digital_wire import DigitalWire
from drivers.ati.gauge_volts import GaugeVoltsWire
from drivers.ati.rdt_wire import BoxPages, RdtWire
from drivers.ati.wire import ForceWire
from drivers.hardware.can_bus import CanLink
from drivers.hardware.serial_port import SerialLink
from drivers.hardware.udp import UdpLink
from drivers.links import Link
from tactile_lab.clock import Clock
from tactile_lab.errors import ConfigurationError
from tactile_lab.strict_yaml import StrictModel

Port = Annotated[int, Field(ge=1, le=65535)]
Scale = Annotated[float, Field(gt=0.0)]


class NetBoxWiring(StrictModel):
    """A Net F/T box.

    Attributes:
        host, port, http_port: its address, its RDT port and that of its pages.
        rate_hz: records per second to set; the box divides 7000 by a whole number.
        serial: of the sensor's calibration; left out for any.
        counts_per_N, counts_per_Nm: its scale; the box must agree.
    """

    wire: Literal["net-ft"]
    host: str = Field(min_length=1)
    port: Port = rdt_codec.PORT
    http_port: Port = 80
    rate_hz: int = Field(default=1000, ge=1, le=7000)
    serial: str = ""
    counts_per_N: Scale = 1_000_000.0
    counts_per_Nm: Scale = 1_000_000.0


class DigitalWiring(StrictModel):
    """A Digital F/T sensor on RS-485.

    Attributes:
        port: of the adapter.
        baud, parity: of the line; the sensor itself always has even parity.
        slot: which of its calibrations, from 1.
        serial: of the sensor; left out for any.
    """

    wire: Literal["digital"]
    port: str = Field(min_length=1)
    baud: Literal[1_250_000, 115_200, 19_200] = 1_250_000
    parity: Literal["E", "N"] = "E"
    slot: int = Field(default=1, ge=1, le=16)
    serial: str = ""


class ControllerWiring(StrictModel):
    """A stand-alone F/T controller on RS-232.

    Attributes:
        port: of the adapter.
        baud: as set at the controller.
        mode: form of the records.
        counts_per_N, counts_per_Nm: from the calibration papers: the controller does not tell.
    """

    wire: Literal["controller"]
    port: str = Field(min_length=1)
    baud: Literal[9600, 19_200, 38_400] = 9600
    mode: Literal["ascii", "binary"] = "binary"
    counts_per_N: Scale
    counts_per_Nm: Scale


class CanWiring(StrictModel):
    """A Net CAN OEM board.

    Attributes:
        interface, channel: as python-can names adapters (``socketcan`` and ``can0``, for example).
        bitrate: of the bus.
        base: upper part of the board's identifiers.
        slot: which of its calibrations, from 0.
        serial: of the sensor; left out for any.
    """

    wire: Literal["can-oem"]
    interface: str = Field(min_length=1)
    channel: str = Field(min_length=1)
    bitrate: int = Field(default=250_000, ge=10_000, le=1_000_000)
    base: int = Field(default=DEFAULT_BASE, ge=0, le=0x7F)
    slot: int = Field(default=0, ge=0, le=15)
    serial: str = ""


class VoltsWiring(StrictModel):
    """Gauge volts from a data acquisition program.

    Attributes:
        calibration: the sensor's .cal file, relative to the rig file.
        serial: of the sensor on the amplifier, from its label; a file of another one is refused. Left out for any.
        host: where the program runs.
        local_port: where it sends to on this computer.
    """

    wire: Literal["gauge-volts"]
    calibration: str = Field(min_length=1)
    serial: str = ""
    host: str = "127.0.0.1"
    local_port: Port


Wiring = Annotated[
    NetBoxWiring | DigitalWiring | ControllerWiring | CanWiring | VoltsWiring, Field(discriminator="wire")
]


def make_link(wiring: Wiring, name: str, clock: Clock) -> Link:
    """The link to the device, not yet open."""
    match wiring:
        case NetBoxWiring():
            return UdpLink(name, wiring.host, wiring.port, clock)
        case DigitalWiring():
            return SerialLink(name, wiring.port, wiring.baud, clock, parity=wiring.parity)
        case ControllerWiring():
            return SerialLink(name, wiring.port, wiring.baud, clock)
        case CanWiring():
            return CanLink(name, lambda: open_bus(wiring), clock)
        case VoltsWiring():
            return UdpLink(name, wiring.host, 0, clock, local=("", wiring.local_port))


def make_wire(wiring: Wiring, folder: Path) -> ForceWire:
    """How the device's messages are read; ``folder`` is that of the rig file.

    Raises:
        ConfigurationError: the calibration file can not be used; CodecError: it is in counts, not volts.
    """
    match wiring:
        case NetBoxWiring():
            pages = BoxPages(wiring.host, wiring.http_port, wiring.rate_hz, wiring.serial)
            return RdtWire(wiring.counts_per_N, wiring.counts_per_Nm, pages)
        case DigitalWiring():
            return DigitalWire(wiring.slot, wiring.serial)
        case ControllerWiring():
            return ControllerWire(wiring.mode, wiring.counts_per_N, wiring.counts_per_Nm)
        case CanWiring():
            return CanWire(wiring.base, wiring.slot, wiring.serial)
        case VoltsWiring():
            return GaugeVoltsWire(_own_calibration(folder / wiring.calibration, wiring.serial))


def _own_calibration(path: Path, serial: str) -> cal_file.AtiCalibration:
    calibration = cal_file.load(path)
    if serial and calibration.serial != serial:
        what = f"is the calibration of {calibration.serial}, and the sensor is {serial}"
        raise ConfigurationError(what, where=str(path), hint="Name the file that came with this sensor")
    return calibration


def open_bus(wiring: CanWiring) -> can.BusABC:
    """Open the bus; only this board's identifiers pass. Raises what python-can raises."""
    mask = [{"can_id": wiring.base << 4, "can_mask": 0x7F0, "extended": False}]
    return can.Bus(
        interface=wiring.interface, channel=wiring.channel, bitrate=wiring.bitrate, can_filters=mask, fd=False
    )
