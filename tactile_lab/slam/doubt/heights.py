"""An outline from contacts at many heights: that of the object only where its sides are upright."""

from __future__ import annotations

import numpy as np

from drivers.core.contacts import LARGEST_SLOPE, Array, Grasp
from tactile_lab.slam.doubt.status import Doubt

LARGEST_SPREAD_m = 0.040
"""Of contacts that count as one outline without a word: a hand from above reaches objects of 60 mm within less."""


def side_heights_m(grasp: Grasp) -> Array:
    """World heights of the contacts that count for an outline, shape (n,); those on a flat top do not."""
    sideways = np.linalg.norm(grasp.normals_world[:, :2], axis=1)
    return np.asarray(grasp.points_world_m[sideways > LARGEST_SLOPE, 2])


def many_heights(heights_m: Array) -> list[Doubt]:
    """What to say of an outline whose contacts lie at these heights over the table, shape (n,).

    It stays as good as it is told: a box has one outline at all heights, a mug has not, and contacts do not say which.
    """
    if len(heights_m) == 0 or np.ptp(heights_m) <= LARGEST_SPREAD_m:
        return []
    low_mm, high_mm = 1e3 * heights_m.min(), 1e3 * heights_m.max()
    words = (
        f"its contacts lie {low_mm:.0f} to {high_mm:.0f} mm above the table and count as one outline: "
        "if its sides are not upright, estimate its surface (--dimension 3)"
    )
    return [Doubt("many-heights", words, grave=False)]
