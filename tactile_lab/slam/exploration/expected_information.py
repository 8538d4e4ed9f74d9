"""Expected information of a grasp about shape and pose together (beyond thesis section 4.5.2).

The information of a grasp z about the pose x and the shape f is, by the chain rule, ``I(x, f; z) = I(x; z) + I(f; z |
x)``.

- The first term is that of the linearised contacts, with the covariance P of the particles at the time of the grasp,
  what it becomes, and the precision G at which the pose is good enough (its finer digits are nobody's gain):
  ``log det(1 + P / G) / 2 - log det(1 + P' / G) / 2``, ``P' = (1 / P + J' J / r)^-1``. Here r is the variance of a
  contact *on an uncertain surface*: where the surface is not known, a contact says nothing about the pose.
- The second is summed over the surface: every patch of the size that one contact determines (``reach``) hides its own
  deviation, besides the field's uncertainty, until it has been touched. A contact reveals it up to the sensor's noise
  and the pose's remaining uncertainty.

Both are averages over sampled worlds (:mod:`tactile_lab.slam.exploration.prediction`): surfaces, poses and errors of
execution are drawn, and the candidates' fingers closed on each.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray
from pydantic import Field
from scipy.spatial import cKDTree

from drivers.core.configuration import StrictModel
from drivers.core.contacts import Array
from tactile_lab.slam.exploration.candidates import Candidate
from tactile_lab.slam.exploration.information.particles import ARM_m
from tactile_lab.slam.exploration.policy import Belief, Surface
from tactile_lab.slam.exploration.prediction import (
    ExecutionNoise,
    ExpectedTouches,
    PossibleWorlds,
    expected_touches,
    most_fingers,
    possible_worlds,
)
from tactile_lab.slam.tracking.contacts.motion import compose, inverse

Mask: TypeAlias = NDArray[np.bool_]

_SMALLEST_VARIANCE = 1e-12


class InformationSettings(StrictModel):
    """Parameters.

    Attributes:
        worlds, worlds_in_space: how many are sampled for a decision, for a contour and for a surface.
        execution: errors of the hand relative to the plan.
        reach_m, reach_in_space_m: distance along a contour, or a surface, for which a contact is informative.
        detail_m: standard deviation of what the field does not predict between contacts (edges, corners).
        point_sigma_m, normal_sigma_rad: of a contact's measurement.
        accuracy_m, accuracy_in_space_m: a contour, or a surface, known to this is good enough, as its finer digits are
            nobody's gain; 0 where all of them count.
        pose_sigma_m: a pose known to this (a turn with an arm of 30 mm) is good enough.
        pose_weight: of the pose's information against the shape's; 1 is the chain rule, 0 asks for the shape alone.
        least_gain: stop when no grasp is expected to gain this many nats; 0: never.
        known_sigma_m: stop when the surface is explored to ``enough`` and known so well everywhere; None never does.
        enough: share of the surface near contacts from which on that counts.
        push_worth, push_worth_in_space: share that counts of what a grasp promises which is expected to push the
            object: it often fits nowhere, and spoils what was known of the pose. In the plane even that is a guess.
    """

    worlds: int = Field(default=48, ge=1)
    worlds_in_space: int = Field(default=24, ge=1)
    execution: ExecutionNoise = ExecutionNoise()
    reach_m: float = Field(default=0.0045, gt=0)
    reach_in_space_m: float = Field(default=0.012, gt=0)
    detail_m: float = Field(default=0.003, ge=0)
    point_sigma_m: float = Field(default=0.001, gt=0)
    accuracy_m: float = Field(default=0.0, ge=0)
    accuracy_in_space_m: float = Field(default=0.005, ge=0)
    normal_sigma_rad: float = Field(default=float(np.deg2rad(5.0)), gt=0)
    pose_sigma_m: float = Field(default=0.003, gt=0)
    pose_weight: float = Field(default=1.0, ge=0)
    least_gain: float = Field(default=0.0, ge=0)
    known_sigma_m: float | None = Field(default=None, gt=0)
    enough: float = Field(default=0.9, gt=0, le=1)
    push_worth: float = Field(default=0.55, ge=0, le=1)
    push_worth_in_space: float = Field(default=0.15, ge=0, le=1)

    def reach(self, dimension: int) -> float:
        """Distance for which a contact is informative, on a contour (2) or a surface (3), metres."""
        return self.reach_m if dimension == 2 else self.reach_in_space_m

    def worth_of_push(self, dimension: int) -> float:
        """Weight of the information of a grasp that is expected to push the object."""
        return self.push_worth if dimension == 2 else self.push_worth_in_space

    def accuracy(self, dimension: int) -> float:
        """To which a contour (2) or a surface (3) is to be known, metres."""
        return self.accuracy_m if dimension == 2 else self.accuracy_in_space_m


@dataclass(frozen=True)
class Promise:
    """The expected information of every candidate.

    Attributes:
        pose: nats about the pose, shape (c,).
        shape: nats about the shape, shape (c,).
        together: nats about the shape that all candidates together could give, one after the other.
        touching: expected number of contacts, shape (c,).
        new_share: expected share of the touchable surface that comes within a contact's reach for the first time, shape
            (c,).
    """

    pose: Array
    shape: Array
    together: float
    touching: Array
    new_share: Array


def predict_promise(
    candidates: Sequence[Candidate],
    belief: Belief,
    surface: Surface,
    settings: InformationSettings,
    rng: np.random.Generator,
) -> Promise:
    """The expected information of each candidate, over sampled worlds."""
    count = settings.worlds if belief.dimension == 2 else settings.worlds_in_space
    worlds = possible_worlds(belief, surface, most_fingers(candidates), count, settings.execution, rng)
    touches = expected_touches(candidates, belief, worlds)
    pose, placed = _pose_information(touches, belief, worlds, settings)
    reach_m = settings.reach(belief.dimension)
    touchable = surface.touchable(belief.origin_height_m)
    fresh, patches = touchable & unexplored_vertices(surface, belief, reach_m), _patches(surface, reach_m)
    chance = covered_chance(touches, surface, reach_m)
    hidden = surface.sigma_m**2 + settings.detail_m**2
    left = settings.point_sigma_m**2 + settings.accuracy(belief.dimension) ** 2 + placed[:, None]
    worth = 0.5 * np.log1p(hidden / left) * fresh * patches
    worth = worth * _hope(surface, belief, reach_m)
    new_share = chance @ (fresh * surface.sizes) / max(float(surface.sizes[touchable].sum()), _SMALLEST_VARIANCE)
    touching = touches.touching.sum(axis=2).mean(axis=1)
    together = float((1 - np.prod(1 - chance, axis=0)) @ worth.max(axis=0, initial=0.0))
    return Promise(pose, np.sum(chance * worth, axis=1), together, touching, new_share)


def pose_nats(covariance: Array, settings: InformationSettings) -> float:
    """Information missing about a pose with this covariance (x m, y m, yaw rad), nats."""
    return float(0.5 * _log_det(covariance * _wanted_precision(settings)))


def unexplored_vertices(surface: Surface, belief: Belief, reach_m: float) -> Mask:
    """Which vertices have no contact within reach, shape (n,)."""
    return np.asarray(cKDTree(belief.contacts_m).query(surface.points_m)[0] > reach_m)


def covered_chance(touches: ExpectedTouches, surface: Surface, reach_m: float) -> Array:
    """Probability that a candidate's contacts come within reach of each vertex, shape (c, n)."""
    count = len(surface.points_m)
    near = np.zeros((count + 1, count), dtype=bool)  # the last row stands for a finger that meets nothing
    pairs = cKDTree(surface.points_m).query_pairs(reach_m, output_type="ndarray")
    near[pairs[:, 0], pairs[:, 1]] = near[pairs[:, 1], pairs[:, 0]] = True
    np.fill_diagonal(near[:count], True)
    chance = np.empty((len(touches.vertices), count))
    for index, met in enumerate(touches.vertices):
        reached = near[met[:, 0]]
        for finger in range(1, met.shape[1]):
            reached = reached | near[met[:, finger]]
        chance[index] = reached.mean(axis=0)
    return chance


