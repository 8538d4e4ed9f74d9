"""Small moves of single fingertips away from a tabulated posture: which motors, how far for a metre.

First order: good to a tenth for moves of some millimetres.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from drivers.core.contacts import FINGERS, Array
from drivers.shadow.closing.closing import Closing
from drivers.shadow.closing.posture import HandShape
from drivers.shadow.model.kinematics import joint_vector, palm_T_distal_matrices
from drivers.shadow.protocol.palm_images import Side

_STEP_rad = 1e-4
_DAMPING_m = 0.004
"""Of the least squares, in metres for a radian: no motor runs away where a fingertip can hardly be moved."""

_FASTEST_rad_m = 70.0
"""A fingertip that needs more than that is moved across its own finger: first order holds for no distance at all."""

_FREE = ("J0", "J3", "J4")
_FREE_THUMB = ("J1", "J2", "J4", "J5")
_SHARE_J1 = 0.375  # of the coupled tendon's travel, as the postures have it (J1 = 0.6 J2)


def motor_rates(
    table: Closing, progress: Mapping[str, float], direction_grasp: Array, hand: HandShape
) -> dict[str, dict[str, float]]:
    """How the motors of each finger turn when its tip's centre moves along one direction, radians a metre.

    None turn for a fingertip that can hardly be moved that way (the thumb up and down).

    Args:
        table: the closing whose posture the hand has taken up.
        progress: of each finger on its line.
        direction_grasp: unit vector in the grasp frame, shape (3,).
        hand: that has it.
    """
    angles = {name: a for finger in table.fingers for name, a in table.angles_rad(finger, progress[finger]).items()}
    direction_palm = table.grasp_T_palm.rotation().matrix().T @ direction_grasp
    centre_m = np.append(np.array(hand.centre_distal_m), 1.0)
    side = hand.form.side
    return {finger: _rates(finger, angles, direction_palm, centre_m, side) for finger in table.fingers}


def _rates(
    finger: str, angles: Mapping[str, float], direction_palm: Array, centre_m: Array, side: Side
) -> dict[str, float]:
    motors = [f"{finger}{joint}" for joint in (_FREE_THUMB if finger == "TH" else _FREE)]
    turned = [angles, *(_turn(angles, motor) for motor in motors)]
    frames = palm_T_distal_matrices(np.array([joint_vector(each) for each in turned]), side)
    centres_m = (frames[:, FINGERS.index(finger)] @ centre_m)[:, :3]
    jacobian = (centres_m[1:] - centres_m[0]).T / _STEP_rad
    damped = jacobian @ jacobian.T + _DAMPING_m**2 * np.eye(3)
    rates = jacobian.T @ np.linalg.solve(damped, direction_palm)
    if np.linalg.norm(rates) > _FASTEST_rad_m:
        return {}
    return dict(zip(motors, rates.tolist(), strict=True))


def _turn(angles: Mapping[str, float], motor: str) -> dict[str, float]:
    """The angles with one motor a step on; the coupled pair shares the step."""
    finger, joint = motor[:2], motor[2:]
    shares = {f"{finger}J1": _SHARE_J1, f"{finger}J2": 1.0 - _SHARE_J1} if joint == "J0" else {motor: 1.0}
    return {name: angle + _STEP_rad * shares.get(name, 0.0) for name, angle in angles.items()}
