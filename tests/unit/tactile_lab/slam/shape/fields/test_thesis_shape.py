"""The thesis's shape model (section 2.2) in space: labelled points off the surface, either kernel."""

from __future__ import annotations

import numpy as np
import pytest
import trimesh

from tactile_lab.slam.shape.fields.gpis import Gpis
from tactile_lab.slam.shape.fields.settings import GpisSettings
from tactile_lab.slam.shape.metrics.metrics import mesh_errors
from tactile_lab.slam.shape.surfaces.surface import extract_mesh
from tests.support.shape_examples import NORMAL_SIGMA_rad, POINT_SIGMA_m, contacts_on_box, contacts_on_sphere, noisy

KERNELS = ("squared_exponential", "thin_plate")


def thesis(kernel: str, distance_m: float = 0.005) -> GpisSettings:
    return GpisSettings.model_validate(
        {
            "observations": "offsurface",
            "kernel": kernel,
            "prior_mean": "zero",
            "length_m": 0.04,
            "offsurface_distance_m": distance_m,
        }
    )


@pytest.mark.parametrize("kernel", KERNELS)
def test_a_ball_is_closed_and_close_to_the_truth(kernel: str) -> None:
    points, normals = noisy(*contacts_on_sphere(0.035, 60, 3, seed=0), seed=0)
    mesh = extract_mesh(Gpis.fit(points, normals, POINT_SIGMA_m, 0.1, thesis(kernel)), resolution_m=0.005)
    assert mesh.is_closed
    assert np.abs(np.linalg.norm(mesh.vertices, axis=1) - 0.035).max() < 0.006


@pytest.mark.parametrize("kernel", KERNELS)
def test_the_box_of_figure_2_12_is_closed_with_eighty_contacts(kernel: str) -> None:
    extents = np.array([0.12, 0.06, 0.06])
    points, normals = noisy(*contacts_on_box(extents, 80, seed=0), seed=0)
    field = Gpis.fit(points, normals, POINT_SIGMA_m, NORMAL_SIGMA_rad, thesis(kernel)).optimise(noise=True)
    mesh = extract_mesh(field, resolution_m=0.006)
    assert mesh.is_closed
    assert mesh_errors(mesh, trimesh.creation.box(extents)).mean_distance_m < 0.006


@pytest.mark.parametrize("kernel", KERNELS)
@pytest.mark.parametrize("distance_m", [0.003, 0.010])
def test_likelihood_gradients_hold_for_any_distance_of_the_labelled_points(kernel: str, distance_m: float) -> None:
    points, normals = noisy(*contacts_on_sphere(0.035, 15, 3, seed=1), seed=1)
    field = Gpis.fit(points, normals, POINT_SIGMA_m, 0.1, thesis(kernel, distance_m))
    found = field.log_marginal_likelihood_gradient()
    here = np.append(field.kernel.log_parameters, 0.0)
    for index, shift in enumerate(1e-4 * np.eye(len(here))):
        ahead, behind = (field.with_log_parameters(here + s * shift).log_marginal_likelihood() for s in (1, -1))
        assert found[index] == pytest.approx((ahead - behind) / 2e-4, rel=1e-4, abs=1e-3)


def test_a_contact_left_out_takes_its_points_off_the_surface_with_it() -> None:
    points, normals = noisy(*contacts_on_sphere(0.035, 12, 2, seed=2), seed=2)
    field = Gpis.fit(points, normals, POINT_SIGMA_m, 0.1, thesis("squared_exponential"))
    costs = field.leave_one_out_costs(np.arange(12))
    for index in range(12):
        others = np.delete(np.arange(12), index)
        without = field.refit(points[others], normals[others], np.full(11, POINT_SIGMA_m), np.full(11, 0.1))
        density = field.log_marginal_likelihood() - without.log_marginal_likelihood()
        assert costs[index] == pytest.approx(-density - 1.5 * np.log(2 * np.pi), abs=1e-6)


@pytest.mark.parametrize("kernel", KERNELS)
def test_the_contact_that_the_others_do_not_explain_costs_most(kernel: str) -> None:
    points, normals = noisy(*contacts_on_sphere(0.035, 40, 3, seed=3), seed=3)
    points[7] += 0.015 * normals[7]
    costs = Gpis.fit(points, normals, POINT_SIGMA_m, 0.1, thesis(kernel)).leave_one_out_costs(np.arange(40))
    assert costs.argmax() == 7
