"""Intrinsic contact sensing in closed form: the contact of a wrench on an ellipsoid.

Bicchi, Salisbury and Brock, "Contact sensing from force measurements" (IJRR 1993), soft finger (protocols: Contact
from a wrench). The surface is c' A^2 c = 1 with A = diag(1 / semi-axes). The force f acts in c, and the contact may
also twist about the normal, so that the moment about the centre is m = c x f + K A^2 c. Of the two solutions the one
that presses on the surface is used. A very long semi-axis approximates a cylinder.

Every wrench that has a force has such a solution, also one whose axis misses the ellipsoid: it then needs a force
along the surface and a strong twist. ``axis_distance`` and ``force_angle_rad`` identify these; the caller decides
whether to accept them. All functions take arrays with any leading shape.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from drivers.core.contacts import Array


@dataclass(frozen=True)
class EllipsoidContact:
    """Contacts on the surface, in the frame of the ellipsoid's axes with the origin in its centre.

    Attributes:
        point_m: contact points, shape (..., 3); NaN where the force is zero.
        normal: unit outward normals of the ellipsoid, shape (..., 3).
        torsion_Nm: moment about ``normal``, shape (...).
        twist: K of the closed form: the torsion vector is K A^2 c, shape (...).
        axis_distance: distance of the wrench's axis from the centre where the surface is scaled to the unit sphere,
            shape (...); above 1 the axis misses the surface.
        force_angle_rad: between the force and the inward normal, shape (...); friction has to hold it.
    """

    point_m: Array
    normal: Array
    torsion_Nm: Array
    twist: Array
    axis_distance: Array
    force_angle_rad: Array


def contact_on_ellipsoid(force_N: Array, moment_centre_Nm: Array, semi_axes_m: Array) -> EllipsoidContact:
    """The pressing soft-finger contact of each wrench.

    Args:
        force_N: forces on the ellipsoid, shape (..., 3), along its axes.
        moment_centre_Nm: moments about its centre, shape (..., 3).
        semi_axes_m: shape (3,), or (..., 3) for ellipsoids that differ.

    The limit without twist (the hard point: where the wrench's axis enters the surface) needs no branch of its own:
    with K and (f . m) / K computed by the form that does not cancel, both stay exact through f . m = 0.
    """
    f, m = np.asarray(force_N, float), np.asarray(moment_centre_Nm, float)
    semi = np.asarray(semi_axes_m, float)
    a = 1.0 / semi
    det = np.prod(a, axis=-1)
    along, scaled_f, scaled_m = _dot(f, m), a * f, semi * m
    force_squared, scaled_force_squared = _dot(f, f), _dot(scaled_f, scaled_f)
    with np.errstate(invalid="ignore", divide="ignore"):
        twist, ratio = _twist(along, det**2 * _dot(scaled_m, scaled_m), scaled_force_squared, det)
        numerator = (twist * det**2)[..., None] * semi * scaled_m + _cross(a * scaled_f, m) + ratio[..., None] * f
        point = numerator / (twist**2 * det**2 + scaled_force_squared)[..., None]
        point = np.where((scaled_force_squared > 0)[..., None], point, np.nan)
        gradient = a**2 * point
        normal = gradient / np.sqrt(_dot(gradient, gradient))[..., None]
        cosine = -_dot(f, normal) / np.sqrt(force_squared)
        across = scaled_m - (along / force_squared)[..., None] * (semi * f)
        # A r0 x A f = det(A) A^-1 (r0 x f) for r0 on the axis: the lever arm where the surface is a unit sphere.
        distance = det * np.sqrt(_dot(across, across)) / np.sqrt(scaled_force_squared)
    torsion = _dot(m - _cross(point, f), normal)
    angle_rad = np.arccos(np.minimum(np.maximum(cosine, -1.0), 1.0))
    return EllipsoidContact(point, normal, torsion, twist, np.asarray(distance), np.asarray(angle_rad))


def _twist(along: Array, moment_squared: Array, force_squared: Array, det: Array) -> tuple[Array, Array]:
    """K and (f . m) / K, each by the form that subtracts nothing: sigma > 0 twisting, sigma < 0 pressing."""
    sigma, along_size = moment_squared - force_squared, np.abs(along)
    larger = np.sqrt((np.sqrt(sigma**2 + (2.0 * det * along) ** 2) + np.abs(sigma)) / 2.0)
    by_larger = along_size / np.maximum(larger, np.finfo(float).tiny)
    twists = sigma > 0
    twist = np.where(along < 0, 1.0, -1.0) * np.where(twists, larger / det, by_larger)
    return np.asarray(twist), np.asarray(-np.where(twists, det * by_larger, larger))


def _dot(u: Array, v: Array) -> Array:
    return np.asarray(np.einsum("...i,...i->...", u, v))


def _cross(u: Array, v: Array) -> Array:
    """As numpy's, which takes longer than everything else for the few rows of a carry."""
    product = np.empty(u.shape)
    for axis, (after, before) in enumerate(((1, 2), (2, 0), (0, 1))):
        product[..., axis] = u[..., after] * v[..., before] - u[..., before] * v[..., after]
    return product


def contact_jacobian(contact: EllipsoidContact, force_N: Array, semi_axes_m: Array) -> Array:
    """Derivatives of the contact points by the wrench: shape (..., 3, 6), force then moment about the centre.

    By implicit differentiation of m = c x f + K A^2 c and c' A^2 c = 1 with respect to c and K. Near a grazing
    force the derivative grows without bound; the pseudo-inverse keeps it finite.
    """
    a2 = 1.0 / np.asarray(semi_axes_m, float) ** 2
    size = float(np.min(semi_axes_m))
    gradient = a2 * contact.point_m
    system = np.zeros((*np.shape(contact.twist), 4, 4))
    system[..., :3, :3] = -cross_matrix(np.asarray(force_N, float)) + contact.twist[..., None, None] * np.diag(a2)
    system[..., :3, 3] = gradient
    system[..., 3, :3] = gradient * size
    right = np.zeros((*np.shape(contact.twist), 4, 6))
    right[..., :3, :3] = -cross_matrix(contact.point_m)
    right[..., :3, 3:] = np.eye(3)
    return np.asarray((np.linalg.pinv(system, rcond=1e-12) @ right)[..., :3, :])


def contact_covariance(
    contact: EllipsoidContact, force_N: Array, semi_axes_m: Array, wrench_covariance: Array
) -> tuple[Array, Array]:
    """Covariance of points and normals from that of the wrenches.

    Args:
        contact, force_N, semi_axes_m: as solved by :func:`contact_on_ellipsoid`.
        wrench_covariance: shape (..., 6, 6), force then moment about the centre, along the ellipsoid's axes.

    Returns:
        Point covariance (..., 3, 3), m^2, no axis above the largest semi-axis (the point cannot leave the tip), and
        normal covariance (..., 3, 3), rad^2.
    """
    jacobian = contact_jacobian(contact, force_N, semi_axes_m)
    raw = jacobian @ wrench_covariance @ np.swapaxes(jacobian, -1, -2)
    values, vectors = np.linalg.eigh((raw + np.swapaxes(raw, -1, -2)) / 2.0)
    values = np.clip(values, 0.0, float(np.max(semi_axes_m)) ** 2)
    point = (vectors * values[..., None, :]) @ np.swapaxes(vectors, -1, -2)
    bend = _normal_jacobian(contact, semi_axes_m)
    return np.asarray(point), np.asarray(bend @ point @ np.swapaxes(bend, -1, -2))


def _normal_jacobian(contact: EllipsoidContact, semi_axes_m: Array) -> Array:
    """d normal / d point = (I - n n') A^2 / |A^2 c|, shape (..., 3, 3)."""
    a2 = 1.0 / np.asarray(semi_axes_m, float) ** 2
    steepness = np.linalg.norm(a2 * contact.point_m, axis=-1)[..., None, None]
    tangential = np.eye(3) - contact.normal[..., :, None] * contact.normal[..., None, :]
    return np.asarray(tangential * a2 / steepness)


def cross_matrix(vectors: Array) -> Array:
    """Matrices S with S @ w = v x w, shape (..., 3, 3)."""
    matrices = np.zeros((*vectors.shape[:-1], 3, 3))
    matrices[..., 0, 1], matrices[..., 0, 2] = -vectors[..., 2], vectors[..., 1]
    matrices[..., 1, 0], matrices[..., 1, 2] = vectors[..., 2], -vectors[..., 0]
    matrices[..., 2, 0], matrices[..., 2, 1] = -vectors[..., 1], vectors[..., 0]
    return matrices


def wrench_transform(target_R_source: Array, source_origin_target_m: Array) -> Array:
    """Matrix (6, 6) that turns a wrench about the source's origin into one about the target's, along its axes.

    With r the source's origin in the target frame: f' = R f, m' = R m + r x f'.
    """
    matrix = np.zeros((6, 6))
    matrix[:3, :3] = matrix[3:, 3:] = target_R_source
    matrix[3:, :3] = cross_matrix(source_origin_target_m) @ target_R_source
    return matrix
