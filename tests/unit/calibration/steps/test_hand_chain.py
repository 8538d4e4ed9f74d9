"""Links of the hand in the mount's frame, for joints that are not quite where they are read."""

from __future__ import annotations

import numpy as np
import pytest

from calibration.steps.hand_chain import link_motion, mount_T_link
from calibration.steps.observations import HandPose
from drivers.positioner.kinematics import mount_T_forearm
from drivers.shadow.model.kinematics import JOINT_INDEX, forearm_T_palm_matrix, joint_vector

BASE_q = np.array([0.1, -0.2, 0.3, 0.2, -0.1, 0.4])
BENT = joint_vector({"WRJ1": 0.2, "WRJ2": -0.1, "FFJ3": 0.5, "FFJ2": 0.4, "FFJ1": 0.2})
POSE = HandPose(BASE_q, BENT)
JOINTS = ("WRJ2", "FFJ3")


def moved(offsets_rad: np.ndarray) -> HandPose:
    """The pose whose true angles are the read ones minus the offsets."""
    joints = np.array(BENT)
    joints[[JOINT_INDEX[joint] for joint in JOINTS]] -= offsets_rad
    return HandPose(BASE_q, joints)


def test_the_palm_hangs_at_the_wrist_and_a_finger_at_the_palm() -> None:
    palm = mount_T_forearm(BASE_q).matrix() @ forearm_T_palm_matrix(BENT, "right")
    np.testing.assert_allclose(mount_T_link(POSE, "palm"), palm, atol=1e-12)
    assert not np.allclose(mount_T_link(POSE, "FF"), palm)


@pytest.mark.parametrize("link", ["palm", "FF"])
def test_offsets_turn_the_true_angles_back(link: str) -> None:
    offsets = np.array([0.03, -0.02])
    motion = link_motion(POSE, link, JOINTS, offsets)
    np.testing.assert_allclose(motion.mount_T_link, mount_T_link(moved(offsets), link), atol=1e-12)
    change = np.array([1e-4, 2e-4])
    np.testing.assert_allclose(motion.at(change), mount_T_link(moved(offsets + change), link), atol=2e-8)
    assert motion.derivatives.shape == (2, 4, 4)
    assert np.abs(motion.derivatives[1]).max() > 0.9 if link == "FF" else not motion.derivatives[1].any()
