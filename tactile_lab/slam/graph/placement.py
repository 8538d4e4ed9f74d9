"""Tests how certain the placement of each grasp on the object is.

Loops are made from pairs of contacts on the same face, which follows from the present poses. So a wrongly placed grasp
makes loops that all agree with each other and with the wrong placement. Each grasp is therefore first tested by
independent evidence: its contacts are compared with the shape made from all other grasps, here and at every other place
where they fit, and the motion from the previous and to the next grasp is included.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from pydantic import Field

from drivers.core.configuration import StrictModel
from drivers.core.contacts import Array
from tactile_lab.slam.graph.relocation import RelocationSettings, relocation_candidates
from tactile_lab.slam.shape.fields.gpis import Gpis
from tactile_lab.slam.tracking.contacts.contact_map import ContactMap, PlacedGrasp
from tactile_lab.slam.tracking.contacts.contact_set import ContactSet, planar_rotation
from tactile_lab.slam.tracking.contacts.motion import MotionNoise, compose, deviation


class PlacementSettings(StrictModel):
    """When a grasp's placement counts as certain.

    Attributes:
        relocation: how other places are searched.
        same_place_m, same_place_rad: proposals closer than both are the same place.
        least_margin: the best other place must be this much less likely (natural logarithm).
        largest_sigma_m, largest_sigma_rad: largest standard deviation of the placement itself.
        unexplained_cost: negative log likelihood of a contact that fits nothing; no contact costs more.
        normal_length_m: a map uncertain by sigma predicts normals to ``sigma / normal_length_m`` radians.
    """

    relocation: RelocationSettings = RelocationSettings()
    same_place_m: float = Field(default=0.008, gt=0)
    same_place_rad: float = Field(default=float(np.deg2rad(12.0)), gt=0)
    least_margin: float = Field(default=3.0, gt=0)
    largest_sigma_m: float = Field(default=0.0035, gt=0)
    largest_sigma_rad: float = Field(default=float(np.deg2rad(4.0)), gt=0)
    unexplained_cost: float = Field(default=6.0, gt=0)
    normal_length_m: float = Field(default=0.018, gt=0)


@dataclass(frozen=True)
class Placement:
    """One grasp's placement.

    Attributes:
        sure: whether its loops can be trusted.
        margin: how much less likely the best other place is (natural logarithm); infinite if there is none.
        other: the best other place, a row, or None.
        covariance: of (x, y, yaw) in the world, from the other grasps' shape alone, shape (3, 3).
        reason: why it is not certain; empty if it is.
    """

    sure: bool
    margin: float
    other: Array | None
    covariance: Array
    reason: str


def judge_placements(contact_map: ContactMap, noise: MotionNoise, settings: PlacementSettings) -> tuple[Placement, ...]:
    """Test the placement of every grasp of a map with planar poses.

    Args:
        contact_map: all grasps.
        noise: of the motion between them.
        settings: see there.
    """
    return tuple(_assess(contact_map, index, noise, settings) for index in range(len(contact_map.placed)))


def _assess(contact_map: ContactMap, index: int, noise: MotionNoise, settings: PlacementSettings) -> Placement:
    grasp = contact_map.placed[index]
    others = _without(contact_map, index)
    if not grasp.used or not any(one.used for one in others.placed):
        return Placement(False, 0.0, None, np.eye(3), "contacts kept aside")
    contacts = grasp.contacts_world.select(grasp.kept)
    shape = others.fit()
    found = relocation_candidates(others, contacts, settings.relocation).rows
    rows = np.vstack([grasp.pose, found])
    costs = _contact_costs(rows, contacts, shape, settings) + _motion_costs(rows, contact_map, index, noise)
    near = np.abs(deviation(rows, grasp.pose)) < [settings.same_place_m] * 2 + [settings.same_place_rad]
    here = near.all(axis=1)
    best_other = int(np.argmin(np.where(here, np.inf, costs)))
    other = None if here.all() else rows[best_other]
    margin = float("inf") if other is None else float(costs[best_other] - costs[here].min())
    covariance = _covariance(grasp, contacts, shape, settings)
    reason = _doubt(grasp, other, margin, covariance, settings)
    return Placement(not reason, margin, other, covariance, reason)


def _without(contact_map: ContactMap, index: int) -> ContactMap:
    placed = contact_map.placed
    return ContactMap((*placed[:index], placed[index].put_aside(), *placed[index + 1 :]), contact_map.settings)


def _doubt(
    grasp: PlacedGrasp, other: Array | None, margin: float, covariance: Array, settings: PlacementSettings
) -> str:
    if other is not None and margin < settings.least_margin:
        gap = deviation(other, grasp.pose)
        away = f"{1e3 * np.hypot(gap[0], gap[1]):.0f} mm and {np.degrees(abs(gap[2])):.0f} degrees away"
        return f"fits as well {away}" if abs(margin) < settings.least_margin else f"fits better {away}"
    sigma_m = float(np.sqrt(np.linalg.eigvalsh(covariance[:2, :2])[-1]))
    sigma_rad = float(np.sqrt(covariance[2, 2]))
    if sigma_m > settings.largest_sigma_m or sigma_rad > settings.largest_sigma_rad:
        return f"placed to {1e3 * sigma_m:.1f} mm and {np.degrees(sigma_rad):.1f} degrees only"
    return ""


def _contact_costs(rows: Array, contacts: ContactSet, shape: Gpis, settings: PlacementSettings) -> Array:
    """Negative log likelihood of the contacts at each pose, each contact independently, shape (k,)."""
    seen = [contacts.in_object_frame(row) for row in rows]
    points = np.concatenate([one.points_m for one in seen])
    found = shape.predict(points, gradient=True, variance=True)
    values = found.mean_m.reshape(len(rows), -1)
    slopes = found.gradient.reshape(len(rows), len(contacts), -1)
    variance = found.variance_m2.reshape(len(rows), -1)
    normals = np.array([one.normals for one in seen])
    value_variance = contacts.point_sigma_m**2 + variance
    normal_variance = contacts.normal_sigma_rad**2 + np.minimum(variance / settings.normal_length_m**2, 1.0)
    tilt = np.sum((normals - slopes) ** 2, axis=2) / normal_variance
    each = 0.5 * (values**2 / value_variance + np.log(value_variance / contacts.point_sigma_m**2))
    each += 0.5 * (tilt + np.log(normal_variance / contacts.normal_sigma_rad**2))
    return np.asarray(np.minimum(each, settings.unexplained_cost).sum(axis=1))


def _motion_costs(rows: Array, contact_map: ContactMap, index: int, noise: MotionNoise) -> Array:
    """Negative log probability of the motion from the grasp before and to the one after, shape (k,)."""
    placed = contact_map.placed
    costs = np.zeros(len(rows))
    if index > 0:
        expected = compose(placed[index].motion, placed[index - 1].pose)
        costs += 0.5 * np.sum((deviation(rows, expected) / noise.sigmas) ** 2, axis=1)
    if index + 1 < len(placed):
        following = compose(placed[index + 1].motion, rows)
        costs += 0.5 * np.sum((deviation(following, placed[index + 1].pose) / noise.sigmas) ** 2, axis=1)
    return costs


def _covariance(grasp: PlacedGrasp, contacts: ContactSet, shape: Gpis, settings: PlacementSettings) -> Array:
    """Inverse information of the contacts on the shape of the others (Gauss-Newton)."""
    seen = contacts.in_object_frame(grasp.pose)
    found = shape.predict(seen.points_m, gradient=True, variance=True)
    variance = found.variance_m2
    flat = found.gradient[:, :2]
    turning = flat[:, 0] * seen.points_m[:, 1] - flat[:, 1] * seen.points_m[:, 0]
    slopes = np.column_stack([-flat @ planar_rotation(-grasp.pose[2]), turning])
    weights = 1 / (contacts.point_sigma_m**2 + variance)
    information = slopes.T @ (weights[:, None] * slopes) + np.diag([1.0, 1.0, 1e-2])
    tilt_variance = contacts.normal_sigma_rad**2 + np.minimum(variance / settings.normal_length_m**2, 1.0)
    information[2, 2] += np.sum(np.sum(flat**2, axis=1) / tilt_variance)
    return np.asarray(np.linalg.inv(information))