def _patches(surface: Surface, reach_m: float) -> Array:
    """Share of a contact's patch that belongs to each vertex: lengths over 2 r, areas over pi r^2, shape (n,)."""
    whole = 2 * reach_m if surface.points_m.shape[1] == 2 else np.pi * reach_m**2
    return np.asarray(surface.sizes / whole)


def _hope(surface: Surface, belief: Belief, reach_m: float) -> Array:
    """Weight of each vertex, halved for each finger that met nothing where a contact had been expected, shape (n,)."""
    if len(belief.missed_m) == 0:
        return np.ones(len(surface.points_m))
    near = cKDTree(belief.missed_m).query_ball_point(surface.points_m, 2 * reach_m, return_length=True)
    return np.asarray(0.5 ** np.asarray(near, dtype=float))


def _pose_information(
    touches: ExpectedTouches, belief: Belief, worlds: PossibleWorlds, settings: InformationSettings
) -> tuple[Array, Array]:
    """Nats about the pose, and the variance with which a contact can be placed afterwards (m^2), each of shape (c,)."""
    prior = _covariance(worlds)
    if np.trace(prior) <= _SMALLEST_VARIANCE or settings.pose_weight == 0:
        return np.zeros(len(touches.vertices)), np.zeros(len(touches.vertices))
    surface, met = worlds.surface, touches.touching
    normals = np.where(met[..., None], surface.normals[touches.vertices], 0.0)
    points = np.nan_to_num(touches.points_m)
    turn = points[..., 0] * normals[..., 1] - points[..., 1] * normals[..., 0]
    rows = np.stack([normals[..., 0], normals[..., 1], turn], axis=-1)
    hidden = surface.sigma_m**2 + settings.detail_m**2 * unexplored_vertices(
        surface, belief, settings.reach(belief.dimension)
    )
    variance = settings.point_sigma_m**2 + hidden[touches.vertices]
    told = np.einsum("csfi,csf,csfj->csij", rows, met / variance, rows)
    told[..., 2, 2] += _normal_precision(surface, touches, met, settings)
    after = np.linalg.inv(np.linalg.inv(prior + _SMALLEST_VARIANCE * np.eye(3)) + told)
    wanted = _wanted_precision(settings)
    nats = 0.5 * (_log_det(prior * wanted) - _log_det(after * wanted))
    moved = np.einsum("csfi,csij,csfj->csf", rows, after, rows)
    placed = np.sum(moved * met, axis=(1, 2)) / np.maximum(met.sum(axis=(1, 2)), 1)
    return nats.mean(axis=1), placed


