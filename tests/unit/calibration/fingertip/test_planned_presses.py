"""Presses for a fingertip's calibration: on the table's top, rolled to both sides, with a small and a large lean."""

from __future__ import annotations

import numpy as np
import pytest

from calibration.fingertip.plan import LEANS_rad, PlannedFree, ROLLED_rad, plan_wrenches
from drivers.shadow.closing.posture import TipEllipsoid

PLAN = plan_wrenches("MF", 8)
PRESSES = [planned for planned in PLAN if not isinstance(planned, PlannedFree)]
TIP = TipEllipsoid()


def test_each_press_puts_the_lowest_point_of_the_tip_onto_the_top() -> None:
    assert len(PRESSES) == 8
    for planned in PRESSES:
        pose = planned.world_T_distal(TIP)
        downward = -pose.rotation().matrix()[2]
        axes = np.array(TIP.semi_axes_m)
        lowest = np.array(TIP.centre_distal_m) + axes**2 * downward / np.linalg.norm(axes * downward)
        assert pose.transformFrom(lowest)[2] == pytest.approx(0.0, abs=1e-9)


def test_presses_go_to_both_sides_and_lean_more_on_the_way_back() -> None:
    ups = np.array([planned.world_R_distal[2] for planned in PRESSES])
    leans = np.arcsin(np.abs(ups[:, 2]))
    assert leans.min() < leans.max()
    sideways = np.array([planned.world_R_distal for planned in PRESSES])
    turns = np.array([np.arccos(np.clip((np.trace(a.T @ b) - 1) / 2, -1, 1)) for a in sideways for b in sideways])
    assert turns.max() >= 1.5 * ROLLED_rad
    assert len(set(LEANS_rad)) == 2
