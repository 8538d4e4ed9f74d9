"""Finds poses at which a grasp fits the known object, independent of the hand's motion.

Two contacts on sides that are not parallel fix a planar pose, once each is matched to a side of the map. All such
matches are tried at once: every well conditioned pair of the new contacts against every pair of the map's contacts
with the same angle between their normals. The poses are scored by how the other contacts fit, the best are refined
by point-to-side distances and normals, and equal ones are merged. Nothing is assumed about the hand's motion; the
caller weighs the proposals by it.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from drivers.core.configuration import StrictModel
from drivers.core.contacts import Array
from drivers.core.poses import wrap_angle_rad
from tactile_lab.slam.tracking.contacts.contact_map import ContactMap
from tactile_lab.slam.tracking.contacts.contact_set import ContactSet
from tactile_lab.slam.tracking.contacts.motion import deviation

Indices = NDArray[np.intp]

_SIDEWAYS = 0.5
"""Contacts with a smaller horizontal part of the normal do not constrain a pose on the table."""


class RelocationSettings(StrictModel):
    """Parameters of the search.

    Attributes:
        side_contacts: the map is thinned to this many contacts, spread over it.
        contact_pairs: number of pairs of new contacts that are matched, the ones nearest to a right angle.
        normal_tolerance_rad: how much the angle between a pair's normals may differ from that in the map.
        reach_m: a side is assumed to extend this far around a contact of the map without cost.
        reach_sigma_m: standard deviation of its extent beyond that.
        unexplained_cost: half the squared deviation of a contact that fits nowhere.
        refined: number of poses that are refined.
        steps: Gauss-Newton steps.
        kept: largest number of poses returned.
        distinct_m, distinct_rad: poses closer than both count as equal.
    """

    side_contacts: int = Field(default=48, ge=2)
    contact_pairs: int = Field(default=4, ge=1)
    normal_tolerance_rad: float = Field(default=float(np.deg2rad(16.0)), gt=0)
    reach_m: float = Field(default=0.012, gt=0)
    reach_sigma_m: float = Field(default=0.008, gt=0)
    unexplained_cost: float = Field(default=6.0, gt=0)
    refined: int = Field(default=48, ge=1)
    steps: int = Field(default=4, ge=1)
    kept: int = Field(default=16, ge=1)
    distinct_m: float = Field(default=0.004, gt=0)
    distinct_rad: float = Field(default=0.12, gt=0)


@dataclass(frozen=True)
class Relocations:
    """Poses proposed for a grasp, the best first.

    Attributes:
        rows: ``world_T_object`` as (x_m, y_m, yaw_rad), shape (m, 3).
        covariances: of x, y and yaw, in the world, linearised, shape (m, 3, 3).
        scores: half the squared deviations of all contacts, each at most ``unexplained_cost``, shape (m,).
    """

    rows: Array
    covariances: Array
    scores: Array


@dataclass(frozen=True)
class _Match:
    """Each contact (columns) at each pose (rows) with the side that fits it best."""

    costs: Array
    distances_m: Array
    turns_rad: Array
    side_normals: Array
    weights: Array
    turn_weights: Array


def relocation_candidates(
    contact_map: ContactMap, contacts: ContactSet, settings: RelocationSettings | None = None
) -> Relocations:
    """Poses of the object that bring a grasp's contacts onto sides of the map, anywhere.

    Args:
        contact_map: what is known of the object.
        contacts: of the new grasp, world frame.
        settings: of the search.

    Returns:
        No pose if no two contacts lie on sides at an angle, as in the map.
    """
    settings = settings or RelocationSettings()
    sides = _thin(_sideways(contact_map.contacts), settings.side_contacts)
    new = _sideways(contacts)
    object_rows = _one_per_cell(_matched_poses(new, sides, settings), settings)
    if len(object_rows) == 0:
        return Relocations(np.zeros((0, 3)), np.zeros((0, 3, 3)), np.zeros(0))
    scores = _rough_scores(object_rows, new, sides, settings)
    best = _distinct(object_rows, scores, settings, settings.refined)
    poses = object_rows[best]
    for _ in range(settings.steps):
        poses = poses + _step(poses, new, sides, settings)[0]
    scores = _match(poses, new, sides, settings).costs.sum(axis=1)
    kept = _distinct(poses, scores, settings, settings.kept)
    poses, scores = poses[kept], scores[kept]
    _, information = _step(poses, new, sides, settings)
    return Relocations(*_in_world(poses, np.asarray(np.linalg.inv(information), dtype=np.float64)), scores)


def relocated_poses(contact_map: ContactMap, contacts: ContactSet) -> Array:
    """The poses of :func:`relocation_candidates` alone, the best first, shape (m, 3)."""
    return relocation_candidates(contact_map, contacts).rows


def _sideways(contacts: ContactSet) -> ContactSet:
    return contacts.select(np.linalg.norm(contacts.normals[:, :2], axis=1) > _SIDEWAYS)


def _thin(contacts: ContactSet, count: int) -> ContactSet:
    """Contacts far from each other in place or direction, chosen one by one (farthest point first)."""
    if len(contacts) <= count:
        return contacts
    features = np.hstack([contacts.points_m, 0.03 * contacts.normals])
    chosen = [0]
    gaps = np.sum((features - features[0]) ** 2, axis=1)
    for _ in range(count - 1):
        chosen.append(int(gaps.argmax()))
        gaps = np.minimum(gaps, np.sum((features - features[chosen[-1]]) ** 2, axis=1))
    return contacts.select(np.array(sorted(chosen)))


def _headings(contacts: ContactSet) -> Array:
    return np.asarray(np.arctan2(contacts.normals[:, 1], contacts.normals[:, 0]))


def _matched_poses(new: ContactSet, sides: ContactSet, settings: RelocationSettings) -> Array:
    """``object_T_world`` for each match of a pair of contacts with a pair of sides, shape (k, 3)."""
    ours, theirs = _headings(new), _headings(sides)
    found = []
    for first, second in _steepest_pairs(ours, settings.contact_pairs):
        angle = wrap_angle_rad(ours[second] - ours[first])
        gaps = wrap_angle_rad(theirs[None, :] - theirs[:, None] - angle)
        one, other = np.nonzero(np.abs(gaps) < settings.normal_tolerance_rad)
        yaw = wrap_angle_rad(theirs[one] - ours[first] + gaps[one, other] / 2)
        found.append(_on_both(new, sides, (first, second), one, other, yaw))
    return np.concatenate(found) if found else np.zeros((0, 3))


def _one_per_cell(rows: Array, settings: RelocationSettings) -> Array:
    """One pose per cell of a grid with the resolution of distinct poses, since thousands of matches are equal."""
    cells = np.round(rows / [settings.distinct_m, settings.distinct_m, settings.distinct_rad]).astype(np.int64)
    keys = cells @ np.array([1, 1 << 20, 1 << 40])
    return rows[np.sort(np.unique(keys, return_index=True)[1])]


def _steepest_pairs(headings: Array, count: int) -> list[tuple[int, int]]:
    """Pairs of contacts whose normals are nearest to a right angle, none flatter than 25 degrees."""
    first, second = np.triu_indices(len(headings), 1)
    steepness = np.abs(np.sin(headings[second] - headings[first]))
    order = np.argsort(-steepness, kind="stable")[:count]
    return [(int(first[k]), int(second[k])) for k in order if steepness[k] > np.sin(np.deg2rad(25.0))]


def _on_both(
    new: ContactSet, sides: ContactSet, pair: tuple[int, int], one: Indices, other: Indices, yaw: Array
) -> Array:
    """The shift that puts both contacts onto their sides, for given yaws."""
    cosine, sine = np.cos(yaw), np.sin(yaw)
    normals = np.stack([sides.normals[one, :2], sides.normals[other, :2]], axis=1)
    targets = np.stack([sides.points_m[one, :2], sides.points_m[other, :2]], axis=1)
    points = new.points_m[list(pair), :2]
    turned = np.stack(
        [
            cosine[:, None] * points[:, 0] - sine[:, None] * points[:, 1],
            sine[:, None] * points[:, 0] + cosine[:, None] * points[:, 1],
        ],
        axis=-1,
    )
    steep = np.abs(normals[:, 0, 0] * normals[:, 1, 1] - normals[:, 0, 1] * normals[:, 1, 0]) > 0.2
    missing = np.sum(normals * (targets - turned), axis=2)[steep]
    shift = np.linalg.solve(normals[steep], missing[..., None])[..., 0]
    return np.column_stack([shift, yaw[steep]])


def _place(object_rows: Array, new: ContactSet) -> tuple[Array, Array]:
    """Points (k, n, d) and horizontal normals (k, n, 2) of the contacts at each pose, in the object frame."""
    cosine, sine = np.cos(object_rows[:, 2])[:, None], np.sin(object_rows[:, 2])[:, None]

    def turned(vectors: Array) -> Array:
        x, y = vectors[:, 0], vectors[:, 1]
        return np.stack([cosine * x - sine * y, sine * x + cosine * y], axis=-1)

    points = turned(new.points_m) + object_rows[:, None, :2]
    heights = np.broadcast_to(new.points_m[:, 2:], (len(object_rows), len(new), new.dimension - 2))
    return np.concatenate([points, heights], axis=2), turned(new.normals)


def _match(object_rows: Array, new: ContactSet, sides: ContactSet, settings: RelocationSettings) -> _Match:
    points, normals = _place(object_rows, new)
    flat = sides.normals[:, :2]
    gaps = points[:, :, None, :] - sides.points_m
    along = gaps[..., 0] * flat[:, 0] + gaps[..., 1] * flat[:, 1]
    aside = np.sqrt(np.maximum(np.sum(gaps**2, axis=-1) - along**2, 0.0))
    turns = np.arctan2(
        normals[:, :, None, 0] * flat[:, 1] - normals[:, :, None, 1] * flat[:, 0],
        normals[:, :, None, 0] * flat[:, 0] + normals[:, :, None, 1] * flat[:, 1],
    )
    noise = new.point_sigma_m[:, None] ** 2 + sides.point_sigma_m**2 + (sides.normal_sigma_rad * aside) ** 2
    tilt = np.broadcast_to(new.normal_sigma_rad[:, None] ** 2 + sides.normal_sigma_rad**2, noise.shape)
    beyond = np.maximum(aside - settings.reach_m, 0.0) / settings.reach_sigma_m
    costs = 0.5 * (along**2 / noise + turns**2 / tilt + beyond**2)
    best = costs.argmin(axis=2)[..., None]
    chosen = [np.take_along_axis(values, best, axis=2)[..., 0] for values in (costs, along, turns, noise, tilt)]
    cost, distance, turn, variance, tilt_variance = chosen
    pull = 1 / (1 + cost / settings.unexplained_cost) ** 2
    capped = np.minimum(cost, settings.unexplained_cost)
    return _Match(capped, distance, turn, flat[best[..., 0]], pull / variance, pull / tilt_variance)


def _rough_scores(object_rows: Array, new: ContactSet, sides: ContactSet, settings: RelocationSettings) -> Array:
    """As the costs of :func:`_match`, with common noise and chords for angles, one matrix product for each part."""
    points, normals = _place(object_rows, new)
    flat, places = sides.normals[:, :2], sides.points_m
    along = points[..., :2] @ flat.T - np.sum(flat * places[:, :2], axis=1)
    squares = np.sum(points**2, axis=2)[..., None] + np.sum(places**2, axis=1) - 2 * points @ places.T
    aside = np.maximum(squares - along**2, 0.0)
    point_variance = np.mean(new.point_sigma_m**2) + np.mean(sides.point_sigma_m**2)
    tilt_variance = np.mean(new.normal_sigma_rad**2) + np.mean(sides.normal_sigma_rad**2)
    costs = along**2 / (2 * (point_variance + np.mean(sides.normal_sigma_rad**2) * aside))
    costs += (1 - normals @ flat.T) / tilt_variance
    costs += np.maximum(aside - settings.reach_m**2, 0.0) / (2 * (settings.reach_m + settings.reach_sigma_m) ** 2)
    return np.asarray(np.minimum(costs.min(axis=2), settings.unexplained_cost).sum(axis=1))


def _step(object_rows: Array, new: ContactSet, sides: ContactSet, settings: RelocationSettings) -> tuple[Array, Array]:
    """One Gauss-Newton step for each pose, shape (k, 3), and the information there, (k, 3, 3)."""
    found = _match(object_rows, new, sides, settings)
    points, _ = _place(object_rows, new)
    arms = points[:, :, :2] - object_rows[:, None, :2]
    normals = found.side_normals
    turning = arms[..., 0] * normals[..., 1] - arms[..., 1] * normals[..., 0]
    rows = np.concatenate([normals, turning[..., None]], axis=2)
    information = np.einsum("kn,kni,knj->kij", found.weights, rows, rows)
    information[:, 2, 2] += found.turn_weights.sum(axis=1)
    information += np.diag([100.0, 100.0, 1.0])  # at most 10 cm and a radian where nothing is known
    gradient = np.einsum("kn,kni->ki", found.weights * found.distances_m, rows)
    gradient[:, 2] -= np.sum(found.turn_weights * found.turns_rad, axis=1)
    return -np.linalg.solve(information, gradient[..., None])[..., 0], information


def _distinct(rows: Array, scores: Array, settings: RelocationSettings, most: int) -> Indices:
    """The best ones that differ from all better ones."""
    limits = np.array([settings.distinct_m, settings.distinct_m, settings.distinct_rad])
    open_rows = np.argsort(scores, kind="stable")
    chosen: list[int] = []
    while len(open_rows) and len(chosen) < most:
        chosen.append(int(open_rows[0]))
        away = np.abs(deviation(rows[open_rows], rows[open_rows[0]])) > limits
        open_rows = open_rows[away.any(axis=1)]
    return np.array(chosen, dtype=np.intp)


def _in_world(object_rows: Array, covariances: Array) -> tuple[Array, Array]:
    """The inverse poses and their covariances: ``world_T_object`` from ``object_T_world``."""
    cosine, sine = np.cos(object_rows[:, 2]), np.sin(object_rows[:, 2])
    x, y = object_rows[:, 0], object_rows[:, 1]
    place = np.column_stack([-cosine * x - sine * y, sine * x - cosine * y])
    slopes = np.zeros((len(object_rows), 3, 3))
    slopes[:, 0, 0], slopes[:, 0, 1], slopes[:, 0, 2] = -cosine, -sine, place[:, 1]
    slopes[:, 1, 0], slopes[:, 1, 1], slopes[:, 1, 2] = sine, -cosine, -place[:, 0]
    slopes[:, 2, 2] = -1.0
    rows = np.column_stack([place, wrap_angle_rad(-object_rows[:, 2])])
    return rows, slopes @ covariances @ slopes.transpose(0, 2, 1)
