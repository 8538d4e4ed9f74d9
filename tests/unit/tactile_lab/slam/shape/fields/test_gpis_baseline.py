"""Numbers of fields on fixed problems: kernels, priors, observations, evidence, predictions, and fields on grids."""

from __future__ import annotations

import numpy as np
import pytest

from drivers.core.contacts import Array
from drivers.core.errors import ShapeError
from tactile_lab.slam.shape.fields.field_grid import FieldGrid
from tactile_lab.slam.shape.fields.gpis import Gpis
from tactile_lab.slam.shape.fields.kernels import (
    Kernel,
    Matern52,
    SquaredExponential,
    ThinPlate,
    covariance,
    cross_covariance,
    cross_covariance_with_gradients,
    log_parameter_traces,
)
from tactile_lab.slam.shape.fields.known_places import in_one_piece, inside_at, outside_at
from tactile_lab.slam.shape.fields.observations import check_contacts, fibonacci_sphere, offsurface_observations
from tactile_lab.slam.shape.fields.priors import EllipsoidMean, OutwardMean, PriorMean, ZeroMean
from tactile_lab.slam.shape.fields.row_factor import RowFactor
from tactile_lab.slam.shape.fields.settings import GpisSettings
from tests.support.baseline import assert_baseline
from tests.support.digest import digest
from tests.support.shape_examples import (
    contacts_on_box,
    contacts_on_polygon,
    contacts_on_sphere,
    ellipse,
    l_block,
    noisy,
)

KERNELS: dict[str, Kernel] = {
    "squared exponential": SquaredExponential(0.0004, 0.06),
    "matern": Matern52(0.0005, 0.07),
    "thin plate": ThinPlate(0.1, 0.0006),
}


def flat(count: int = 14, settings: GpisSettings | None = None) -> Gpis:
    """A field in the plane of an L, no two contacts with the same standard deviations."""
    points_m, normals = contacts_on_polygon(l_block(), count, seed=9)
    return Gpis.fit(points_m, normals, np.linspace(0.001, 0.003, count), np.linspace(0.15, 0.05, count), settings)


def solid(count: int = 16, settings: GpisSettings | None = None) -> Gpis:
    """The same of a box in space."""
    points_m, normals = noisy(*contacts_on_box(np.array([0.09, 0.06, 0.05]), count, seed=3), seed=3)
    return Gpis.fit(points_m, normals, np.linspace(0.001, 0.003, count), np.linspace(0.15, 0.05, count), settings)


def around(dimension: int) -> Array:
    return np.vstack(
        [0.08 * np.sin(np.arange(5 * dimension) * 1.3).reshape(5, dimension), np.full((1, dimension), 0.3)]
    )


def told(field: Gpis) -> dict[str, object]:
    """All that is asked of a field, at places near and far."""
    places_m = around(field.contacts_m.shape[1])
    found = field.predict(places_m, gradient=True, variance=True)
    return {
        "evidence": field.log_marginal_likelihood(),
        "by parameters": field.log_marginal_likelihood_gradient(),
        "mean": found.mean_m,
        "gradient": found.gradient,
        "sigma": np.sqrt(found.variance_m2),
        "covariance": digest(1e4 * field.joint_covariance(places_m[:3])),
        "inflation": field.sigma_inflation,
        "parameters": field.log_parameters,
    }


def test_kernels() -> None:
    """Profiles up to beyond the thin plate's radius, covariances of rows, and their derivatives by the parameters."""
    points_m, others_m = around(3)[:4], 0.05 * np.cos(np.arange(9.0)).reshape(3, 3)
    values: dict[str, object] = {}
    for name, kernel in KERNELS.items():
        weights = np.outer(np.sin(np.arange(10.0)), np.sin(np.arange(10.0)))
        squared = np.linspace(0.0, 0.12, 7) ** 2
        values[name] = {
            "profile": [1e4 * each for each in kernel.profile(squared)],
            "derivatives": [[1e4 * each for each in one] for one in kernel.log_parameter_profiles(squared)],
            "parameters": kernel.log_parameters,
            "changed": kernel.with_log_parameters(kernel.log_parameters + 0.1).log_parameters,
            "rows": digest(1e4 * covariance(kernel, points_m, 3)),
            "cross": digest(1e4 * cross_covariance(kernel, others_m, points_m, 2)),
            "gradients": digest(1e4 * cross_covariance_with_gradients(kernel, others_m, points_m, 2)),
            "traces": log_parameter_traces(kernel, points_m, 2, weights),
        }
    assert_baseline("shape/fields/kernels", values)


