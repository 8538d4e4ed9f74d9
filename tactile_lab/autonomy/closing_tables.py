"""The closings of a session, solved before its devices are connected."""

from __future__ import annotations

from itertools import product

from drivers.core.clock import Clock, VirtualClock
from drivers.shadow.closing.closing import SIDEWAYS, closing
from drivers.shadow.closing.posture import HandShape
from sessions.motion.probing.touch_patterns import ROW, TAP, TAP_HEIGHT_m
from tactile_lab.autonomy.settings import SessionSettings


def solve_closings(clock: Clock, settings: SessionSettings, hand: HandShape, dimension: int) -> None:
    """Compute every table that the session may need; with simulated time they are computed on demand.

    A table takes up to a second, in which no cycle would run: the planning process has its own tables.
    """
    if isinstance(clock, VirtualClock):
        return
    plan = settings.plan
    heights_m = plan.contour_heights_m if dimension == 2 else plan.surface_heights_m
    wanted = set(product(plan.closings, heights_m))
    if dimension == 3:
        wanted.add((TAP.closing, TAP_HEIGHT_m))
        if (exploration := settings.exploration).policy:
            wanted |= set(product(exploration.side_closings, exploration.side_heights_m))
    if settings.probing.is_wanted:
        wanted |= {(TAP.closing, TAP_HEIGHT_m), *((each.upright, each.height_m) for each in SIDEWAYS.values())}
    if settings.probing.enabled:
        wanted.add((ROW.closing, settings.cycle.touch.rake_height_m))
    for name, height_m in sorted(wanted):
        closing(name, height_m, hand)
