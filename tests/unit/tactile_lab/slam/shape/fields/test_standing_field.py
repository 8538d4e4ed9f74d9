"""Which contacts are taken for the flat top of a field that stands on a table."""

from __future__ import annotations

import numpy as np
import pytest

from drivers.core.contacts import Array
from tactile_lab.slam.shape.fields.gpis import Gpis
from tactile_lab.slam.shape.fields.standing_field import StandingField

UP, TOP_m = np.array([0.0, 0.0, 1.0]), 0.06


def tin_with(levels_m: Array) -> StandingField:
    """Contacts on the walls of a tin, and level ones at the given places."""
    angles = 2.4 * np.arange(16)
    out = np.column_stack([np.cos(angles), np.sin(angles), 0 * angles])
    walls_m = 0.025 * out + np.linspace(0.02, 0.05, 16)[:, None] * UP
    field = Gpis.fit(np.vstack([walls_m, levels_m]), np.vstack([out, np.tile(UP, (len(levels_m), 1))]), 0.001, 0.08)
    return StandingField.fit(field, 0.0)


LID_m = np.array([[0.012, 0.0, TOP_m], [-0.012, 0.0, TOP_m], [0.0, 0.012, TOP_m], [0.0, -0.012, TOP_m]])
STEP_m = np.array([[0.03, 0.0, 0.035]])


def test_a_single_level_contact_on_a_step_does_not_hide_the_top() -> None:
    assert tin_with(np.vstack([STEP_m, LID_m])).ceiling_m == pytest.approx(TOP_m, abs=1e-4)


def test_a_step_below_other_contacts_is_no_top() -> None:
    below = LID_m - [0.0, 0.0, 0.03]
    assert tin_with(np.vstack([below, LID_m[:1]])).ceiling_m is None


def test_a_ball_touched_around_its_middle_stays_round_below() -> None:
    angles, heights_m = 2.4 * np.arange(24), np.linspace(-0.012, 0.03, 24)
    radius_m = 0.035
    out = np.sqrt(radius_m**2 - heights_m**2)
    points_m = np.column_stack([out * np.cos(angles), out * np.sin(angles), heights_m + radius_m])
    field = Gpis.fit(points_m, (points_m - radius_m * UP) / radius_m, 0.001, 0.08).optimise(max_iterations=10)
    surface = StandingField.fit(field, 0.0).mesh()
    low = surface.vertices[surface.vertices[:, 2] < 0.008]
    assert np.linalg.norm(low[:, :2], axis=1).max() < 0.026
