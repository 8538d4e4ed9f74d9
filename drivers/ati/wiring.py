"""The wires of a Nano17: the settings of each in a rig file."""

from __future__ import annotations

from typing import Annotated, Literal

import can
from pydantic import Field

from drivers.ati.protocols import rdt_codec
from drivers.ati.protocols.can_codec import DEFAULT_BASE
from drivers.force.wire_settings import Port, WireSettings

Scale = Annotated[float, Field(gt=0.0)]


class NetBoxWiring(WireSettings):
    """A Net F/T box.

    Attributes:
        host, port, http_port: its address, its RDT port and the port of its web pages.
        rate_hz: records per second to set; the box divides 7000 by an integer.
        serial: of the sensor's calibration; omit to accept any.
        counts_per_N, counts_per_Nm: the expected scale; the box must report the same.
    """

    wire: Literal["net-ft"]
    host: str = Field(min_length=1)
    port: Port = rdt_codec.PORT
    http_port: Port = 80
    rate_hz: int = Field(default=1000, ge=1, le=7000)
    serial: str = ""
    counts_per_N: Scale = 1_000_000.0
    counts_per_Nm: Scale = 1_000_000.0


class DigitalWiring(WireSettings):
    """A Digital F/T sensor on RS-485.

    Attributes:
        port: of the adapter.
        baud, parity: of the line; the sensor always uses even parity.
        slot: which of its calibrations, from 1.
        serial: of the sensor; omit to accept any.
    """

    wire: Literal["digital"]
    port: str = Field(min_length=1)
    baud: Literal[1_250_000, 115_200, 19_200] = 1_250_000
    parity: Literal["E", "N"] = "E"
    slot: int = Field(default=1, ge=1, le=16)
    serial: str = ""


class ControllerWiring(WireSettings):
    """A stand-alone F/T controller on RS-232.

    Attributes:
        port: of the adapter.
        baud: as set at the controller.
        mode: form of the records.
        counts_per_N, counts_per_Nm: from the calibration papers, since the controller does not report them.
    """

    wire: Literal["controller"]
    port: str = Field(min_length=1)
    baud: Literal[9600, 19_200, 38_400] = 9600
    mode: Literal["ascii", "binary"] = "binary"
    counts_per_N: Scale
    counts_per_Nm: Scale


class CanWiring(WireSettings):
    """A Net CAN OEM board.

    Attributes:
        interface, channel: as python-can names adapters (``socketcan`` and ``can0``, for example).
        bitrate: of the bus.
        base: upper part of the board's identifiers.
        slot: which of its calibrations, from 0.
        serial: of the sensor; omit to accept any.
    """

    wire: Literal["can-oem"]
    interface: str = Field(min_length=1)
    channel: str = Field(min_length=1)
    bitrate: int = Field(default=250_000, ge=10_000, le=1_000_000)
    base: int = Field(default=DEFAULT_BASE, ge=0, le=0x7F)
    slot: int = Field(default=0, ge=0, le=15)
    serial: str = ""


class VoltsWiring(WireSettings):
    """Gauge volts from a data acquisition program.

    Attributes:
        calibration: the sensor's .cal file, relative to the rig file.
        serial: of the sensor on the amplifier, from its label; the file of another sensor is refused. Omit to accept
            any.
        host: where the program runs.
        local_port: the port on this computer to which it sends.
    """

    wire: Literal["gauge-volts"]
    calibration: str = Field(min_length=1)
    serial: str = ""
    host: str = "127.0.0.1"
    local_port: Port


def open_bus(wiring: CanWiring) -> can.BusABC:
    """Open the bus; only this board's identifiers are received. Raises the exceptions of python-can."""
    mask = [{"can_id": wiring.base << 4, "can_mask": 0x7F0, "extended": False}]
    return can.Bus(
        interface=wiring.interface, channel=wiring.channel, bitrate=wiring.bitrate, can_filters=mask, fd=False
    )
