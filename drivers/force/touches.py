"""The contacts of many wrenches of fingertips at once, while the hand moves."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields
from typing import Self

import numpy as np
from numpy.typing import NDArray

from drivers.core.contacts import Array
from drivers.core.fingertip import FingertipCalibration, TipTouches
from drivers.force.intrinsic_contact import EllipsoidContact, contact_on_ellipsoid
from drivers.force.plausibility import PlausibilitySettings

LEAST_FORCE_N = 0.08
"""Lighter touches than at rest count: the bias is fresh, and a contact that is missed is a slip that is not seen."""


@dataclass(frozen=True)
class TipSensing:
    """What turns the readings of k fingertips into contacts; k stands in front of all shapes.

    Attributes:
        to_centre: from a wrench in the sensor's frame to one about the ellipsoid's centre, shape (k, 6, 6).
        weight_from_down: from the direction down in the distal frame to the weight's wrench, shape (k, 6, 3).
        semi_axes_m, centre_distal_m, shell_min_distal_m, shell_max_distal_m: of the calibrations, shape (k, 3).
        yield_m, yield_exponent: likewise, shape (k,).
        axis_distance, force_angle_rad: limits of a single frictional contact, shape (k,).
    """

    to_centre: Array
    weight_from_down: Array
    semi_axes_m: Array
    centre_distal_m: Array
    shell_min_distal_m: Array
    shell_max_distal_m: Array
    yield_m: Array
    yield_exponent: Array
    axis_distance: Array
    force_angle_rad: Array

    @classmethod
    def of(
        cls, calibration: FingertipCalibration, limits: PlausibilitySettings, to_centre: Array, weight: Array
    ) -> Self:
        """Of one fingertip."""
        known = {each.name: np.array([getattr(calibration, each.name)]) for each in fields(cls)[2:8]}
        return cls(
            to_centre=to_centre[None],
            weight_from_down=weight[None],
            axis_distance=np.array([limits.axis_distance]),
            force_angle_rad=np.array([limits.force_angle_rad]),
            **known,
        )

    @classmethod
    def together(cls, tips: Sequence[Self]) -> Self:
        """Of several: what takes as long for one takes no longer for five."""
        return cls(*(np.concatenate([getattr(tip, each.name) for tip in tips]) for each in fields(cls)))

    def touches(self, readings: Array, world_R_distal: Array) -> TipTouches:
        """The contacts of readings without bias, shape (n, k, 6), of distal frames (n, k, 3, 3): (n, k) in front."""
        is_void = np.asarray(~np.isfinite(readings).all(axis=-1), dtype=bool)
        weights = -world_R_distal[..., 2, None, :] @ self.weight_from_down.swapaxes(1, 2)
        loads = np.where(is_void[..., None], 0.0, readings - weights[..., 0, :])
        return self.contacts((loads[..., None, :] @ self.to_centre.swapaxes(1, 2))[..., 0, :], is_void)

    def contacts(self, wrenches: Array, is_void: NDArray[np.bool_]) -> TipTouches:
        """The contact of each wrench, without bias and weight about the ellipsoid's centre, shape (n, k, 6)."""
        forces_N = wrenches[..., :3]
        contact = contact_on_ellipsoid(forces_N, wrenches[..., 3:], self.semi_axes_m)
        sizes_N = np.sqrt(np.sum(forces_N**2, axis=-1))
        certain = ~is_void & (sizes_N > LEAST_FORCE_N) & self._is_possible(contact)
        points_m = pressed_points(contact, forces_N, self)
        return TipTouches(
            points_distal_m=np.where(certain[..., None], points_m, 0.0),
            normals_distal=np.where(certain[..., None], -contact.normal, 0.0),
            normal_forces_N=np.where(certain, sizes_N * np.cos(contact.force_angle_rad), 0.0),
            forces_distal_N=np.where(certain[..., None], forces_N, 0.0),
            is_certain=certain,
            is_void=is_void,
        )

    def indentation_m(self, normal_force_N: Array) -> Array:
        """See :meth:`~drivers.core.fingertip.FingertipCalibration.indentation_m`; shape (n, k)."""
        return np.asarray(self.yield_m * np.maximum(normal_force_N, 0.0) ** self.yield_exponent)

    def _is_possible(self, contact: EllipsoidContact) -> NDArray[np.bool_]:
        """As :func:`~drivers.force.plausibility.objection` decides, but for the twist."""
        on_skin_m = contact.point_m + self.centre_distal_m
        with np.errstate(invalid="ignore"):
            on_shell = (on_skin_m >= self.shell_min_distal_m) & (on_skin_m <= self.shell_max_distal_m)
            meets = contact.axis_distance <= self.axis_distance
            presses = contact.force_angle_rad <= self.force_angle_rad
        return np.asarray(on_shell.all(axis=-1) & meets & presses)


def pressed_points(contact: EllipsoidContact, forces_N: Array, tip: FingertipCalibration | TipSensing) -> Array:
    """Where the object's surface is: the contacts on the ellipsoid, moved inwards as far as the skin yields.

    Args:
        contact: with any leading shape, axes parallel to the distal frame, origin in the ellipsoid's centre.
        forces_N: of these contacts, shape (..., 3).
        tip: the fingertip, or those of the last place of the leading shape.

    Returns:
        Points in the distal frame, shape (..., 3).
    """
    pressing_N = -np.sum(forces_N * contact.normal, axis=-1)
    indented_m = tip.indentation_m(pressing_N)[..., None] * contact.normal
    return np.asarray(contact.point_m - indented_m + np.array(tip.centre_distal_m))
