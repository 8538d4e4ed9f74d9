"""Numbers of superquadrics: values and gradients of given ones, and the best fits to fixed contacts."""

from __future__ import annotations

import numpy as np
from scipy.spatial.transform import Rotation

from tactile_lab.slam.shape.baselines.superquadric import Superquadric, fit_superquadric
from tactile_lab.slam.shape.baselines.superquadric_shape import SuperquadricShape
from tests.support.baseline import assert_baseline
from tests.support.digest import digest
from tests.support.shape_examples import contacts_on_box, contacts_on_polygon, ellipse, noisy


def test_distances_and_gradients() -> None:
    """Around a turned superellipse, also on its axes, and a turned superquadric; at their centres."""
    cosine, sine = np.cos(0.4), np.sin(0.4)
    turned = np.array([[cosine, sine], [-sine, cosine]])
    flat = Superquadric(np.array([0.01, -0.02]), turned, np.array([0.05, 0.03]), np.array([0.4]))
    axes = Rotation.from_rotvec([0.3, -0.2, 0.5]).as_matrix()
    solid = Superquadric(np.array([0.01, 0.0, 0.03]), axes, np.array([0.05, 0.03, 0.04]), np.array([1.6, 0.3]))
    values = {}
    for name, figure in (("flat", flat), ("solid", solid)):
        dimension = len(figure.centre_m)
        offsets_m = 0.03 * np.sin(np.arange(9 * dimension).reshape(9, dimension))
        offsets_m[-1] = 0.0
        if name == "flat":  # in space, rounding moves a place off an axis, where the gradient is steep
            offsets_m[:2] = 0.02 * figure.axes
        values[name] = [figure.value(figure.centre_m + offsets_m), figure.gradient(figure.centre_m + offsets_m)]
    assert_baseline("shape/baselines/superquadric", values)


def test_fits_to_contacts() -> None:
    """A noisy ellipse with an outlier, and a box in the plane and in space; with free and with given exponents."""
    points_m, normals = contacts_on_polygon(ellipse(), 20, seed=5)
    points_m[3] += 0.02
    sigmas = np.linspace(0.0008, 0.0015, 20), np.linspace(0.1, 0.06, 20)
    box_m, box = noisy(*contacts_on_box(np.array([0.08, 0.05, 0.06]), 30, seed=2), seed=2)
    given = np.full(30, 0.001), np.full(30, 0.09)
    fits = {
        "ellipse": fit_superquadric(points_m, normals, *sigmas),
        "given": fit_superquadric(points_m, normals, *sigmas, exponents=np.ones(1)),
        "box": fit_superquadric(box_m, box, *given, exponents=np.array([0.4, 0.4])),
    }
    values: dict[str, object] = {}
    for name, fit in fits.items():
        places_m = fit.superquadric.centre_m + 0.05 * np.eye(len(fit.superquadric.centre_m))
        found = fit.superquadric  # which axis is the first one is a matter of chance
        sizes = [found.centre_m, np.sort(found.semi_axes_m), found.exponents, np.trace(fit.covariance)]
        values[name] = [fit.log_evidence, *sizes, found.value(places_m), fit.sigma(places_m)]
    contour = SuperquadricShape(fits["given"]).contour(0.004)
    mesh = SuperquadricShape(fits["box"]).mesh(0.01, floor_m=-0.02)
    values["contour"] = [digest(contour.points_m), digest(contour.sigma_m)]
    values["mesh"] = [digest(mesh.vertices), digest(mesh.sigma_m)]
    assert_baseline("shape/baselines/superquadric_fits", values, rtol=1e-4, atol=1e-6)
