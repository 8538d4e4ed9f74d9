"""Forward kinematics of the Shadow Dexterous Hand, right and left.

Link origins and axes are those of Shadow's published model ``shadowhand_motor.urdf``. The lower limit of -15 deg of
the fingers' J3 and of THJ1 is the one of Shadow's manual and current xacro; the URDF stops at 0.

The palm frame of a right hand has z along the fingers, x to the thumb's side and -y out of the palm. A finger's distal
frame sits on its J1 axis with z along the fingertip. Flexion is a positive rotation about x. A left hand is the right
one mirrored in the planes x = 0 of forearm and palm: its palm has the thumb on the side of -x, and every frame is the
mirror image of the right hand's at the same angles. So joint angles, limits and calibrations mean the same on both
sides.

Every function takes joint vectors of shape (..., 24) in the order of :data:`JOINTS`, radians; the ``*_matrices``
functions work on whole batches without building pose objects.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import TypeAlias

import numpy as np
from gtsam import Pose3

from drivers.core.contacts import FINGERS, Array
from drivers.core.errors import ConfigurationError
from drivers.shadow.protocol.palm_images import Side


@dataclass(frozen=True)
class Joint:
    """One revolute joint of the hand.

    Attributes:
        name: Shadow's name, for instance ``FFJ3``.
        parent: name of the joint whose child link carries this one, or ``palm`` or ``forearm``.
        origin_m: the joint's origin in the parent link's frame, metres.
        rpy_rad: its fixed orientation there, fixed-axis roll, pitch, yaw, radians.
        axis: unit rotation axis in the joint's own frame.
        lower_deg: lower limit, degrees as the manual states it.
        upper_deg: upper limit, degrees.
    """

    name: str
    parent: str
    origin_m: tuple[float, float, float]
    rpy_rad: tuple[float, float, float]
    axis: tuple[float, float, float]
    lower_deg: float
    upper_deg: float


_X, _Y, _Y_NEGATIVE, _Z_NEGATIVE = (1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, -1.0, 0.0), (0.0, 0.0, -1.0)
_LITTLE_AXIS = (0.573576, 0.0, 0.819152)  # 55 deg from x towards z
_ALIGNED = (0.0, 0.0, 0.0)


def _long_finger(
    finger: str, knuckle_m: tuple[float, float, float], spread: tuple[float, float, float], parent: str = "palm"
) -> list[Joint]:
    return [
        Joint(f"{finger}J1", f"{finger}J2", (0.0, 0.0, 0.025), _ALIGNED, _X, 0, 90),
        Joint(f"{finger}J2", f"{finger}J3", (0.0, 0.0, 0.045), _ALIGNED, _X, 0, 90),
        Joint(f"{finger}J3", f"{finger}J4", (0.0, 0.0, 0.0), _ALIGNED, _X, -15, 90),
        Joint(f"{finger}J4", parent, knuckle_m, _ALIGNED, spread, -20, 20),
    ]


JOINT_TABLE: tuple[Joint, ...] = (
    *_long_finger("FF", (0.033, 0.0, 0.095), _Y_NEGATIVE),
    *_long_finger("MF", (0.011, 0.0, 0.099), _Y_NEGATIVE),
    *_long_finger("RF", (-0.011, 0.0, 0.095), _Y),
    *_long_finger("LF", (0.0, 0.0, 0.06579), _Y, parent="LFJ5"),
    Joint("LFJ5", "palm", (-0.033, 0.0, 0.02071), _ALIGNED, _LITTLE_AXIS, 0, 45),
    Joint("THJ1", "THJ2", (0.0, 0.0, 0.032), (0.0, 0.0, -np.pi / 2), _X, -15, 90),
    Joint("THJ2", "THJ3", (0.0, 0.0, 0.0), _ALIGNED, _Y_NEGATIVE, -40, 40),
    Joint("THJ3", "THJ4", (0.0, 0.0, 0.038), _ALIGNED, _X, -12, 12),
    Joint("THJ4", "THJ5", (0.0, 0.0, 0.0), _ALIGNED, _X, 0, 70),
    Joint("THJ5", "palm", (0.034, -0.0085, 0.029), (0.0, np.pi / 4, 0.0), _Z_NEGATIVE, -60, 60),
    Joint("WRJ1", "WRJ2", (0.0, 0.0, 0.034), _ALIGNED, _X, -40, 28),
    Joint("WRJ2", "forearm", (0.0, -0.010, 0.213), _ALIGNED, _Y, -30, 10),
)
"""The hand's joints in the order of every joint vector. The palm is the child link of WRJ1."""

JOINTS: tuple[str, ...] = tuple(joint.name for joint in JOINT_TABLE)
"""Names of the 24 joints, the order used in every joint vector."""

JOINT_INDEX: Mapping[str, int] = {name: index for index, name in enumerate(JOINTS)}
"""Position of each joint in a joint vector."""

JOINT_LIMITS_rad: Array = np.radians([[joint.lower_deg, joint.upper_deg] for joint in JOINT_TABLE])
"""Lower and upper limits, shape (24, 2), radians."""

_SIGNS = np.array([-1.0, 1.0, 1.0, 1.0])
_MIRROR: Mapping[Side, Array] = {"right": np.ones((4, 4)), "left": np.outer(_SIGNS, _SIGNS)}
"""Factors of a homogeneous matrix's entries that mirror the frame in x = 0."""

_Terms: TypeAlias = tuple[Array, Array, Array]
"""Factors of 1, sin q and cos q in a joint's transform, each (..., 4, 4)."""


