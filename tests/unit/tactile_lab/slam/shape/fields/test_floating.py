"""A field that ends above the table, as a hand came no lower, goes on to it below its lowest contacts."""

from __future__ import annotations

import numpy as np
import pytest

from drivers.core.contacts import Array
from tactile_lab.slam.shape.fields.floating import standing
from tactile_lab.slam.shape.fields.gpis import Gpis
from tactile_lab.slam.shape.fields.settings import GpisSettings

HALF_m, TOP_m = 0.030, 0.090


def walls(lowest_m: float) -> Gpis:
    """A section 60 mm wide that was touched between a height and its top, by a kernel of short range."""
    heights_m = np.linspace(lowest_m, TOP_m, 14)
    sides = [np.column_stack([np.full(14, side * HALF_m), heights_m]) for side in (-1.0, 1.0)]
    normals = [np.tile([side, 0.0], (14, 1)) for side in (-1.0, 1.0)]
    return Gpis.fit(np.vstack(sides), np.vstack(normals), 0.0005, 0.05, GpisSettings(length_m=0.015))


def at(height_m: float, field: Gpis) -> Array:
    """The field across the section at a height, from wall to wall."""
    return field.mean(np.column_stack([np.linspace(-HALF_m, HALF_m, 31), np.full(31, height_m)]))


def test_a_field_that_hangs_over_the_table_goes_on_to_it_as_wide_as_its_lowest_contacts() -> None:
    hanging = walls(0.045)
    assert at(0.005, hanging).min() > 0
    found = standing(hanging, 0.0)
    for height_m in (0.0, 0.008, 0.02, 0.035):
        inside_m = np.linspace(-HALF_m, HALF_m, 31)[at(height_m, found) < 0]
        assert np.abs(inside_m).max() == pytest.approx(HALF_m - 0.002, abs=0.003)
    assert (at(0.0, found) < 0).mean() > 0.8, "its foot is closed"


def test_walls_that_lean_outward_go_on_inward() -> None:
    slope, rim_m = np.tan(np.deg2rad(25.0)), 0.060
    heights_m, across_m = np.linspace(0.045, TOP_m, 14), np.linspace(-rim_m, rim_m, 121)
    out_m = rim_m + (heights_m - TOP_m) * slope
    sides = [np.column_stack([side * out_m, heights_m]) for side in (-1.0, 1.0)]
    normals = [np.tile(np.array([side, -slope]) / np.hypot(1.0, slope), (14, 1)) for side in (-1.0, 1.0)]
    bowl = Gpis.fit(np.vstack(sides), np.vstack(normals), 0.0005, 0.05, GpisSettings(length_m=0.015))
    found = standing(bowl, 0.0)
    for height_m in (0.015, 0.03):
        is_inside = found.mean(np.column_stack([across_m, np.full(121, height_m)])) < 0
        half_m = np.abs(across_m[is_inside]).max()
        assert half_m == pytest.approx(rim_m + (height_m - TOP_m) * slope, abs=0.003)


def test_a_wall_is_no_wider_below_its_lowest_contacts() -> None:
    found = standing(walls(0.045), 0.0)
    beside = np.column_stack([np.full(5, HALF_m + 0.004), np.linspace(0.005, 0.04, 5)])
    assert found.mean(beside).min() > 0


def test_where_it_was_touched_it_stays() -> None:
    hanging = walls(0.045)
    np.testing.assert_allclose(at(0.07, standing(hanging, 0.0)), at(0.07, hanging), atol=0.0005)


def test_a_field_that_stands_already_is_not_changed() -> None:
    low = walls(0.008)
    assert standing(low, 0.0) is low
    assert standing(hanging := walls(0.045), 0.04) is hanging, "the table is just below the contacts"


def test_what_has_no_walls_is_left_as_it_is() -> None:
    angles = np.linspace(0.4, np.pi - 0.4, 9)
    out = np.column_stack([np.cos(angles), np.sin(angles)])
    cap = Gpis.fit(0.02 * out + [0.0, 0.08], out, 0.0005, 0.05, GpisSettings(length_m=0.015))
    steep = np.abs(out[:, 1]) > 0.4
    assert steep.any()
    only = Gpis.fit(cap.contacts_m[steep], cap.normals[steep], 0.0005, 0.05, GpisSettings(length_m=0.015))
    assert standing(only, 0.0) is only
