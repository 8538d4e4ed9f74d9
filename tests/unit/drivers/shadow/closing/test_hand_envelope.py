"""The open hand as balls: nothing of it sticks out of them, and its lowest point is where it is."""

from __future__ import annotations

import numpy as np
import pytest

from drivers.core.contacts import FINGERS
from drivers.shadow.closing.closing import SIDEWAYS, closing
from drivers.shadow.closing.hand_envelope import open_hand
from drivers.shadow.closing.posture import HandShape

TIP = HandShape()


@pytest.mark.parametrize("name", ["pinch", *sorted(SIDEWAYS)])
def test_fingertips_palm_and_forearm_lie_in_the_balls(name: str) -> None:
    table, hand = closing(name, 0.06, TIP), open_hand(name, 0.06, TIP)
    palm = table.grasp_T_palm
    places = [table.path(finger).centre_m(table.path(finger).valid[0]) for finger in FINGERS]
    places += [palm.transformFrom(np.array([0.0, 0.0, z_m])) for z_m in (0.04, -0.10, -0.20)]  # palm, wrist, forearm
    for place in places:
        assert (np.linalg.norm(hand.centres_m - place, axis=1) - hand.radii_m).min() < 0.0


def test_a_hand_from_above_hangs_on_its_fingertips_and_one_from_the_right_lies_on_its_forearm() -> None:
    assert open_hand("pinch", 0.06, TIP).lowest_m == pytest.approx(0.06 - max(TIP.semi_axes_m), abs=2e-3)
    assert open_hand("pinch-from-left", 0.018, TIP).lowest_m >= 0.004
    assert open_hand("pinch-from-right", 0.030, TIP).lowest_m >= 0.004
    assert open_hand("pinch-from-right", 0.020, TIP).lowest_m < 0.0
