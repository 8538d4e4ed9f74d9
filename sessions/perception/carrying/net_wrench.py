"""Force and moment of all fingertips on the object."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from scipy.ndimage import gaussian_filter1d

from drivers.core.contacts import FINGERS, Array
from drivers.core.fingertip import ContinuousFingertip
from drivers.shadow.model.kinematics import forearm_T_palm_matrix, palm_T_distal_matrices
from drivers.shadow.protocol.palm_images import Side
from sessions.perception.carrying.carry_record import CarrySamples

_SMOOTHING = 2.0
"""Samples."""


def upward_N(fingertips: Mapping[str, ContinuousFingertip], world_R_distal: Array) -> float:
    """Upward force of the fingertips on the object by their newest readings.

    Args:
        fingertips: by finger.
        world_R_distal: orientation of the distal frames, shape (5, 3, 3).
    """
    total_N = 0.0
    for finger, tip in fingertips.items():
        rotation = world_R_distal[FINGERS.index(finger)]
        felt = np.nan_to_num(tip.wrenches(tip.reading()[None], rotation[None]))[0]
        total_N -= float(rotation[2] @ felt[:3])
    return total_N


@dataclass(frozen=True)
class NetWrench:
    """What the fingertips do to the object at n moments, world axes.

    Attributes:
        force_N: shape (n, 3).
        moment_Nm: about the palm's origin, shape (n, 3).
        palm_m: the palm's origin, shape (n, 3).
        tips_m: origins of the fingertips' frames, shape (n, tips, 3).
    """

    force_N: Array
    moment_Nm: Array
    palm_m: Array
    tips_m: Array


def net_wrench(
    samples: CarrySamples, fingertips: Mapping[str, ContinuousFingertip], side: Side, turned_rad: Array | None = None
) -> NetWrench:
    """The wrench of all fingertips together.

    Args:
        samples: joint angles and readings; a reading that is NaN counts for nothing.
        fingertips: by finger.
        side: of the hand.
        turned_rad: added to the joint angles, shape (24,).
    """
    joints_rad = samples.joints_rad if turned_rad is None else samples.joints_rad + turned_rad
    world_T_palm = samples.world_T_forearm @ forearm_T_palm_matrix(samples.joints_rad, side)
    frames = world_T_palm[:, None] @ palm_T_distal_matrices(joints_rad, side)
    palm_m = world_T_palm[:, :3, 3]
    force_N, moment_Nm = np.zeros_like(palm_m), np.zeros_like(palm_m)
    for finger, tip in fingertips.items():
        at = FINGERS.index(finger)
        rotations = frames[:, at, :3, :3]
        felt = np.nan_to_num(tip.wrenches(samples.readings[:, at], rotations))
        force = -np.einsum("nij,nj->ni", rotations, felt[:, :3])
        force_N += force
        moment_Nm += np.cross(frames[:, at, :3, 3] - palm_m, force)
        moment_Nm -= np.einsum("nij,nj->ni", rotations, felt[:, 3:])
    tips_m = frames[..., :3, 3][:, [FINGERS.index(finger) for finger in fingertips]]
    return NetWrench(force_N, moment_Nm, palm_m, tips_m)


def tip_loads_N(samples: CarrySamples, fingertips: Mapping[str, ContinuousFingertip], side: Side) -> Array:
    """Force on each fingertip without its own weight, shape (n, 5); zero without a valid reading."""
    world_T_palm = samples.world_T_forearm @ forearm_T_palm_matrix(samples.joints_rad, side)
    rotations = world_T_palm[:, None, :3, :3] @ palm_T_distal_matrices(samples.joints_rad, side)[..., :3, :3]
    loads_N = np.zeros((len(samples.joints_rad), len(FINGERS)))
    for finger, tip in fingertips.items():
        at = FINGERS.index(finger)
        felt = np.nan_to_num(tip.wrenches(samples.readings[:, at], rotations[:, at]))
        loads_N[:, at] = np.linalg.norm(felt[:, :3], axis=1)
    return loads_N


def largest_net_N(samples: CarrySamples, fingertips: Mapping[str, ContinuousFingertip], side: Side) -> float:
    """Largest force of all fingertips together along the table, smoothed over 20 ms."""
    along_N = gaussian_filter1d(
        net_wrench(samples, fingertips, side).force_N[:, :2], _SMOOTHING, axis=0, mode="nearest"
    )
    return float(np.linalg.norm(along_N, axis=1).max())
