"""Why a session cannot continue with its object, in words: what was measured, and what to change."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from drivers.core.contacts import Array, Grasp
from sessions.motion.probing.bounding_box import BoundingBox

OPENING_m = 0.105
"""Between parallel sides that thumb and fingers still straddle."""

_STEADY = "If it rolled, fell over or was pushed away, put it back and steady it: putty under its foot, or more weight"


def not_found(box: BoundingBox, expected_m: Array, around_m: float, lowest_m: float) -> str:
    """Nothing was met before the first grasp.

    Args:
        box: as far as it was felt.
        expected_m: where the object was looked for first, world x, y.
        around_m: how far from there the last taps were.
        lowest_m: height of the fingertips at the end of a tap.
    """
    return (
        f"no object was found where it is expected; {box.in_words()} at {_place(expected_m)} and "
        f"{1e3 * around_m:.0f} mm around, down to {1e3 * lowest_m:.0f} mm above the table. Put the object there, or "
        "give its place in the rig file (conductor.plan.start_m); objects below a fingertip's size are not felt"
    )


def blocked(approaches: int, landings_m: Sequence[Array]) -> str:
    """Every approach was blocked.

    Args:
        approaches: in a row that failed.
        landings_m: where the hand landed on the object, world, shape (3,) each.
    """
    said = f"could not reach the table: {approaches} approaches were blocked"
    if not len(landings_m):
        return said
    length_mm, width_mm = 1e3 * np.ptp(np.array(landings_m), axis=0)[:2]
    top_mm = 1e3 * max(float(place[2]) for place in landings_m)
    return (
        f"{said}; the hand landed over {length_mm:.0f} x {width_mm:.0f} mm, up to {top_mm:.0f} mm above the table, "
        f"while the open hand spans {1e3 * OPENING_m:.0f} mm. Turn the object or lay it on another side; with "
        "--dimension 3 wider objects are touched instead"
    )


def nowhere(places_m: Array) -> str:
    """Nothing was met at any of the places, world x, y, shape (n, 2), where an object was looked for."""
    middle_m = np.mean(places_m, axis=0)
    far_mm = 1e3 * float(np.linalg.norm(places_m - middle_m, axis=1).max())
    return f"and {len(places_m)} taps up to {far_mm:.0f} mm around {_place(middle_m)} met nothing"


def lost(reason: str, grasps: Sequence[Grasp]) -> str:
    """The object is not where it was.

    Args:
        reason: how that was noticed.
        grasps: of the session, in order.
    """
    touched = [contact.point_world_m for grasp in grasps for contact in grasp.contacts]
    last = next((grasp for grasp in reversed(grasps) if grasp.contacts), None)
    if last is None:
        return f"{reason}; nothing was touched. Put the object where the hand closes, or give its place (plan.start_m)"
    place_m = np.mean([contact.point_world_m for contact in last.contacts], axis=0)
    top_mm = 1e3 * max(float(place[2]) for place in touched)
    where = f"grasp {last.index + 1} last touched it, at {_place(place_m)}, up to {top_mm:.0f} mm high"
    return f"{reason}; {where}. {_STEADY}"


def _place(place_m: Array) -> str:
    return f"({1e3 * place_m[0]:.0f}, {1e3 * place_m[1]:.0f}) mm"
