"""Settings for turning contacts into a field, and the parts of the model that follow from them."""

from __future__ import annotations

from typing import Literal, TypeAlias

import numpy as np
from pydantic import Field

from drivers.core.configuration import StrictModel
from drivers.core.contacts import Array
from tactile_lab.slam.shape.baselines.superquadric import fit_superquadric
from tactile_lab.slam.shape.fields.kernels import Kernel, Matern52, SquaredExponential, ThinPlate
from tactile_lab.slam.shape.fields.observations import Observations, derivative_observations, offsurface_observations
from tactile_lab.slam.shape.fields.priors import EllipsoidMean, OutwardMean, PriorMean, ZeroMean

ShapePart: TypeAlias = Literal[
    "field",
    "polygon",
    "polyhedron",
    "prism",
    "turned",
    "parts",
    "standing field",
    "sections",
    "strays",
    "contradictions",
    "held-out contacts",
    "corners",
    "right angles",
    "round sides",
    "face extents",
]
"""Parts of the choice of the shape model, see docs/estimator.md."""


class GpisSettings(StrictModel):
    """Observations, kernel and prior of a field.

    Attributes:
        observations: "normals" observes gradients; "offsurface" is the thesis's way, inside and outside points.
        kernel: covariance function, (2.15), Matérn 5/2 or (2.17).
        amplitude_m: prior standard deviation of the field; start value if optimised.
        length_m: length of the kernel; start value if optimised. The thin plate takes its radius from the data.
        prior_mean: (2.18); "zero" is (2.13), "outward" is positive everywhere and increases with the distance from the
            data, "sphere", "ellipsoid" (2.19) and "superquadric" are primitives fitted to the contacts (the last in
            about a second, in space).
        prior_softness_m: value of the outward prior amid the data.
        offsurface_distance_m: distance of the inside and outside points from their contact.
        without: parts of the choice of the shape model to leave out, to measure their worth.
    """

    observations: Literal["normals", "offsurface"] = "normals"
    kernel: Literal["squared_exponential", "matern52", "thin_plate"] = "matern52"
    amplitude_m: float = Field(default=0.020, gt=0)
    length_m: float = Field(default=0.080, gt=0)
    prior_mean: Literal["zero", "outward", "sphere", "ellipsoid", "superquadric"] = "outward"
    prior_softness_m: float = Field(default=0.020, gt=0)
    offsurface_distance_m: float = Field(default=0.005, gt=0)
    without: frozenset[ShapePart] = frozenset()


def observe(
    points_m: Array, normals: Array, point_sigma_m: Array, normal_sigma: Array, settings: GpisSettings
) -> Observations:
    if settings.observations == "normals":
        return derivative_observations(points_m, normals, point_sigma_m, normal_sigma)
    return offsurface_observations(points_m, normals, point_sigma_m, settings.offsurface_distance_m)


def initial_kernel(observations: Observations, settings: GpisSettings) -> Kernel:
    amplitude = settings.amplitude_m**2
    if settings.kernel == "thin_plate":
        return ThinPlate(_domain_diameter(observations.points_m), amplitude)
    kind = SquaredExponential if settings.kernel == "squared_exponential" else Matern52
    return kind(amplitude, settings.length_m)


def _domain_diameter(points_m: Array) -> float:
    """Largest distance in the domain of interest: the observations and the space around them."""
    return float(2 * np.linalg.norm(np.ptp(points_m, axis=0)) + 0.040)


def prior_mean(contacts_m: Array, normals: Array, settings: GpisSettings) -> PriorMean:
    """The prior that the settings name, fitted to the contacts."""
    if settings.prior_mean == "zero":
        return ZeroMean()
    if settings.prior_mean == "outward":
        return OutwardMean.around(contacts_m, settings.prior_softness_m)
    if settings.prior_mean == "sphere":
        return EllipsoidMean.sphere_around(contacts_m, normals)
    if settings.prior_mean == "ellipsoid":
        return EllipsoidMean.ellipsoid_around(contacts_m, normals)
    point_sigma_m, normal_sigma = np.full(len(contacts_m), 0.001), np.full(len(contacts_m), 0.1)
    return fit_superquadric(contacts_m, normals, point_sigma_m, normal_sigma).superquadric
