"""Alpha shapes around contacts."""

from __future__ import annotations

import numpy as np
import pytest

from drivers.core.errors import ShapeError
from tactile_lab.slam.shape.baselines.point_cloud import PointCloudShape


def around(points_m: np.ndarray) -> PointCloudShape:
    return PointCloudShape.of(points_m, points_m - points_m.mean(axis=0), np.full(len(points_m), 5e-4))


def test_a_ring_of_contacts_is_one_closed_outline() -> None:
    angles = np.linspace(0, 2 * np.pi, 24, endpoint=False)
    contour = around(0.05 * np.stack([np.cos(angles), np.sin(angles)], axis=1)).contour()
    assert np.ptp(np.linalg.norm(contour.points_m, axis=1)) < 0.001


def test_contacts_on_a_line_enclose_nothing() -> None:
    with pytest.raises(ShapeError, match="enclose nothing"):
        around(np.stack([np.linspace(0, 0.1, 8), np.zeros(8)], axis=1))
