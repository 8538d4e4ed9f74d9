"""Contact point and normal from a BioTac's electrodes.

Pressing thins the fluid over an electrode and lowers its count. Only these *squeezed* electrodes are used: the
displaced fluid raises the counts of the others, where nothing touches. On recordings with the contact normal measured
by motion capture (19 electrodes, 4030 samples) the median error of the skin normal at the point of equation 2.24 is 8
to 10 degrees with squeezed electrodes and linear weights; it is 9 to 10 degrees for the sum of the squeezed electrodes'
normals, and 21 to 27 degrees for the sum over all electrodes.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from drivers.biotac.electrodes import ElectrodeLayout
from drivers.core.contacts import Array


@dataclass(frozen=True)
class ElectrodeContact:
    """Contacts in the BioTac frame; NaN where no electrode is squeezed.

    Attributes:
        points_m: on the skin, shape (n, 3).
        normals: the skin's outward unit normals there, shape (n, 3).
        squeeze: sum of the counts by which electrodes are squeezed, shape (n,).
    """

    points_m: Array
    normals: Array
    squeeze: Array


def squeeze_counts(change: Array, noise_counts: float) -> Array:
    """How much each electrode is squeezed, counts >= 0, shape as ``change`` (reading minus tare)."""
    lowered = -np.minimum(change, 0.0)
    return np.asarray(np.where(lowered > noise_counts, lowered, 0.0))


def contact_from_electrodes(
    change: Array, layout: ElectrodeLayout, *, noise_counts: float = 0.0, power: float = 1.0
) -> ElectrodeContact:
    """Weighted mean of the squeezed electrodes' positions, projected onto the skin (eq. 2.24).

    Args:
        change: electrode readings minus their tare, counts, shape (n, electrodes).
        layout: of the same number of electrodes.
        noise_counts: smaller changes are noise.
        power: exponent of the weights; 1 is best on real recordings.
    """
    squeeze = squeeze_counts(change, noise_counts)
    weights = squeeze**power
    with np.errstate(invalid="ignore"):
        inside = weights @ layout.positions_m / weights.sum(axis=1, keepdims=True)
        points, normals = layout.skin.project(inside)
    return ElectrodeContact(points, normals, squeeze.sum(axis=1))


def force_direction(change: Array, layout: ElectrodeLayout, *, noise_counts: float = 0.0) -> Array:
    """Unit vectors (n, 3) along the sum of the squeezed electrodes' normals, each weighted by its squeeze.

    This is the direction, seen from the finger, from which the force acts; NaN where no electrode is squeezed.
    """
    pressed = squeeze_counts(change, noise_counts) @ layout.normals
    with np.errstate(invalid="ignore"):
        return np.asarray(pressed / np.linalg.norm(pressed, axis=1, keepdims=True))
