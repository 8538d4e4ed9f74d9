"""The axis of a solid of revolution, where contacts tell none."""

from __future__ import annotations

import numpy as np
import pytest

from drivers.core.errors import ShapeError
from tactile_lab.slam.shape.solids.axis import find_axis
from tactile_lab.slam.shape.solids.planes import WeightedContacts


def test_two_opposite_faces_determine_no_axis() -> None:
    y, z = np.meshgrid(np.linspace(-0.02, 0.02, 5), [0.01, 0.03])
    points_m = np.vstack([np.column_stack([np.full(10, x), y.ravel(), z.ravel()]) for x in (-0.03, 0.03)])
    normals = np.repeat([[-1.0, 0.0, 0.0], [1.0, 0.0, 0.0]], 10, axis=0)
    contacts = WeightedContacts(points_m, normals, np.full(20, 1e6), np.full(20, 10.0))
    with pytest.raises(ShapeError, match="determine no axis"):
        find_axis(contacts)
