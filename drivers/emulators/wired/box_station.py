"""One fingertip's Net F/T box on its UDP and http sockets, fed by the plant."""

from __future__ import annotations

import select
import sys
from pathlib import Path
from typing import Any

import numpy as np

from drivers.ati import rdt_codec
from drivers.emulators.ati_sensor import EmulatedSensor, emulated_calibration
from drivers.emulators.net_box_server import NetBoxServer
from drivers.emulators.net_box_unit import NetBoxUnit
from drivers.emulators.wired.plant_mirror import PlantMirror
from drivers.simulation.nano_sensors import NanoSensors
from drivers.simulation.settings import ForceSensorSettings
from tactile_lab.clock import Clock
from tactile_lab.errors import DeviceError
from tactile_lab.geometry.contacts import FINGERS, Array

_SATURATED = rdt_codec.SATURATION | 1 << 31


class PlantSensor(EmulatedSensor):
    """The transducer of one finger: feels what the plant's fingertip feels.

    Args:
        serial: of its calibration.
        sensors: the plant's force sensors with their errors.
        finger: whose.
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
    """A box whose status tells when its sensor is beyond its range."""

    def __init__(self, sensor: PlantSensor, rate_hz: int) -> None:
        super().__init__(sensor, rate_hz)
        self._plant_sensor = sensor

    def tick(self) -> bytes | None:
        """The next record."""
        self.status = _SATURATED if self._plant_sensor.saturated else 0
        return super().tick()


class BoxStation:
    """A box that serves in threads of its own."""

    def __init__(self, server: NetBoxServer) -> None:
        self._server = server

    def serve(self) -> None:
        """Wait until standard input ends."""
        with self._server:
            select.select([sys.stdin], [], [])


def make(start: dict[str, Any], clock: Clock) -> BoxStation:
    """The box of ``finger`` at ``host``, ``port`` and ``http_port``.

    Raises:
        DeviceError: an address is another computer's or taken.
    """
    finger, rate_hz = start["finger"], start["rate_hz"]
    settings = ForceSensorSettings.model_validate(start["force_sensors"])
    rng = np.random.default_rng([start["seed"], FINGERS.index(finger)])
    sensors = NanoSensors(
        PlantMirror(Path(start["mirror"]), clock), settings.model_copy(update={"rate_hz": rate_hz}), rng
    )
    unit = PlantBox(PlantSensor(start["serial"], sensors, finger), rate_hz)
    try:
        return BoxStation(NetBoxServer(unit, start["host"], start["port"], start["http_port"]))
    except OSError as error:
        what = f"can not be served at {start['host']} ({error.strerror})"
        raise DeviceError(what, where=f"box {finger}", hint="End the other laboratory, or name a free place") from error
