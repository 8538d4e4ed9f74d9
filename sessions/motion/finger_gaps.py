"""Fingertips that come near one another: paths are apart while fingers move together, and cross where one leads.

With the closing ``radial`` the middle finger, opened by a quarter of its path, stands where the closed first finger is.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping

import numpy as np

from drivers.shadow.closing.closing import Closing


def nears(table: Closing, progress: Mapping[str, float], finger: str, to: float, gap_m: float) -> bool:
    """Whether a fingertip would come nearer than ``gap_m`` to another's centre, and nearer than it is now.

    Args:
        table: the closing's paths.
        progress: of all fingers on them.
        finger: the one that moves.
        to: its next progress.
        gap_m: between centres.
    """
    now_m, then_m = table.path(finger).centre_m(progress[finger]), table.path(finger).centre_m(to)
    for other in progress.keys() - {finger}:
        place_m = table.path(other).centre_m(progress[other])
        apart_m = np.linalg.norm(then_m - place_m)
        if apart_m < gap_m and apart_m < np.linalg.norm(now_m - place_m):
            return True
    return False


def is_near(table: Closing, progress: Mapping[str, float], finger: str, others: Iterable[str], gap_m: float) -> bool:
    """Whether a fingertip's centre is nearer than ``gap_m`` to that of any of the others."""
    place_m = table.path(finger).centre_m(progress[finger])
    return any(np.linalg.norm(place_m - table.path(other).centre_m(progress[other])) < gap_m for other in others)
