"""How the fingertips' material moves at its contacts with the object, step by step.

A step spans :data:`STEP_SAMPLES` samples. The contact of a fingertip is felt at its beginning; the *material* point of
the fingertip that is there moves with the finger until its end. Determining it again for each step is correct for
rolling. Contacts are expressed in the middle of the step, so that a turn of the hand leaves no error of second order.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, fields
from functools import cached_property, partial

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import gaussian_filter1d

from drivers.core.clock import NANOSECONDS
from drivers.core.contacts import FINGERS, LARGEST_SLOPE, Array
from drivers.core.fingertip import ContinuousFingertip, TipTouches
from drivers.force.force_fingertip import ForceTip
from drivers.force.touches import TipSensing
from drivers.shadow.model.kinematics import forearm_T_palm_matrix, palm_T_distal_matrices
from drivers.shadow.protocol.palm_images import Side
from sessions.perception.carrying.carry_record import CarrySamples, SAMPLE_ns
from sessions.perception.carrying.planar_motions import planar_matrices

STEP_SAMPLES = 2
HELD_BY, RAISED_m = 2, 0.001
"""So many fingertips hold an object; a hand that is higher than where it grasped by so much has lifted it."""
_JOINT_SMOOTHING_s = 0.040
"""Longer smears the beginning and the end of a motion (140 ms: twice the error); shorter leaves the sensors' noise."""
_READING_SMOOTHING_s = 0.020
_FREE_N = 0.15
"""A fingertip that touches nothing reads no more: its own weight, and noise."""
_SLACK_N = 0.1
"""Below this force a fingertip sinks in in proportion to it."""


@dataclass(frozen=True)
class TipSteps:
    """The contacts in n steps, world frame; fingers in the order of :data:`FINGERS`.

    Attributes:
        points_m: contact points in the middle of each step, shape (n, 5, 3).
        normals: unit normals out of the object, shape (n, 5, 3).
        moves_m: motion of the fingertip's material at the contact, without one of its frame, shape (n, 5, 3).
        forces_N: normal forces, shape (n, 5); zero without an informative contact.
        sinking: how much deeper each fingertip sinks in, in units of its give (:func:`_sinking`), shape (n, 5).
        tangential_N: forces along the surface, shape (n, 5); zero likewise.
        net_forces_N: force of all fingertips on the object, shape (n, 3).
        moments_Nm: their vertical moment about the middle of the contacts, shape (n,).
        levers_m: mean distance of the contacts from there, weighted with their normal forces, shape (n,).
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
    moments_Nm: Array
    levers_m: Array
    is_void: NDArray[np.bool_]
    world_T_palm: Array
    step_s: Array

    def __len__(self) -> int:
        return len(self.points_m)

    @property
    def felt(self) -> NDArray[np.bool_]:
        """Which fingers have a contact, shape (n, 5)."""
        return np.asarray(self.forces_N > 0.0)

    @property
    def pushed_N(self) -> Array:
        """Horizontal force of all fingertips on the object, shape (n,)."""
        return np.asarray(np.hypot(self.net_forces_N[:, 0], self.net_forces_N[:, 1]))

    @cached_property
    def palm_moves(self) -> Array:
        """The palm's motion on the table in each step, homogeneous matrices, shape (n, 3, 3)."""
        return planar_matrices(self.world_T_palm)

    @cached_property
    def palm_turns_rad(self) -> Array:
        """How far it turned in each step, without sign, shape (n,)."""
        return np.abs(np.arctan2(self.palm_moves[:, 1, 0], self.palm_moves[:, 0, 0]))


def tip_steps(samples: CarrySamples, fingertips: Mapping[str, ContinuousFingertip], side: Side) -> TipSteps:
    """The steps of a carry, from its samples."""
    chosen = np.arange(0, len(samples.joints_rad), STEP_SAMPLES)
    held = _is_held(samples)
    cuts = np.flatnonzero(np.diff(held)) + 1
    joints_rad = _smooth_between(cuts, samples.joints_rad, partial(_smooth, seconds=_JOINT_SMOOTHING_s))[chosen]
    readings = _smooth_between(cuts, samples.readings, _smooth_known)[chosen[:-1]]
    world_T_palm = samples.world_T_forearm[chosen] @ forearm_T_palm_matrix(joints_rad, side)
    frames = world_T_palm[:, None] @ palm_T_distal_matrices(joints_rad, side)
    felt = _felt(readings, frames[:-1, ..., :3, :3], fingertips)
    before, after = frames[:-1], frames[1:]
    starts, ends = (_transform(each, felt.points_distal_m) for each in (before, after))
    normals = _middle_normals(before, after, felt.normals_distal)
    steep = normals[..., 0] ** 2 + normals[..., 1] ** 2 > LARGEST_SLOPE**2
    touching = felt.is_certain & steep & (held[chosen[:-1]] == held[chosen[1:]])[:, None]
    forces_N = np.where(touching, np.maximum(felt.normal_forces_N, 0.0), 0.0)
    pushes_N = -(before[..., :3, :3] @ felt.forces_distal_N[..., None])[..., 0]
    moments_Nm, levers_m = _moments(starts, pushes_N, forces_N)
    along_N = np.sum(felt.forces_distal_N**2, axis=-1) - felt.normal_forces_N**2
    return TipSteps(
        points_m=(starts + ends) / 2,
        normals=normals,
        moves_m=ends - starts,
        forces_N=forces_N,
        sinking=_sinking(forces_N),
        tangential_N=np.where(forces_N > 0.0, np.sqrt(np.maximum(along_N, 0.0)), 0.0),
        net_forces_N=pushes_N.sum(axis=1),
        moments_Nm=moments_Nm,
        levers_m=levers_m,
        is_void=felt.is_void,
        world_T_palm=world_T_palm,
        step_s=np.diff(samples.stamps_ns[chosen]) / NANOSECONDS,
    )


