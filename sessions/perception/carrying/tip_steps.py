"""How the fingertips' material moves at its contacts with the object, step by step.

A step spans :data:`STEP_SAMPLES` samples. The contact of a fingertip is felt at its beginning; the *material* point of
the fingertip that is there moves with the finger until its end. Determining it again for each step is correct for
rolling. Contacts are expressed in the middle of the step, so that a turn of the hand leaves no error of second order.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import gaussian_filter1d

from drivers.core.clock import NANOSECONDS
from drivers.core.contacts import FINGERS, LARGEST_SLOPE, Array
from drivers.core.fingertip import ContinuousFingertip
from drivers.shadow.model.kinematics import forearm_T_palm_matrix, palm_T_distal_matrices
from drivers.shadow.protocol.palm_images import Side
from sessions.perception.carrying.carry_record import CarrySamples, SAMPLE_ns

STEP_SAMPLES = 2
_JOINT_SMOOTHING_s = 0.040
"""Longer smears the beginning and the end of a motion (140 ms: twice the error); shorter leaves the sensors' noise."""
_READING_SMOOTHING_s = 0.020
_SLACK_N = 0.1
"""Below this force a fingertip sinks in in proportion to it."""


@dataclass(frozen=True)
class TipSteps:
    """The contacts in n steps, world frame; fingers in the order of :data:`FINGERS`.

    Attributes:
        points_m: contact points in the middle of each step, shape (n, 5, 3).
        normals: unit normals out of the object, shape (n, 5, 3).
        moves_m: motion of the fingertip's material at the contact, shape (n, 5, 3).
        forces_N: normal forces, shape (n, 5); zero without an informative contact.
        sinking: how much deeper each fingertip sinks in, in units of its give (:func:`_sinking`), shape (n, 5).
        tangential_N: forces along the surface, shape (n, 5); zero likewise.
        net_forces_N: force of all fingertips on the object, shape (n, 3).
        is_void: fingertips without a valid reading, shape (n, 5).
        world_T_palm: at the beginning of each step and at the end of the last, shape (n + 1, 4, 4).
        step_s: length of a step, shape (n,).
    """

    points_m: Array
    normals: Array
    moves_m: Array
    forces_N: Array
    sinking: Array
    tangential_N: Array
    net_forces_N: Array
    is_void: NDArray[np.bool_]
    world_T_palm: Array
    step_s: Array

    def __len__(self) -> int:
        return len(self.points_m)

    @property
    def felt(self) -> NDArray[np.bool_]:
        """Which fingers have a contact, shape (n, 5)."""
        return np.asarray(self.forces_N > 0.0)


def tip_steps(samples: CarrySamples, fingertips: Mapping[str, ContinuousFingertip], side: Side) -> TipSteps:
    """The steps of a carry, from its samples."""
    joints_rad = _smooth(samples.joints_rad, _JOINT_SMOOTHING_s)
    world_T_palm = samples.world_T_forearm @ forearm_T_palm_matrix(joints_rad, side)
    world_T_distal = world_T_palm[:, None] @ palm_T_distal_matrices(joints_rad, side)
    chosen = np.arange(0, len(joints_rad), STEP_SAMPLES)
    frames, readings = world_T_distal[chosen], _smooth_known(samples.readings)[chosen[:-1]]
    shape = (len(chosen) - 1, len(FINGERS))
    points_m, normals, moves_m = (np.zeros((*shape, 3)) for _ in range(3))
    forces_N, tangential_N, is_void = np.zeros(shape), np.zeros(shape), np.ones(shape, dtype=bool)
    net_forces_N = np.zeros((shape[0], 3))
    for finger, tip in fingertips.items():
        at = FINGERS.index(finger)
        before, after = frames[:-1, at], frames[1:, at]
        touches = tip.touches(readings[:, at], before[:, :3, :3])
        starts, ends = (_transform(each, touches.points_distal_m) for each in (before, after))
        points_m[:, at], moves_m[:, at] = (starts + ends) / 2, ends - starts
        normals[:, at] = _middle_normals(before, after, touches.normals_distal)
        steep = np.linalg.norm(normals[:, at, :2], axis=-1) > LARGEST_SLOPE
        forces_N[:, at] = np.where(touches.is_certain & steep, np.maximum(touches.normal_forces_N, 0.0), 0.0)
        along_N = np.sum(touches.forces_distal_N**2, axis=-1) - touches.normal_forces_N**2
        tangential_N[:, at] = np.where(forces_N[:, at] > 0.0, np.sqrt(np.maximum(along_N, 0.0)), 0.0)
        net_forces_N -= np.einsum("nij,nj->ni", before[:, :3, :3], touches.forces_distal_N)
        is_void[:, at] = touches.is_void
    seconds = np.diff(samples.stamps_ns[chosen]) / NANOSECONDS
    return TipSteps(
        points_m=points_m,
        normals=normals,
        moves_m=moves_m,
        forces_N=forces_N,
        sinking=_sinking(forces_N),
        tangential_N=tangential_N,
        net_forces_N=net_forces_N,
        is_void=is_void,
        world_T_palm=world_T_palm[chosen],
        step_s=seconds,
    )


def _sinking(forces_N: Array) -> Array:
    """Logarithm of the factor by which each normal force grows until the next step; zero where a contact comes or goes.

    A round fingertip gets stiffer the more it is pressed: doubling a small force makes it sink in about as far as
    doubling a large one.
    """
    later_N = np.vstack([forces_N[1:], forces_N[-1:]])
    grown = np.log((later_N + _SLACK_N) / (forces_N + _SLACK_N))
    return np.asarray(np.where((forces_N > 0.0) & (later_N > 0.0), grown, 0.0))


def _transform(frames: Array, points: Array) -> Array:
    return np.asarray(np.einsum("nij,nj->ni", frames[:, :3, :3], points) + frames[:, :3, 3])


def _middle_normals(before: Array, after: Array, normals_distal: Array) -> Array:
    """Normals turned by half of the step, unit length; zero where there is none."""
    turned = np.einsum("nij,nj->ni", before[:, :3, :3] + after[:, :3, :3], normals_distal)
    return np.asarray(turned / np.maximum(np.linalg.norm(turned, axis=-1, keepdims=True), 1e-12))


def _smooth(values: Array, seconds: float) -> Array:
    return np.asarray(gaussian_filter1d(values, seconds * NANOSECONDS / SAMPLE_ns, axis=0, mode="nearest"))


def _smooth_known(readings: Array) -> Array:
    """Readings smoothed over valid ones only; what is void stays so."""
    void = np.isnan(readings)
    if not void.any():
        return _smooth(readings, _READING_SMOOTHING_s)
    weights = _smooth((~void).astype(float), _READING_SMOOTHING_s)
    smooth = _smooth(np.where(void, 0.0, readings), _READING_SMOOTHING_s) / np.maximum(weights, 1e-12)
    return np.asarray(np.where(void, np.nan, smooth))
