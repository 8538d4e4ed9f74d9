"""The five Nano17 sensors themselves: their readings of a plant's loads, with errors (protocols: Nano17 ratings)."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from drivers.core.contacts import FINGERS, Array
from drivers.simulation.hand_plant import LoadedPlant
from drivers.simulation.settings import ForceSensorSettings

RANGE = np.array([12.0, 12.0, 17.0, 0.12, 0.12, 0.12])
"""Measuring range of a Nano17 SI-12-0.12, newtons and newton metres."""

RESOLUTION = np.array([1 / 320] * 3 + [1e-3 / 64] * 3)
"""Its resolution, newtons and newton metres."""

SHAPE = (len(FINGERS), 6)
"""Sampling of the readings of all five."""


class NanoSensors:
    """The five force sensors: true loads to readings with offset, drift, noise and the sensor's resolution.

    Args:
        plant: the physics behind the sensors.
        settings: size of the errors.
        rng: random numbers for the errors.
    """

    def __init__(self, plant: LoadedPlant, settings: ForceSensorSettings, rng: np.random.Generator) -> None:
        self._plant, self._rng = plant, rng
        self._offset = six(settings.offset_N, settings.offset_Nm) * rng.standard_normal(SHAPE)
        self._keep = float(np.exp(-1 / (settings.rate_hz * settings.drift_time_s)))
        self._wander = np.sqrt(1 - self._keep**2) * six(settings.drift_N, settings.drift_Nm)
        self._drift = six(settings.drift_N, settings.drift_Nm) * rng.standard_normal(SHAPE)
        self._noise = settings.noise_lsb * RESOLUTION

    def read(self) -> tuple[Array, NDArray[np.bool_]]:
        """One reading: wrenches, shape (5, 6), sensor frames, and which sensors are saturated, shape (5,)."""
        fresh = self._rng.standard_normal((2, *SHAPE))
        self._drift = self._keep * self._drift + self._wander * fresh[0]
        measured = self._plant.wrenches + self._offset + self._drift + self._noise * fresh[1]
        inside = np.minimum(np.maximum(measured, -RANGE), RANGE)
        return np.rint(inside / RESOLUTION) * RESOLUTION, (inside != measured).any(axis=1)


def six(force: float, moment: float) -> Array:
    """One value for the forces and one for the moments, as shape (6,)."""
    return np.array([force] * 3 + [moment] * 3)