def test_prior_means() -> None:
    """Primitives around an ellipse, around a box, around one face, and around contacts of extreme sizes."""
    contacts = {
        "ellipse": contacts_on_polygon(ellipse(), 16, seed=2),
        "box": noisy(*contacts_on_box(np.array([0.12, 0.03, 0.05]), 20, seed=1), seed=1),
        "face": (np.column_stack([np.linspace(-0.03, 0.04, 6), np.zeros(6)]), np.tile([0.0, 1.0], (6, 1))),
        "thin": noisy(*contacts_on_box(np.array([0.4, 0.01, 0.02]), 20, seed=1), seed=1),
        "huge": contacts_on_sphere(0.35, 9, 3, seed=4),
        "tiny": contacts_on_sphere(0.002, 9, 2, seed=4),
    }
    values = {}
    for name, (points_m, normals) in contacts.items():
        places_m = around(points_m.shape[1])
        priors: list[PriorMean] = [
            ZeroMean(),
            OutwardMean.around(points_m, 0.02),
            EllipsoidMean.sphere_around(points_m, normals),
            EllipsoidMean.ellipsoid_around(points_m, normals),
        ]
        values[name] = [[prior.value(places_m), digest(prior.gradient(places_m))] for prior in priors]
    assert_baseline("shape/fields/priors", values)


@pytest.mark.parametrize("prior", ["zero", "outward", "sphere", "ellipsoid", "superquadric"])
def test_fields_with_each_prior(prior: str) -> None:
    """In the plane, with normals observed."""
    settings = GpisSettings(prior_mean=prior, amplitude_m=0.03, length_m=0.06)  # type: ignore[arg-type]
    assert_baseline(f"shape/fields/field_{prior}", told(flat(settings=settings)), rtol=1e-5)


def test_fields_with_each_kernel() -> None:
    """In the plane and in space; with normals and with the thesis's points off the surface."""
    thesis = GpisSettings(observations="offsurface", kernel="thin_plate", prior_mean="zero")
    values = {
        "smooth": told(solid(settings=GpisSettings(kernel="squared_exponential", length_m=0.05))),
        "default": told(solid()),
        "thesis": told(flat(settings=thesis)),
        "thesis in space": told(solid(8, settings=thesis)),
    }
    assert_baseline("shape/fields/field_kernels", values)


def test_changed_fields() -> None:
    """Contacts appended, some of them, other contacts, other parameters and noise, contacts held out, rough sigma."""
    field = solid()
    more_m, more = noisy(*contacts_on_box(np.array([0.09, 0.06, 0.05]), 3, seed=8), seed=8)
    noisier = field.with_log_parameters(np.append(field.log_parameters - 0.2, 0.3))
    extended = noisier.extend(more_m, more, 0.002, np.array([0.1, 0.2, 0.3])).extend(more_m[:1] + 0.01, more[:1])
    thesis = flat(settings=GpisSettings(observations="offsurface", prior_mean="zero"))
    values = {
        "extended": told(extended),
        "some": told(extended.of_some(np.array([1, 4, 5, 9, 17]))),
        "refit": told(noisier.refit(more_m, more, np.full(3, 0.002), np.full(3, 0.1))),
        "thesis": told(thesis.extend(np.array([[0.1, 0.1]]), np.array([[0.6, 0.8]]))),
        "held out": [extended.leave_one_out_costs(np.array(each)) for each in ([3], [0, 7, 18], [*range(20)])],
        "density": [extended.log_density_given_others(np.array(each)) for each in ([3], [0, 7, 18], [*range(9)])],
        "rough": np.sqrt(extended.variance(around(3), rough=True)) * 1e3,
        "noise": extended.noise_scale,
    }
    assert_baseline("shape/fields/changed", values, rtol=1e-5)


def test_single_precision_only_where_it_is_accurate() -> None:
    """Rough sigma is that of double precision if the prior is wide compared with the noise."""
    exact = []
    for amplitude_m in np.linspace(0.015, 0.06, 10):
        field = flat(settings=GpisSettings(amplitude_m=float(amplitude_m)))
        places_m = field.contacts_m
        exact.append(bool(np.array_equal(field.variance(places_m), field.variance(places_m, rough=True))))
    assert_baseline("shape/fields/rough", {"exact": exact})


def test_optimised_fields() -> None:
    """Few steps from a near start and many from far, with the noise, within bounds, with a longest length."""
    far = GpisSettings(amplitude_m=1.0, length_m=0.004)
    values = {
        "near": flat().optimise(max_iterations=3).log_parameters,
        "far": flat(settings=far).optimise(max_iterations=2).log_parameters,
        "short": flat().optimise(longest_m=0.03).log_parameters,
        "long": flat(settings=GpisSettings(length_m=0.9, amplitude_m=1e-4)).optimise(max_iterations=1).log_parameters,
    }
    noisy_one = flat().optimise(noise=True, max_iterations=4)
    values["noise"] = np.append(noisy_one.log_parameters, noisy_one.noise_scale)
    loud = flat().with_log_parameters(np.append(flat().log_parameters, np.log(50.0)))
    calm = flat().with_log_parameters(np.append(flat().log_parameters, np.log(0.01)))
    values["limits"] = [one.optimise(noise=True, max_iterations=1).noise_scale for one in (loud, calm)]
    assert_baseline("shape/fields/optimised", values, rtol=1e-4)


