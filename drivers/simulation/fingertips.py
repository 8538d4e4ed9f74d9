"""Simulated fingertips by the name of their kind; see :mod:`drivers.fingertips.kinds`."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any, TypeAlias

import numpy as np

from drivers.core.registry import Registry
from drivers.core.transports import Peer
from drivers.fingertips.biotac import KnownBioTac
from drivers.simulation.devices.biotac_emulator import BiotacSection
from drivers.simulation.devices.rdt_emulator import RdtBank
from drivers.simulation.hand_plant import TipPlant, TouchedPlant
from drivers.simulation.sections import TactileSection, TimedDevice
from drivers.simulation.settings import SimulationSettings


@dataclass(frozen=True)
class SimulatedLinks:
    """The far ends of the links of simulated fingertips.

    Attributes:
        peers: by finger.
        device: acts for all of them at its own times; None if the peers only answer.
    """

    peers: Mapping[str, Peer]
    device: TimedDevice | None = None


Simulate: TypeAlias = Callable[
    [Any, Mapping[str, Any], SimulationSettings, np.random.Generator], "SimulatedLinks | TactileSection"
]
"""Creates simulated fingertips from the plant, their calibrations by finger, settings, and random numbers.

The plant is a :class:`~drivers.simulation.hand_plant.TipPlant`. Kinds with their own transports return
:class:`SimulatedLinks`. Kinds that send through the palm return its tactile section, and need only a
:class:`~drivers.simulation.hand_plant.TouchedPlant`.
"""

SIMULATED_FINGERTIPS: Registry[Simulate] = Registry("simulated fingertip kind", group="simulated_fingertips")
"""The simulation of each kind of fingertip, by its name."""


def _nano17(
    plant: TipPlant, calibrations: Mapping[str, Any], settings: SimulationSettings, rng: np.random.Generator
) -> SimulatedLinks:
    bank = RdtBank(plant, settings.force_sensors, rng)
    return SimulatedLinks(bank.boxes, bank)


def _biotac(
    plant: TouchedPlant, calibrations: Mapping[str, KnownBioTac], settings: SimulationSettings, rng: np.random.Generator
) -> TactileSection:
    plain = {finger: known.calibration for finger, known in calibrations.items()}
    return BiotacSection.as_calibrated(plant, plain, settings.biotac, rng)


SIMULATED_FINGERTIPS.register("nano17", _nano17)
SIMULATED_FINGERTIPS.register("biotac", _biotac)


def tactile_section(
    kind: str, plant: TouchedPlant, tips: Mapping[str, Any], settings: SimulationSettings, rng: np.random.Generator
) -> TactileSection:
    """The palm's tactile section with fingertips of a kind that sends through it. Raises ConfigurationError."""
    made = SIMULATED_FINGERTIPS[kind](plant, tips, settings, rng)
    assert not isinstance(made, SimulatedLinks), f"fingertips of kind {kind} have their own transports"
    return made
