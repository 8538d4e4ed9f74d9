"""The contacts of many wrenches of one fingertip at once, while the hand moves."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from drivers.core.contacts import Array
from drivers.core.fingertip import FingertipCalibration, TipTouches
from drivers.force.intrinsic_contact import EllipsoidContact, contact_on_ellipsoid
from drivers.force.plausibility import PlausibilitySettings

LEAST_FORCE_N = 0.08
"""Lighter touches than at rest count: the bias is fresh, and a contact that is missed is a slip that is not seen."""


def tip_touches(
    wrenches: Array, is_void: NDArray[np.bool_], calibration: FingertipCalibration, settings: PlausibilitySettings
) -> TipTouches:
    """The contact of each wrench on the fingertip.

    Args:
        wrenches: without bias and weight, shape (n, 6), about the ellipsoid's centre, along the distal axes.
        is_void: wrenches that are no measurement, shape (n,).
        calibration: of the fingertip.
        settings: limits of a single frictional contact.
    """
    contact = contact_on_ellipsoid(wrenches[:, :3], wrenches[:, 3:], np.array(calibration.semi_axes_m))
    forces_N = np.linalg.norm(wrenches[:, :3], axis=-1)
    on_skin_m = contact.point_m + np.array(calibration.centre_distal_m)
    certain = ~is_void & (forces_N > LEAST_FORCE_N) & _is_possible(contact, on_skin_m, calibration, settings)
    points_m = pressed_points(contact, wrenches[:, :3], calibration)
    return TipTouches(
        points_distal_m=np.where(certain[:, None], points_m, 0.0),
        normals_distal=np.where(certain[:, None], -contact.normal, 0.0),
        normal_forces_N=np.where(certain, forces_N * np.cos(contact.force_angle_rad), 0.0),
        forces_distal_N=np.where(certain[:, None], wrenches[:, :3], 0.0),
        is_certain=certain,
        is_void=is_void,
    )


def pressed_points(contact: EllipsoidContact, forces_N: Array, calibration: FingertipCalibration) -> Array:
    """Where the object's surface is: the contacts on the ellipsoid, moved inwards as far as the skin yields.

    Args:
        contact: with any leading shape, axes parallel to the distal frame, origin in the ellipsoid's centre.
        forces_N: of these contacts, shape (..., 3).
        calibration: of the fingertip.

    Returns:
        Points in the distal frame, shape (..., 3).
    """
    pressing_N = -np.sum(forces_N * contact.normal, axis=-1)
    indented_m = calibration.indentation_m(pressing_N)[..., None] * contact.normal
    return np.asarray(contact.point_m - indented_m + np.array(calibration.centre_distal_m))


def _is_possible(
    contact: EllipsoidContact, points_m: Array, calibration: FingertipCalibration, settings: PlausibilitySettings
) -> NDArray[np.bool_]:
    """Whether each contact may be one; as :func:`~drivers.force.plausibility.objection`, but for its twist."""
    with np.errstate(invalid="ignore"):
        on_shell = (points_m >= np.array(calibration.shell_min_distal_m)) & (
            points_m <= np.array(calibration.shell_max_distal_m)
        )
        meets = contact.axis_distance <= settings.axis_distance
        presses = contact.force_angle_rad <= settings.force_angle_rad
    return np.asarray(on_shell.all(axis=-1) & meets & presses)
