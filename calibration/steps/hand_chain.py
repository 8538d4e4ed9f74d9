"""Points of the hand in the mount's frame, and their derivatives by errors of the joint angles."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from pydantic import Field

from calibration.steps.observations import HandPose
from drivers.core.configuration import StrictModel
from drivers.core.contacts import FINGERS, Array
from drivers.positioner.kinematics import mount_T_forearm
from drivers.shadow.closing.posture import finger_joints
from drivers.shadow.model.hand_form import RIGHT_HAND, HandForm
from drivers.shadow.model.kinematics import JOINT_INDEX, JOINTS, forearm_T_palm_matrix, palm_T_distal_matrices
from drivers.shadow.protocol.palm_images import Side

WRIST = ("WRJ2", "WRJ1")
_STEP_rad = 1e-5


class HandNoise(StrictModel):
    """Errors of the measured joints of hand and positioner, one standard deviation.

    Attributes:
        joint_offset_rad: constant offset of every joint.
        joint_noise_rad: of a joint's angle in one touch or picture, after averaging.
        base_sigma_m: of the positioner's place in one touch or picture, per axis.
    """

    joint_offset_rad: float = Field(default=float(np.radians(0.6)), gt=0.0)
    joint_noise_rad: float = Field(default=float(np.radians(0.025)), ge=0.0)
    base_sigma_m: float = Field(default=1e-4, gt=0.0)


def joints_of(links: Sequence[str], form: HandForm = RIGHT_HAND) -> tuple[str, ...]:
    """Joints that a hand has between the forearm and the named links (``palm`` or a finger), the wrist first."""
    fingers = [finger for finger in FINGERS if finger in links]
    joints = (*WRIST, *(joint for finger in fingers for joint in finger_joints(finger)))
    return tuple(joint for joint in joints if joint in form.joints)


@dataclass(frozen=True, eq=False)
class LinkMotion:
    """A link in the mount's frame as a function of small joint offsets, to first order.

    Attributes:
        mount_T_link: at the offsets it was made for, homogeneous, shape (4, 4).
        derivatives: by each offset, shape (n, 4, 4).
    """

    mount_T_link: Array
    derivatives: Array

    def at(self, change_rad: Array) -> Array:
        """The link for offsets that differ by ``change_rad``, shape (n,) -> (4, 4)."""
        return np.asarray(self.mount_T_link + np.tensordot(change_rad, self.derivatives, axes=1))


def link_motion(pose: HandPose, link: str, joints: Sequence[str], offsets_rad: Array) -> LinkMotion:
    """How a link stands when the true angles are the measured ones minus the offsets.

    Args:
        pose: as measured.
        link: ``palm`` or a finger's name.
        joints: those with an offset.
        offsets_rad: their offsets, measured minus true, shape (n,), about which it is linear.
    """
    columns = [JOINT_INDEX[joint] for joint in joints]
    angles = np.array(pose.joints_rad, dtype=float)
    angles[columns] -= offsets_rad
    steps = np.zeros((2 * len(columns) + 1, len(JOINTS)))
    for row, column in enumerate(columns):
        steps[1 + 2 * row, column], steps[2 + 2 * row, column] = -_STEP_rad, _STEP_rad
    links = mount_T_forearm(pose.base_q).matrix() @ _forearm_T_link(angles + steps, link, pose.form.side)
    return LinkMotion(links[0], (links[1::2] - links[2::2]) / (2 * _STEP_rad))


def mount_T_link(pose: HandPose, link: str) -> Array:
    """A link in the mount's frame as measured, shape (4, 4)."""
    return np.asarray(
        mount_T_forearm(pose.base_q).matrix() @ _forearm_T_link(pose.joints_rad[None], link, pose.form.side)[0]
    )


def _forearm_T_link(joints_rad: Array, link: str, side: Side) -> Array:
    forearm_T_palm = forearm_T_palm_matrix(joints_rad, side)
    if link == "palm":
        return forearm_T_palm
    return np.asarray(forearm_T_palm @ palm_T_distal_matrices(joints_rad, side)[:, FINGERS.index(link)])
