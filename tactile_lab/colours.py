"""Viridis: a colour map that stays readable in grey and for colour-blind eyes."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from drivers.core.contacts import Array

VIRIDIS = np.array(
    [
        *((68, 1, 84), (72, 36, 117), (65, 68, 135), (53, 95, 141), (42, 120, 142), (33, 145, 140)),
        *((34, 168, 132), (66, 190, 113), (122, 209, 81), (187, 223, 39), (253, 231, 37)),
    ],
    dtype=float,
)
"""Eleven evenly spaced colours of the map, red green blue, 0 to 255."""


SIGMA_FULL_m = 0.010
"""Standard deviation at which a surface counts as unknown: the far end of the colour map."""

UNKNOWN = np.array([150.0, 158.0, 170.0])
"""Where nothing is known: grey, red green blue."""


def viridis(share: Array) -> NDArray[np.uint8]:
    """Colours of shape (n, 3), 0 to 255, for values of shape (n,) between 0 and 1 (clipped); NaN is grey."""
    known = np.isfinite(share)
    position = np.clip(np.where(known, share, 0.0), 0.0, 1.0) * (len(VIRIDIS) - 1)
    channels = [np.interp(position, np.arange(len(VIRIDIS)), VIRIDIS[:, channel]) for channel in range(3)]
    return np.where(known[:, None], np.rint(np.column_stack(channels)), UNKNOWN).astype(np.uint8)


def hex_colour(colour: NDArray[np.uint8]) -> str:
    """A colour of shape (3,) in the form ``#rrggbb``."""
    return "#" + "".join(f"{int(channel):02x}" for channel in colour)
