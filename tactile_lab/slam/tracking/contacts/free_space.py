"""Free space as evidence about poses and shape: there is no object where fingers were.

Points before the end of every approach path are outside of the object, and all of the line where a finger met
nothing. Without approach paths only the fingertip itself, outward along the normal, is known to be free.
"""

from __future__ import annotations

import numpy as np
from scipy.special import log_ndtr

from drivers.core.contacts import ApproachPath, Array
from tactile_lab.slam.shape.fields.gpis import Gpis

BEFORE_CONTACT_m = np.array([0.004, 0.010, 0.020, 0.035])
"""Places on an approach path before its contact."""

ALONG_NORMAL_m = np.array([0.004, 0.008, 0.012, 0.016])
"""Places in the fingertip itself, if the approach paths are unknown."""

_SPACING_m = 0.010
"""Of places on the line of a finger that met nothing."""

_CLEARANCE_m = 0.004
"""The end of such a line is where a fingertip's surface was: this far before it, space is certainly free."""

_TOLERANCE_m = 0.001
_WEIGHT = 0.5
"""Places on one line are correlated, so each counts half."""


def places_on_line(line: ApproachPath) -> Array:
    """Places on an approach path that are certainly free, world frame, shape (q, 3)."""
    back = line.start_world_m - line.end_world_m
    length = float(np.linalg.norm(back))
    if length < _CLEARANCE_m:
        return np.empty((0, 3))
    distances = BEFORE_CONTACT_m if line.touched else np.arange(_CLEARANCE_m, length, _SPACING_m)
    return np.asarray(line.end_world_m + distances[distances <= length][:, None] * back / length)


def fingertip_places(point_m: Array, normal: Array) -> Array:
    """Places inside the fingertip that touches a contact, shape (q, d)."""
    return np.asarray(point_m + ALONG_NORMAL_m[:, None] * normal)


def free_space_costs(gpis: Gpis, free_object_m: Array) -> Array:
    """Negative log probability that places are outside of the shape.

    Args:
        gpis: the shape.
        free_object_m: places for each of n poses, object frame, shape (n, q, d).

    Returns:
        Shape (n,).
    """
    count, each, dimension = free_object_m.shape
    places = free_object_m.reshape(-1, dimension)
    sigma = np.sqrt(gpis.variance(places, rough=True) + _TOLERANCE_m**2)
    surely = log_ndtr((gpis.mean(places) + _TOLERANCE_m) / sigma)
    return np.asarray(-_WEIGHT * surely.reshape(count, each).sum(axis=1))