def _felt(readings: Array, world_R_distal: Array, fingertips: Mapping[str, ContinuousFingertip]) -> TipTouches:
    """What all five felt, with (n, 5) in front of their shapes; a finger without such a fingertip is void."""
    shape = readings.shape[:2]
    points_m, normals, forces_N = (np.zeros((*shape, 3)) for _ in range(3))
    no, yes = np.zeros(shape, dtype=bool), np.ones(shape, dtype=bool)
    felt = TipTouches(points_m, normals, np.zeros(shape), forces_N, no, yes)
    together = {FINGERS.index(finger): tip for finger, tip in fingertips.items() if isinstance(tip, ForceTip)}
    if together:
        at = list(together)
        sensing = TipSensing.together([tip.sensing for tip in together.values()])
        _put(sensing.touches(readings[:, at], world_R_distal[:, at]), felt, at)
    for finger, tip in fingertips.items():
        if (alone := FINGERS.index(finger)) not in together:
            _put(tip.touches(readings[:, alone], world_R_distal[:, alone]), felt, alone)
    return felt


def _is_held(samples: CarrySamples) -> NDArray[np.bool_]:
    """Samples in which enough fingertips feel more than their own weight, shape (n,): one beside a table, two above."""
    heights_m = samples.world_T_forearm[:, 2, 3]
    presses = np.linalg.norm(samples.readings[..., :3], axis=-1) >= _FREE_N
    return np.asarray(presses.sum(axis=1) >= np.where(heights_m > heights_m[0] + RAISED_m, HELD_BY, 1))


def _put(touches: TipTouches, into: TipTouches, at: int | list[int]) -> None:
    for each in fields(TipTouches):
        getattr(into, each.name)[:, at] = getattr(touches, each.name)


def _moments(points_m: Array, pushes_N: Array, forces_N: Array) -> tuple[Array, Array]:
    """Vertical moment of pushes at contacts about their middle, shape (n,), and their mean lever, shape (n,)."""
    felt = forces_N > 0.0
    middles_m = np.einsum("nf,nfi->ni", felt, points_m) / np.maximum(felt.sum(axis=1), 1)[:, None]
    arms_m = (points_m - middles_m[:, None]) * felt[..., None]
    moments_Nm = (arms_m[..., 0] * pushes_N[..., 1] - arms_m[..., 1] * pushes_N[..., 0]).sum(axis=1)
    levers_Nm = np.einsum("nf,nf->n", forces_N, np.hypot(arms_m[..., 0], arms_m[..., 1]))
    return moments_Nm, levers_Nm / np.maximum(forces_N.sum(axis=1), 1e-9)


def _sinking(forces_N: Array) -> Array:
    """Logarithm of the factor by which each normal force grows until the next step; zero where a contact comes or goes.

    A round fingertip gets stiffer the more it is pressed: doubling a small force makes it sink in about as far as
    doubling a large one.
    """
    later_N = np.vstack([forces_N[1:], forces_N[-1:]])
    grown = np.log((later_N + _SLACK_N) / (forces_N + _SLACK_N))
    return np.asarray(np.where((forces_N > 0.0) & (later_N > 0.0), grown, 0.0))


def _transform(frames: Array, points: Array) -> Array:
    return np.asarray((frames[..., :3, :3] @ points[..., None])[..., 0] + frames[..., :3, 3])


def _middle_normals(before: Array, after: Array, normals_distal: Array) -> Array:
    """Normals turned by half of the step, unit length; zero where there is none."""
    turned = ((before[..., :3, :3] + after[..., :3, :3]) @ normals_distal[..., None])[..., 0]
    return np.asarray(turned / np.maximum(np.linalg.norm(turned, axis=-1, keepdims=True), 1e-12))


def _smooth_between(cuts: NDArray[np.intp], values: Array, smooth: Callable[[Array], Array]) -> Array:
    """Values smoothed on either side of each cut: fingers that have lost the object snap shut, and what they do then
    is no motion of the object.
    """
    return np.concatenate([smooth(part) for part in np.split(values, cuts)])


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
