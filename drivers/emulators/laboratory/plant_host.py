"""Runs the physics in real time: steps with the clock, publishes its state, and takes demands."""

from __future__ import annotations

import select
import sys
from pathlib import Path
from typing import Any

from drivers.core.clock import Clock
from drivers.core.contacts import FINGERS
from drivers.emulators.laboratory.plant_mirror import PlantMirror
from drivers.fingertips.kind import PalmKind
from drivers.fingertips.kinds import FINGERTIPS
from drivers.shadow.device.real_time import request_real_time
from drivers.simulation.calibration import SimulatedCalibration
from drivers.simulation.plant import Plant, STEP_ns
from drivers.simulation.settings import SimulationSettings
from drivers.simulation.world import SimulatedWorld

PRIORITY = 70
"""Scheduling priority, if permitted: the physics takes precedence over all else but the hand's frames."""

_LONGEST_ns = 20_000_000
"""The longest delay that the physics catches up with; the rest of a longer one is skipped and counted. Whoever reads
the sensors sees the world jump by it: no joint may turn farther in it than one can from reading to reading."""

_LOOK_EVERY = 50


class PlantHost:
    """Drives a plant.

    Args:
        plant: the plant, at rest.
        mirror: the shared memory in which others see it.
        clock: the clock that it follows.
        touches: whether to publish every contact of the fingertips too, for sensors that measure positions.
    """

    def __init__(self, plant: Plant, mirror: PlantMirror, clock: Clock, *, touches: bool = False) -> None:
        self._plant, self._mirror, self._clock, self._touches = plant, mirror, clock, touches
        self._publish()

    def serve(self) -> None:
        """Step until standard input ends."""
        request_real_time(PRIORITY)
        behind_ns, turns = self._clock.now_ns() - self._plant.stamp_ns, 0
        while turns % _LOOK_EVERY or not select.select([sys.stdin], [], [], 0)[0]:
            behind_ns += self._catch_up(self._clock.now_ns() - behind_ns)
            turns += 1
            self._clock.sleep_until_ns(self._plant.stamp_ns + behind_ns + STEP_ns)

    def _catch_up(self, due_ns: int) -> int:
        """Step up to a time of the plant; returns the time that it skipped, nanoseconds."""
        late_ns = due_ns - self._plant.stamp_ns
        lost_ns = max(late_ns - _LONGEST_ns, 0)
        duty, base_target = self._mirror.demands
        self._plant.drive(duty)
        self._plant.move_base(base_target)
        self._plant.advance((late_ns - lost_ns) // STEP_ns)
        self._mirror.count_lost(lost_ns)
        self._publish()
        return lost_ns

    def _publish(self) -> None:
        plant = self._plant
        self._mirror.publish(
            self._clock.now_ns(),
            plant.joints_rad,
            plant.motor_torque_Nm,
            plant.base,
            plant.wrenches,
            plant.world_T_object,
        )
        if self._touches:
            self._mirror.publish_touches(plant.contacts(), [plant.world_T_distal(f) for f in FINGERS])


def make(start: dict[str, Any], clock: Clock) -> PlantHost:
    """The plant of a simulated rig with these settings and this seed, published in the memory at ``mirror``."""
    settings = SimulationSettings.model_validate(start["simulation"])
    tips = SimulatedCalibration.of_hand(settings.fingertips, Path(start["tips"]), Path(start["motors"]))
    world = SimulatedWorld(settings, start["seed"], tips)
    mirror = PlantMirror(Path(start["mirror"]), clock)
    mirror.move_base(world.plant.base)
    return PlantHost(world.plant, mirror, clock, touches=isinstance(FINGERTIPS[settings.fingertips], PalmKind))
