"""Simulated positioners by the name of their kind; see :mod:`drivers.positioner.kinds`."""

from __future__ import annotations

from collections.abc import Callable

from drivers.core.registry import Registry
from drivers.core.transports import Peer
from drivers.simulation.devices.arm_emulator import ArmEmulator
from drivers.simulation.devices.positioner_emulator import PositionerEmulator
from drivers.simulation.hand_plant import CarriedPlant

SIMULATED_POSITIONERS: Registry[Callable[[CarriedPlant], Peer]] = Registry(
    "simulated positioner", group="simulated_positioners"
)
"""Creates the far end of each kind's transport, for a plant that it moves."""

SIMULATED_POSITIONERS.register("six-axis", PositionerEmulator)
SIMULATED_POSITIONERS.register("ur", ArmEmulator)
