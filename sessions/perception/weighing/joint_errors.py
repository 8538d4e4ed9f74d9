"""Constant errors of the joint angles, by what the weight of a hanging object seems to change with the squeeze.

A fingertip that is taken to be turned by a small angle turns its force, and the sum of all forces is wrong by angle
times force. The object's weight stays while the fingers press more and less: what goes along with their forces is such
an error.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from drivers.core.contacts import Array
from drivers.core.fingertip import ContinuousFingertip
from drivers.shadow.model.kinematics import JOINTS
from drivers.shadow.protocol.palm_images import Side
from sessions.perception.carrying.carry_record import CarrySamples
from sessions.perception.carrying.net_wrench import NetWrench, net_wrench

STEP_rad = 1e-3
"""Of each joint, for derivatives."""

_UNEXPLAINED_N = 0.035
"""What the upward force varies by in one sample of 10 ms for other reasons: noise (0.01 N in 50 ms), and creep, which
lasts so much longer than a sample that the samples together tell less than their number (decision 147).
"""


@dataclass(frozen=True)
class JointErrors:
    """What is to be added to the joint angles, and how well that is known.

    Attributes:
        turned_rad: shape (24,).
        covariance: square radians, shape (24, 24).
    """

    turned_rad: Array
    covariance: Array


def joint_errors(felt: NetWrench, turned: Sequence[NetWrench], sigma_rad: float) -> JointErrors:
    """The likeliest errors if nothing but the fingertips holds the object; without a change of the squeeze, none.

    Args:
        felt: by the joint angles as they were measured, while it hung.
        turned: the same, of :func:`turned_wrenches`.
        sigma_rad: standard deviation of each joint's error beforehand.
    """
    upward_N = felt.force_N[:, 2]
    # steady weight and slow drift of the sensors say nothing
    by_joint = _without_trend(np.array([each.force_N[:, 2] - upward_N for each in turned]) / STEP_rad)
    information = np.eye(len(turned)) / sigma_rad**2 + by_joint @ by_joint.T / _UNEXPLAINED_N**2
    covariance: Array = np.asarray(np.linalg.inv(information), dtype=float)
    return JointErrors(-covariance @ by_joint @ _without_trend(upward_N) / _UNEXPLAINED_N**2, covariance)


def _without_trend(values: Array) -> Array:
    """Series in the last axis, without their mean and their linear trend."""
    line = np.linalg.qr(np.vander(np.arange(values.shape[-1], dtype=float), 2))[0]
    return np.asarray(values - values @ line @ line.T)


def turned_wrenches(
    samples: CarrySamples, fingertips: Mapping[str, ContinuousFingertip], side: Side
) -> list[NetWrench]:
    """The wrench of all fingertips if one joint after the other was turned on by :data:`STEP_rad`; 24 of them."""
    return [net_wrench(samples, fingertips, side, step) for step in np.eye(len(JOINTS)) * STEP_rad]