def joint_vector(joints_rad: Mapping[str, float]) -> Array:
    """Named joint angles as a vector, shape (24,), radians; joints not named are zero.

    Raises:
        ConfigurationError: a name is not one of :data:`JOINTS`.
    """
    unknown = sorted(set(joints_rad) - set(JOINTS))
    if unknown:
        raise ConfigurationError(f"unknown joints {', '.join(unknown)}", hint=f"Joints are {', '.join(JOINTS)}")
    return np.array([joints_rad.get(name, 0.0) for name in JOINTS], dtype=float)


def joint_table(side: Side) -> tuple[Joint, ...]:
    """The hand's joints, :data:`JOINT_TABLE` or its mirror image: a turn about the mirrored axis goes the other way."""
    return JOINT_TABLE if side == "right" else tuple(map(_mirror_joint, JOINT_TABLE))


def _mirror_joint(joint: Joint) -> Joint:
    (x, y, z), (roll, pitch, yaw), (ax, ay, az) = joint.origin_m, joint.rpy_rad, joint.axis
    return replace(joint, origin_m=(-x, y, z), rpy_rad=(roll, -pitch, -yaw), axis=(ax, -ay, -az))


def palm_T_distal_matrices(joints_rad: Array, side: Side = "right") -> Array:
    """Distal frames of the five fingers in the palm frame.

    Args:
        joints_rad: joint angles, shape (..., 24), radians.
        side: of the hand.

    Returns:
        Homogeneous matrices, shape (..., 5, 4, 4), in the order FF, MF, RF, LF, TH, metres.
    """
    links = _parent_T_child(joints_rad)[..., _CHAINS, :, :]
    frames = links[..., 0, :, :, :]
    for number in range(1, len(_CHAINS)):
        frames = frames @ links[..., number, :, :, :]
    return np.asarray(_MIRROR[side] * frames)


def forearm_T_palm_matrix(joints_rad: Array, side: Side = "right") -> Array:
    """The palm in the forearm frame, shape (..., 4, 4), from WRJ2 and WRJ1 of joint vectors (..., 24)."""
    local = _rotate(joints_rad[..., _WRIST], _WRIST_TERMS)
    return np.asarray(_MIRROR[side] * (local[..., 0, :, :] @ local[..., 1, :, :]))


def link_T_matrices(joints_rad: Array) -> Array:
    """Every joint's child link in its parent link's frame, shape (..., 24, 4, 4), order of :data:`JOINTS`.

    Those of a right hand.
    """
    return _parent_T_child(joints_rad)[..., : len(JOINTS), :, :]


def palm_T_distal(joints_rad: Array, side: Side = "right") -> dict[str, Pose3]:
    """The distal frame of each finger in the palm frame, for one joint vector of shape (24,)."""
    frames = palm_T_distal_matrices(joints_rad, side)
    return {finger: Pose3(matrix) for finger, matrix in zip(FINGERS, frames, strict=True)}


def forearm_T_palm(joints_rad: Array, side: Side = "right") -> Pose3:
    """The palm in the forearm frame, for one joint vector of shape (24,)."""
    return Pose3(forearm_T_palm_matrix(joints_rad, side))


def _parent_T_child(joints_rad: Array) -> Array:
    """All joint transforms at once, shape (..., 25, 4, 4); the last is the identity that pads short chains."""
    padded = np.zeros((*joints_rad.shape[:-1], len(JOINTS) + 1))
    padded[..., :-1] = joints_rad
    return _rotate(padded, _TERMS)


def _rotate(angles_rad: Array, terms: _Terms) -> Array:
    """The transforms of joints at angles (..., n), from the joints' terms (n, 4, 4)."""
    constant, sine, cosine = terms
    sines, cosines = np.sin(angles_rad)[..., None, None], np.cos(angles_rad)[..., None, None]
    return np.asarray(constant + sines * sine + cosines * cosine)


def _origin_matrix(joint: Joint) -> Array:
    (cr, cp, cy), (sr, sp, sy) = np.cos(joint.rpy_rad), np.sin(joint.rpy_rad)
    matrix = np.eye(4)
    matrix[:3, :3] = [
        [cy * cp, cy * sp * sr - sy * cr, cy * sp * cr + sy * sr],
        [sy * cp, sy * sp * sr + cy * cr, sy * sp * cr - cy * sr],
        [-sp, cp * sr, cp * cr],
    ]
    matrix[:3, 3] = joint.origin_m
    return matrix


def _rodrigues_terms(joint: Joint) -> _Terms:
    """``origin * rotation(q)`` split into a constant, a factor of sin q and a factor of cos q, each (4, 4)."""
    x, y, z = np.array(joint.axis) / np.linalg.norm(joint.axis)
    cross = np.zeros((4, 4))
    cross[:3, :3] = [[0, -z, y], [z, 0, -x], [-y, x, 0]]
    squared = cross @ cross
    origin = _origin_matrix(joint)
    return origin @ (np.eye(4) + squared), origin @ cross, -origin @ squared


def _stacked_terms() -> _Terms:
    terms = [_rodrigues_terms(joint) for joint in JOINT_TABLE]
    terms.append((np.eye(4), np.zeros((4, 4)), np.zeros((4, 4))))
    constant, sine, cosine = (np.array(term) for term in zip(*terms, strict=True))
    return constant, sine, cosine


_TERMS = _stacked_terms()
_WRIST = [JOINT_INDEX["WRJ2"], JOINT_INDEX["WRJ1"]]
_WRIST_TERMS = (_TERMS[0][_WRIST], _TERMS[1][_WRIST], _TERMS[2][_WRIST])
_CHAINS = np.array(
    [[JOINT_INDEX.get(f"{finger}J{number}", len(JOINTS)) for finger in FINGERS] for number in (5, 4, 3, 2, 1)]
)
