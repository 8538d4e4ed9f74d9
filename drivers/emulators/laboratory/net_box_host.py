"""The emulated Net F/T box of one fingertip on UDP and HTTP sockets, driven by the plant."""

from __future__ import annotations

import select
import sys
from pathlib import Path
from typing import Any

import numpy as np

from drivers.ati.protocols import rdt_codec
from drivers.ati.wiring import NetBoxWiring
from drivers.core.clock import Clock
from drivers.core.contacts import FINGERS, Array
from drivers.core.errors import DeviceError
from drivers.emulators.ati.net_box_server import NetBoxServer
from drivers.emulators.ati.net_box_unit import NetBoxUnit
from drivers.emulators.ati.sensor import EmulatedSensor, emulated_calibration
from drivers.emulators.laboratory.plant_mirror import PlantMirror
from drivers.simulation.devices.nano_sensors import NanoSensors
from drivers.simulation.settings import SimulationSettings

_SATURATED = rdt_codec.SATURATION | 1 << 31


class PlantSensor(EmulatedSensor):
    """The transducer of one finger: measures the load on the plant's fingertip.

    Args:
        serial: serial number of its calibration.
        sensors: the plant's force sensors with their errors.
        finger: the finger that carries it.
    """

    def __init__(self, serial: str, sensors: NanoSensors, finger: str) -> None:
        super().__init__(emulated_calibration(serial))
        self._sensors, self._row = sensors, FINGERS.index(finger)
        self.saturated = False

    def wrench(self) -> Array:
        """One reading: N and N m, shape (6,)."""
        wrenches, saturated = self._sensors.read()
        self.saturated = bool(saturated[self._row])
        return np.asarray(wrenches[self._row])


class PlantBox(NetBoxUnit):
    """A box whose status reports when its sensor is beyond its range."""

    def __init__(self, sensor: PlantSensor, rate_hz: int) -> None:
        super().__init__(sensor, rate_hz)
        self._plant_sensor = sensor

    def tick(self) -> bytes | None:
        """The next record."""
        self.status = _SATURATED if self._plant_sensor.saturated else 0
        return super().tick()


class NetBoxHost:
    """Serves a box in its own threads."""

    def __init__(self, server: NetBoxServer) -> None:
        self._server = server

    def serve(self) -> None:
        """Wait until standard input ends."""
        with self._server:
            select.select([sys.stdin], [], [])


def make(start: dict[str, Any], clock: Clock) -> NetBoxHost:
    """The box of ``finger`` at the address in its ``wiring``.

    Raises:
        DeviceError: an address is not this computer's, or is in use.
    """
    finger, wiring = start["finger"], NetBoxWiring.model_validate(start["wiring"])
    settings = SimulationSettings.model_validate(start["simulation"]).force_sensors
    rng = np.random.default_rng([start["seed"], FINGERS.index(finger)])
    sensors = NanoSensors(
        PlantMirror(Path(start["mirror"]), clock), settings.model_copy(update={"rate_hz": wiring.rate_hz}), rng
    )
    unit = PlantBox(PlantSensor(wiring.serial or f"FT-{finger}", sensors, finger), wiring.rate_hz)
    try:
        return NetBoxHost(NetBoxServer(unit, wiring.host, wiring.port, wiring.http_port))
    except OSError as error:
        what = f"cannot be emulated at {wiring.host} ({error.strerror})"
        raise DeviceError(
            what, where=f"box {finger}", hint="End the other emulated laboratory, or choose a free address"
        ) from error
