"""An outline whose contacts lie at many heights says so, and stays as complete as it is."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from drivers.core.contacts import Contact, Grasp
from tactile_lab.slam.slam_settings import SlamSettings
from tactile_lab.slam.tactile_slam import TactileSlam

QUICK = {"method": "odometry", "shape_model": "gpis", "mesh_resolution_m": 0.006}
"""Heights are told whatever follows the object and models it."""


def _grasp(number: int, heights_m: tuple[float, ...], top_m: float) -> Grasp:
    """Contacts around a disc of 30 mm radius at these heights, and one on its flat top."""
    angles = np.linspace(0.0, 2 * np.pi, len(heights_m), endpoint=False) + 0.3 * number
    sides = [
        Contact(str(at), np.array([0.03 * np.cos(a), 0.03 * np.sin(a), z]), np.array([np.cos(a), np.sin(a), 0.0]))
        for at, (a, z) in enumerate(zip(angles, heights_m, strict=True))
    ]
    top = Contact("top", np.array([0.0, 0.0, top_m]), np.array([0.0, 0.0, 1.0]))
    return Grasp(number, number, (*sides, top))


def _doubts(heights_m: tuple[float, ...], dimension: int = 2) -> dict[str, str]:
    slam = TactileSlam(SlamSettings(dimension=dimension, **QUICK), 0)
    for number in range(4):
        slam.add_grasp(_grasp(number, heights_m, top_m=0.15))
    return {doubt.name: doubt.words for doubt in slam.finish().doubts}


def test_contacts_far_apart_in_height_are_told() -> None:
    assert "34 to 106 mm above the table" in _doubts((0.034, 0.060, 0.080, 0.106, 0.050))["many-heights"]


def test_a_top_that_was_tapped_is_no_part_of_an_outline() -> None:
    assert "many-heights" not in _doubts((0.020, 0.030, 0.040, 0.030, 0.025))


def test_a_surface_has_all_heights() -> None:
    assert "many-heights" not in _doubts((0.034, 0.060, 0.080, 0.106, 0.050), dimension=3)


@pytest.mark.parametrize("broken", [np.nan, np.inf])
def test_a_grasp_that_cannot_be_read_has_no_heights(broken: float) -> None:
    slam = TactileSlam(SlamSettings(dimension=2, **QUICK), 0)
    for number in range(4):
        slam.add_grasp(_grasp(number, (0.02, 0.03, 0.04, 0.03, 0.02), top_m=0.15))
    contact = replace(_grasp(4, (0.02,), 0.15).contacts[0], point_world_m=np.array([0.03, 0.0, broken]))
    slam.add_grasp(Grasp(4, 4, (contact,)))
    assert "many-heights" not in {doubt.name for doubt in slam.finish().doubts}
