"""Half sections of straight and round sides: sharp where the object is, refused where they lead nowhere."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from drivers.core.contacts import Array
from drivers.core.errors import ShapeError
from tactile_lab.experiments.data.household import turned
from tactile_lab.slam.shape.metrics.metrics import mesh_errors
from tactile_lab.slam.shape.planar.segmentation import PlanarContacts
from tactile_lab.slam.shape.planar.sided_section import SidedSection
from tactile_lab.slam.shape.solids.turned import Turned
from tests.support.shape_examples import NORMAL_SIGMA_rad, POINT_SIGMA_m
from tests.support.solid_examples import field_on

BEAKER_m = np.array([[0.0, 0.0], [0.03, 0.0], [0.045, 0.08], [0.0, 0.08]])
"""Half the section of a beaker that widens upward, from the axis on the table."""


def felt(line_m: Array, count: int, seed: int, *, low_m: float = 0.015) -> PlanarContacts:
    """Contacts on a line from the second point on, spread evenly, none lower than a fingertip gets."""
    rng, pieces = np.random.default_rng(seed), line_m[1:]
    steps = np.diff(pieces, axis=0)
    lengths = np.linalg.norm(steps, axis=1)
    which = rng.choice(len(steps), 4 * count, p=lengths / lengths.sum())
    points_m = pieces[which] + rng.random(4 * count)[:, None] * steps[which]
    normals = np.column_stack([steps[which, 1], -steps[which, 0]]) / lengths[which, None]
    kept = np.flatnonzero(points_m[:, 1] > low_m)[:count]
    angles = np.arctan2(normals[kept, 1], normals[kept, 0]) + NORMAL_SIGMA_rad * rng.standard_normal(len(kept))
    off_m = POINT_SIGMA_m * rng.standard_normal(len(kept))[:, None] * normals[kept]
    facing = np.column_stack([np.cos(angles), np.sin(angles)])
    return PlanarContacts.of(points_m[kept] + off_m, facing, POINT_SIGMA_m, NORMAL_SIGMA_rad)


@pytest.mark.parametrize("seed", range(3))
def test_a_beaker_has_a_straight_wall_down_to_the_table_and_a_sharp_rim(seed: int) -> None:
    section = SidedSection.of(felt(BEAKER_m, 60, seed), BEAKER_m, 0.0)
    assert [side.is_round for side in section.sides] == [False, False]
    assert section.joints_m == pytest.approx(np.array([[0.03, 0.0], [0.045, 0.08], [0.0, 0.08]]), abs=1.2e-3)


@given(st.floats(-0.35, 0.6), st.floats(0.02, 0.05), st.integers(0, 99))
@settings(max_examples=25, deadline=None)
def test_the_section_is_one_region_from_the_axis_on_the_table_to_the_axis_above(
    lean: float, foot_m: float, seed: int
) -> None:
    line_m = np.array([[0.0, 0.0], [foot_m, 0.0], [foot_m + 0.05 * lean, 0.05], [0.0, 0.05]])
    found = SidedSection.of(felt(line_m, 50, seed), line_m, 0.0).contour()
    assert found.points_m[0] == pytest.approx([0.0, 0.0], abs=1e-9)
    assert found.points_m[-1, 0] == 0.0
    assert found.points_m.min() > -1e-9
    assert np.all(found.sigma_m > 0)
    below = (found.points_m[:, 1] < 0.002) & (found.points_m[:, 0] > 0.01)
    middle = np.abs(found.points_m[:, 1] - 0.03) < 0.003
    assert found.sigma_m[below].min() > found.sigma_m[middle].max()


def test_the_inside_of_a_rim_is_left_to_what_is_hollow() -> None:
    """The line goes level to the axis at the rim's height."""
    outer = felt(BEAKER_m[:3], 40, 1)
    edge_m = np.column_stack([np.linspace(0.0405, 0.042, 5), np.linspace(0.072, 0.0795, 5)])
    normals = np.tile([-0.97, 0.24], (5, 1)) / np.hypot(0.97, 0.24)
    points_m = np.vstack([outer.points_m, edge_m])
    contacts = PlanarContacts.of(points_m, np.vstack([outer.normals, normals]), POINT_SIGMA_m, NORMAL_SIGMA_rad)
    line_m = np.vstack([BEAKER_m[:3], [[0.042, 0.08], [0.0405, 0.072], [0.0, 0.072]]])
    section = SidedSection.of(contacts, line_m, 0.0)
    assert len(section.sides) == 1
    assert section.joints_m[-1] == pytest.approx([0.045, 0.0795], abs=1.5e-3)
    assert section.contour().points_m[-1] == pytest.approx([0.0, 0.0795], abs=1.5e-3)


@pytest.mark.parametrize(
    ("line_m", "problem"),
    [
        ([[0.0, 0.0], [0.03, 0.0], [0.045, 0.08]], "top was not touched"),
        ([[0.0, 0.06], [0.03, 0.06], [0.0, 0.075]], "does not meet the table"),
    ],
)
def test_what_leads_nowhere_is_refused(line_m: list[list[float]], problem: str) -> None:
    line = np.array(line_m)
    with pytest.raises(ShapeError, match=problem):
        SidedSection.of(felt(line, 40, 2), np.vstack([line, [[0.0, line[-1, 1]]]]), 0.0)


def test_a_beaker_gets_sides_and_a_pear_keeps_its_smooth_profile() -> None:
    beaker = turned([0, 30, 45, 0], [0, 0, 80, 80])
    sharp = Turned.fit(field_on(beaker, 110, seed=2), 0.0)
    assert sharp.sides is not None
    assert mesh_errors(sharp.mesh(), beaker).hausdorff_m < 0.0025
    heights = np.linspace(0.0, 80.0, 60)
    radii = 26 + 9 * np.cos(np.pi * heights / 80) + 3 * np.sin(heights / 9)
    pear = turned([0, *(radii * np.sqrt(np.clip(1 - (heights / 80) ** 8, 0, 1)))], [0, *heights])
    assert Turned.fit(field_on(pear, 140, seed=2), 0.0).sides is None


def test_sides_that_fill_where_fingers_went_are_not_taken() -> None:
    """Straight down to the table, where a finger went below the lowest contact."""
    field = field_on(turned([0, 30, 45, 0], [0, 0, 80, 80]), 110, seed=2)
    angles = np.linspace(0.0, 2 * np.pi, 12)
    below_m = np.column_stack([0.022 * np.cos(angles), 0.022 * np.sin(angles), np.full(12, 0.012)])
    assert Turned.fit(field, 0.0, below_m).sides is None
    beside_m = below_m * [2.2, 2.2, 1.0]
    assert Turned.fit(field, 0.0, beside_m).sides is not None
