"""What a hand measures while it moves a weight to and fro along x, without noise."""

from __future__ import annotations

import numpy as np

from drivers.core.contacts import FINGERS
from drivers.shadow.model.kinematics import JOINTS, forearm_T_palm_matrix, palm_T_distal_matrices
from sessions.perception.carrying.carry_record import CarrySamples

POSTURE_rad = np.where([name.endswith("J3") for name in JOINTS], 0.9, 0.2)
CENTRE_m, HEIGHT_m = np.array([0.4, -0.02]), 0.05
"""Where the weight hangs at first."""

JOINT_SIGMA_rad = float(np.radians(0.6))


class PlainTip:
    """Its readings are the wrench about the distal origin, without weight and bias."""

    drift = np.array([0.01, 0.01, 0.01, 5e-5, 5e-5, 5e-5])

    def __init__(self):
        self.wrench = np.zeros(6)

    def reading(self):
        return self.wrench

    def wrenches(self, readings, world_R_distal):
        return readings


TIPS = {finger: PlainTip() for finger in FINGERS}


def held_samples(
    pull_N: float, upward_N: float, *, tilted: float = 0.0, uneven: float = 0.0, swing: float = 0.0
) -> CarrySamples:
    """Samples of a right hand whose fingers carry a weight and drag it against a pull.

    Args:
        pull_N: against the motion.
        upward_N: of all fingers together.
        tilted: how far the hand moves along y for each metre along x.
        uneven: share of the pull that goes up and down on the way.
        swing: share of the squeeze that goes up and down.
    """
    count = 41
    aside_m = 0.005 * np.interp(np.arange(count), [0, 10, 30, 40], [0.0, 1.0, -1.0, 0.0])
    speed = np.sign(np.gradient(aside_m)) * (1 - uneven + uneven * np.sin(np.arange(count)))
    joints, forearms = np.tile(POSTURE_rad, (count, 1)), np.tile(np.eye(4), (count, 1, 1))
    forearms[:, 0, 3], forearms[:, 1, 3] = aside_m, tilted * aside_m
    frames = (forearms @ forearm_T_palm_matrix(joints, "right"))[:, None] @ palm_T_distal_matrices(joints, "right")
    readings = np.zeros((count, 5, 6))
    for n in range(count):
        place = np.array([CENTRE_m[0] + aside_m[n], CENTRE_m[1], HEIGHT_m])
        for at, finger in enumerate(FINGERS):
            squeeze = np.array([0.0, 2.0, 0.0]) if finger == "TH" else np.array([0.0, -0.5, 0.0])
            squeeze = squeeze * (1 + swing * np.sin(2 * np.pi * n / 20))
            on_tip = -(squeeze + np.array([speed[n] * pull_N, 0.0, upward_N]) / 5)
            rotation, origin = frames[n, at, :3, :3], frames[n, at, :3, 3]
            readings[n, at] = [*(rotation.T @ on_tip), *(rotation.T @ np.cross(place - origin, on_tip))]
    return CarrySamples(1e7 * np.arange(count), joints, forearms, readings)
