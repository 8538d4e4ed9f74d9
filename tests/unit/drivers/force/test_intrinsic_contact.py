"""A contact on an ellipsoid, told by a wrench (protocols: Contact from a wrench)."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from drivers.core.contacts import Array
from drivers.force.intrinsic_contact import contact_covariance, contact_jacobian, contact_on_ellipsoid, wrench_transform

SHELLS_m = [np.array(axes) for axes in ([0.0095, 0.0095, 0.016], [0.0085, 0.0085, 0.013], [0.01, 0.01, 0.01])]


def random_contacts(rng: np.random.Generator, n: int, axes: Array, twist_m: float) -> tuple[Array, ...]:
    """Points, outward normals, forces inside a friction cone of 0.9 and torsions up to ``twist_m`` a newton."""
    direction = rng.normal(size=(n, 3))
    points = direction / np.linalg.norm(direction, axis=1, keepdims=True) * axes
    normals = points / axes**2
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    across = np.cross(normals, rng.normal(size=(n, 3)))
    across /= np.linalg.norm(across, axis=1, keepdims=True)
    forces = (-normals + 0.9 * rng.uniform(size=(n, 1)) * across) * 10 ** rng.uniform(-1.5, 1.0, (n, 1))
    torsions = twist_m * rng.uniform(-1, 1, n) * np.linalg.norm(forces, axis=1)
    return points, normals, forces, torsions


def test_the_golden_contact_is_found(lab_data: Path) -> None:
    golden = json.loads((lab_data / "golden_vectors.json").read_text())["intrinsic_contact"]
    moment_Nm = 1e-3 * np.array(golden["m_Nmm_about_centre"])
    contact = contact_on_ellipsoid(np.array(golden["f_N"]), moment_Nm, 1e-3 * np.array(golden["semi_axes_mm"]))
    np.testing.assert_allclose(1e3 * contact.point_m, golden["contact_mm"], atol=1e-7)
    np.testing.assert_allclose(contact.normal, golden["outward_normal"], atol=1e-7)
    assert 1e3 * contact.torsion_Nm == pytest.approx(golden["normal_torque_Nmm"], abs=1e-7)


@settings(max_examples=25, derandomize=True, deadline=None)
@given(
    seed=st.integers(0, 10_000),
    axes=st.sampled_from(SHELLS_m),
    twist_m=st.sampled_from([0.0, 1e-15, 1e-9, 1e-5, 1e-3, 0.01]),
)
def test_any_contact_inside_the_friction_cone_is_recovered(seed: int, axes: Array, twist_m: float) -> None:
    points, normals, forces, torsions = random_contacts(np.random.default_rng(seed), 200, axes, twist_m)
    found = contact_on_ellipsoid(forces, np.cross(points, forces) + torsions[:, None] * normals, axes)
    np.testing.assert_allclose(found.point_m, points, rtol=0, atol=1e-9)
    np.testing.assert_allclose(found.normal, normals, rtol=0, atol=1e-7)
    np.testing.assert_allclose(found.torsion_Nm, torsions, rtol=0, atol=1e-9)
    assert np.all(found.force_angle_rad < np.arctan(0.9) + 1e-9)


def test_without_twist_the_contact_is_where_the_axis_enters_the_surface() -> None:
    axes = SHELLS_m[0]
    force, through = np.array([0.1, 0.2, -1.0]), np.array([0.002, -0.001, 0.0])
    contact = contact_on_ellipsoid(force, np.cross(through, force), axes)
    on_axis = np.cross(contact.point_m - through, force)
    np.testing.assert_allclose(on_axis, 0.0, atol=1e-16)
    assert contact.normal @ force < 0
    assert contact.point_m[2] > 0


def test_an_axis_past_the_surface_is_told_by_its_distance_and_a_sliding_force() -> None:
    force, through = np.array([0.0, 0.0, -1.0]), np.array([0.02, 0.0, 0.0])
    contact = contact_on_ellipsoid(force, np.cross(through, force), SHELLS_m[2])
    assert contact.axis_distance == pytest.approx(2.0)
    assert contact.force_angle_rad == pytest.approx(np.pi / 2)
    assert np.linalg.norm(contact.point_m) == pytest.approx(0.01)


@pytest.mark.parametrize("moment", [[0.0, 0.0, 0.0], [0.0, 0.0, 1e-3]])
def test_no_force_means_no_contact_point(moment: list[float]) -> None:
    assert np.isnan(contact_on_ellipsoid(np.zeros(3), np.array(moment), SHELLS_m[0]).point_m).all()


def test_a_very_long_axis_is_a_cylinder() -> None:
    force, point = np.array([0.3, 0.2, -1.0]), np.array([0.0, 0.011, 0.04])
    contact = contact_on_ellipsoid(force, np.cross(point, force), np.array([0.04, 1.0, 0.04]))
    np.testing.assert_allclose(contact.point_m, point, atol=5e-6)


def test_the_jacobian_is_the_derivative_of_the_solution() -> None:
    axes = SHELLS_m[0]
    points, normals, forces, torsions = random_contacts(np.random.default_rng(3), 300, axes, 0.002)
    wrenches = np.hstack([forces, np.cross(points, forces) + torsions[:, None] * normals])
    jacobian = contact_jacobian(contact_on_ellipsoid(forces, wrenches[:, 3:], axes), forces, axes)
    for axis in range(6):
        step = np.zeros_like(wrenches)
        step[:, axis] = 1e-6 * np.linalg.norm(forces, axis=1) * (1.0 if axis < 3 else axes[0])
        ahead, behind = (contact_on_ellipsoid(w[:, :3], w[:, 3:], axes) for w in (wrenches + step, wrenches - step))
        numeric = (ahead.point_m - behind.point_m) / (2 * step[:, axis, None])
        error = np.abs(numeric - jacobian[:, :, axis]) / np.abs(jacobian).max(axis=(1, 2))[:, None]
        assert error.max() < 1e-6


def test_the_covariance_is_that_of_noisy_wrenches() -> None:
    axes, rng = SHELLS_m[1], np.random.default_rng(1)
    points, normals, forces, _ = random_contacts(rng, 1, axes, 0.0)
    force = forces[0] / np.linalg.norm(forces[0])
    wrench = np.concatenate([force, np.cross(points[0], force)])
    covariance = np.diag(np.repeat([0.01, 5e-5], 3) ** 2)
    noisy = wrench + rng.multivariate_normal(np.zeros(6), covariance, 40_000)
    cloud = contact_on_ellipsoid(noisy[:, :3], noisy[:, 3:], axes)
    contact = contact_on_ellipsoid(force, wrench[3:], axes)
    point, normal = contact_covariance(contact, force, axes, covariance)
    assert np.linalg.norm(point - np.cov(cloud.point_m.T)) < 0.05 * np.linalg.norm(point)
    assert np.linalg.norm(normal - np.cov(cloud.normal.T)) < 0.05 * np.linalg.norm(normal)
    assert normals[0] @ point @ normals[0] < 1e-12  # the point stays on the surface


def test_the_covariance_stays_finite_where_the_force_grazes() -> None:
    axes, force = SHELLS_m[0], np.array([0.0, 0.0, -1.0])
    contact = contact_on_ellipsoid(force, np.cross([axes[0], 0.0, 0.0], force), axes)
    point, _ = contact_covariance(contact, force, axes, 1e-6 * np.eye(6))
    assert np.linalg.eigvalsh(point).max() <= axes.max() ** 2 * (1 + 1e-9)


def test_a_wrench_moves_to_another_frame() -> None:
    rotation = np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
    origin, force, point = np.array([0.0, 0.0, 0.004]), np.array([1.0, 2.0, 3.0]), np.array([0.001, 0.002, 0.01])
    moved = wrench_transform(rotation, origin) @ np.concatenate([force, np.cross(point, force)])
    expected = rotation @ force
    np.testing.assert_allclose(moved, [*expected, *np.cross(rotation @ point + origin, expected)])