def test_off_surface_points() -> None:
    """The thesis's rows in the plane and in space, where a sphere around and one amid the contacts are added."""
    values = {}
    for name, field in (("flat", flat()), ("solid", solid())):
        seen = offsurface_observations(field.contacts_m, field.normals, field.observations.value_sigma_m[:16], 0.004)
        values[name] = [
            digest(each) for each in (seen.points_m, seen.values_m, seen.value_sigma_m, seen.noise_variance)
        ]
    one_sided = contacts_on_sphere(0.03, 12, 3, seed=2)
    inward = offsurface_observations(one_sided[0] + 0.02, -one_sided[1], np.full(12, 0.001), 0.004)
    values["inward"] = [digest(inward.points_m), digest(inward.values_m)]
    values["sphere"] = [fibonacci_sphere(7)]
    assert_baseline("shape/fields/offsurface", values)


def test_fields_on_grids() -> None:
    """Values, gradients and variances between nodes, in a coarser grid of variances, and beyond the grid."""
    values = {}
    for name, field in (("flat", flat()), ("solid", solid(10))):
        grid = FieldGrid.around(field, margin_m=0.02, spacing_m=0.011)
        fine = FieldGrid.tabulate(field, field.contacts_m[0] - 0.01, field.contacts_m[0] + 0.012, 0.004, variance=True)
        places_m = around(field.contacts_m.shape[1])
        found = grid.predict(places_m, gradient=True, variance=True)
        values[name] = {
            "mean": found.mean_m,
            "gradient": found.gradient,
            "sigma": np.sqrt(found.variance_m2),
            "shape": grid.values_m.shape,
            "bytes": grid.bytes_kept,
            "fine": [fine.values_m.shape, digest(fine.values_m), fine.bytes_kept],
            "fine sigma": np.sqrt(fine.predict(places_m, variance=True).variance_m2),
        }
    assert_baseline("shape/fields/grids", values, rtol=1e-4)
    with pytest.raises(ShapeError, match="without gradients"):
        fine.predict(places_m, gradient=True)


def test_places_known_to_be_outside_or_inside() -> None:
    """Free places that a field takes for its inside, two discs told to be one piece, and a place told to be inside."""
    field = flat(20)
    free_m = np.column_stack([np.linspace(-0.03, 0.09, 60), np.linspace(-0.02, 0.05, 60)])
    points_m, normals = contacts_on_sphere(0.02, 9, 2, seed=1)
    apart = Gpis.fit(np.vstack([points_m, np.add(points_m, [0.055, 0.01])]), np.vstack([normals, normals]), 0.001, 0.1)
    apart = apart.with_log_parameters(np.log([0.0004, 0.03]))
    values = {
        "outside": told(outside_at(field, free_m)),
        "one piece": told(in_one_piece(apart, 0.002)),
        "inside": told(inside_at(field, np.array([[0.05, 0.05]]))),
        "rows": [len(each.observations.points_m) for each in (outside_at(field, free_m), in_one_piece(apart, 0.002))],
    }
    assert_baseline("shape/fields/known_places", values, rtol=1e-5)


def test_factors_of_nearly_singular_covariances() -> None:
    """The least jitter that helps, for matrices of falling smallest eigenvalue, and none that does."""
    vectors = np.linalg.qr(np.sin(np.arange(25.0) ** 1.5).reshape(5, 5))[0]
    jitters = []
    for least in (1e-3, -3e-10, -3e-9, -3e-7, -3e-5, -3e-3):
        matrix = (vectors * np.array([1.0, 0.8, 0.6, 0.5, least])) @ vectors.T
        found = RowFactor.of((matrix + matrix.T) / 2, np.zeros(5))
        jitters.append(None if found is None else found.jitter)
    assert_baseline("shape/fields/jitters", {"jitters": jitters})


def test_contacts_that_cannot_be_used() -> None:
    """Each kind is told from contacts that just can be used."""
    points_m, normals = contacts_on_sphere(0.03, 3, 2, seed=1)
    sigma, turns = np.full(3, 0.001), np.full(3, 0.1)
    check_contacts(points_m[:1], normals[:1], 0.0 * sigma[:1], 0.0 * turns[:1])
    check_contacts(points_m * [60, 1], normals * 1.0009, sigma, turns)
    for refused in (
        [points_m[:0]] * 4,
        [points_m, normals[:, :1], sigma, turns],
        [points_m, normals, sigma[:2], turns],
    ):
        with pytest.raises(ShapeError):
            check_contacts(*refused)
    wide_m = points_m * [2.01 / np.ptp(points_m[:, 0]), 1]
    for one, other, match in (
        (wide_m, normals, "spread over 2.01 m"),
        (points_m, normals * 1.0011, "normal of contact"),
        (points_m * [1, np.nan], normals, "contact 0 has a coordinate"),
    ):
        with pytest.raises(ShapeError, match=match):
            check_contacts(one, other, sigma, turns)
    for sign in ([-1, 1], [1, -1]):
        with pytest.raises(ShapeError, match="negative"):
            check_contacts(points_m, normals, sigma * sign[0], turns * sign[1])