def _wanted_precision(settings: InformationSettings) -> Array:
    """Precision of a pose that is good enough, the diagonal, shape (3,)."""
    return np.array([1.0, 1.0, ARM_m**2]) / settings.pose_sigma_m**2


def _log_det(scaled: Array) -> Array:
    """Of one plus covariances in units of what is good enough, shape (..., 3, 3)."""
    return np.asarray(np.linalg.slogdet(np.eye(3) + scaled)[1])


def _normal_precision(surface: Surface, touches: ExpectedTouches, met: Mask, settings: InformationSettings) -> Array:
    """Precision that measured normals add to the heading, shape (c, s), 1/rad^2; slopes are uncertain too."""
    slope_rad = np.minimum(surface.sigma_m[touches.vertices] / (2 * settings.reach(surface.points_m.shape[1])), 1.0)
    level = np.linalg.norm(surface.normals[touches.vertices][..., :2], axis=-1)
    return np.asarray(np.sum(met * level**2 / (settings.normal_sigma_rad**2 + slope_rad**2), axis=2))


def _covariance(worlds: PossibleWorlds) -> Array:
    """Of the sampled poses, with places in the object's own axes, shape (3, 3)."""
    middle = worlds.world_T_object.mean(axis=0)
    middle[2] = np.arctan2(np.sin(worlds.world_T_object[:, 2]).mean(), np.cos(worlds.world_T_object[:, 2]).mean())
    local = compose(inverse(middle), worlds.world_T_object)
    return np.asarray(local.T @ local / max(len(local) - 1, 1))
