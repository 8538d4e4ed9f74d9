"""The upright box around contacts."""

from __future__ import annotations

import numpy as np
import pytest

from sessions.motion.probing.box_fit import fit_box, on_sides


def contacts(turn_rad: float, half_m: tuple[float, float], rng: np.random.Generator) -> tuple[np.ndarray, np.ndarray]:
    """Three contacts on each side of a turned box, with the errors of real ones."""
    points, normals = [], []
    for quarter in range(4):
        angle = turn_rad + quarter * np.pi / 2
        ahead, aside = np.array([np.cos(angle), np.sin(angle)]), np.array([-np.sin(angle), np.cos(angle)])
        depth_m, width_m = half_m[quarter % 2], half_m[1 - quarter % 2]
        for along in (-0.4, 0.1, 0.5):
            points.append([*((depth_m + 1e-3 * rng.standard_normal()) * ahead + along * width_m * aside), 0.05])
            off = angle + np.radians(6.0) * rng.standard_normal()
            normals.append([np.cos(off), np.sin(off), 0.0])
    return np.array(points) + np.array([0.02, -0.01, 0.0]), np.array(normals)


@pytest.mark.parametrize("turn_deg", [-40.0, -10.0, 0.0, 25.0, 44.0])
def test_box_is_turned_and_as_large_as_what_was_touched(turn_deg: float) -> None:
    points_m, normals = contacts(np.radians(turn_deg), (0.049, 0.022), np.random.default_rng(0))
    world_T_box, low_m, high_m = fit_box(points_m, normals)
    off_deg = (np.degrees(world_T_box.theta()) - turn_deg + 45.0) % 90.0 - 45.0
    assert abs(off_deg) < 3.0
    assert sorted(high_m - low_m) == pytest.approx([0.044, 0.098], abs=0.004)
    np.testing.assert_allclose(world_T_box.transformFrom((low_m + high_m) / 2), [0.02, -0.01], atol=3e-3)


def test_contacts_on_the_top_lie_on_no_side() -> None:
    normals = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, 1.0], [0.0, 0.8, 0.6]])
    assert on_sides(normals).tolist() == [True, False, True]
