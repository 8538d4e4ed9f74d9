"""Processor time of odometry in the hand for each carry of simulated sessions, with its checks for slip."""

from __future__ import annotations

import time
from collections.abc import Callable
from functools import partial

import numpy as np

from drivers.simulation.world import SimulatedWorld
from sessions.perception.carrying.carry_record import CarrySamples
from sessions.perception.carrying.slip import slip
from sessions.rig_runtime.rig_runtime import RigRuntime
from tactile_lab.benchmarks.components import Timing, TimingTable, median_ms
from tactile_lab.experiments.runs.carried_objects import CarryWatch, watch_carries

OBJECTS, GRASPS = ("box-10x6x4", "l-block", "cylinder"), 5
_SEED, _REPEATS = 0, 7
_ASKED_AT = (0.33, 0.5, 0.67)
"""When the hand is a quarter, half and three quarters along its way: shares of the time of a carry."""


class _TimedCarries(CarryWatch):
    """Times the odometry of each carry as it ends."""

    def __init__(self, world: SimulatedWorld, runtime: RigRuntime, seed: int) -> None:
        super().__init__(world, runtime, seed)
        self._begun_ns = 0
        self.whole_ms: list[float] = []
        """Of the carry itself."""
        self.checks_ms: list[float] = []
        """Of all its checks for slip."""

    def phase(self, number: int, name: str) -> None:
        """A carry begins, or has ended."""
        super().phase(number, name)
        if name == "re-orient":
            self._begun_ns = self._world.clock.now_ns()
        if name == "release":
            self._time_carry()

    def _time_carry(self) -> None:
        held = self._runtime.perception.held
        whole, moved = held.samples, held.samples_since(self._begun_ns)
        if whole is None or moved is None:
            return
        side, friction = self._runtime.perception.form.side, held.odometry.friction
        self.whole_ms.append(_processor_ms(lambda: held.odometry.estimate(whole)))
        asked = [part for share in _ASKED_AT if (part := _beginning(moved, share)) is not None]
        checks = [partial(slip, part, held.fingertips, side, friction) for part in asked]
        self.checks_ms.append(sum(map(_processor_ms, checks)))


def carry_table(objects: tuple[str, ...] = OBJECTS, grasps: int = GRASPS) -> TimingTable:
    """Processor times over the carries of one session with each object.

    Args:
        objects: of the catalogue.
        grasps: of each session; the object is carried after all but the last.
    """
    watches: list[_TimedCarries] = []

    def make_watch(world: SimulatedWorld, runtime: RigRuntime, seed: int) -> CarryWatch:
        watches.append(_TimedCarries(world, runtime, seed))
        return watches[-1]

    for name in objects:
        watch_carries(name, _SEED, grasps, make_watch=make_watch)
    whole, checks = (np.concatenate([getattr(w, kind) for w in watches]) for kind in ("whole_ms", "checks_ms"))
    note = f"{', '.join(objects)}, on the simulated rig"
    lines = {
        "a carry, median": np.median(whole),
        "a carry, largest": np.max(whole),
        "three checks for slip while it lasts, median": np.median(checks),
        "three checks for slip while it lasts, largest": np.max(checks),
    }
    timings = tuple(Timing(name, float(ms), len(whole), None, note) for name, ms in lines.items())
    return TimingTable("Odometry in the hand, processor time", timings)


def _beginning(samples: CarrySamples, share: float) -> CarrySamples | None:
    first_ns, last_ns = samples.stamps_ns[[0, -1]]
    return samples.until(int(first_ns + share * (last_ns - first_ns)))


def _processor_ms(work: Callable[[], object]) -> float:
    return median_ms(work, time.process_time_ns, _REPEATS)
