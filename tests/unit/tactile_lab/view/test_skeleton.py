"""The drawn hand: a left one is the mirror image, and a finger that is not there is not drawn."""

from __future__ import annotations

import numpy as np
from gtsam import Pose3

from drivers.core.contacts import FINGERS
from drivers.shadow.model.hand_form import RIGHT_HAND
from drivers.shadow.model.kinematics import joint_vector, palm_T_distal
from drivers.shadow.protocol.palm_images import Side
from tactile_lab.view.skeleton import bones, shown_form

BENT = joint_vector({f"{finger}J3": 0.6 for finger in FINGERS if finger != "TH"} | {"THJ4": 0.8, "THJ5": 0.5})


def frames(side: Side) -> dict[str, Pose3]:
    return palm_T_distal(BENT, side)


def test_a_left_hand_is_drawn_as_the_mirror_image() -> None:
    left, right = bones(Pose3(), frames("left")), bones(Pose3(), frames("right"))
    np.testing.assert_allclose(left, right * [-1.0, 1.0, 1.0], atol=1e-12)


def test_side_and_fingers_are_told_by_the_frames() -> None:
    assert shown_form(None, {}) == RIGHT_HAND
    assert shown_form(Pose3(), frames("right")) == RIGHT_HAND
    assert shown_form(Pose3(), frames("left")) == RIGHT_HAND.mirrored
    fewer = {finger: pose for finger, pose in frames("left").items() if finger != "LF"}
    assert shown_form(Pose3(), fewer).fingers == ("FF", "MF", "RF", "TH")
    assert len(bones(Pose3(), fewer)) == 12
