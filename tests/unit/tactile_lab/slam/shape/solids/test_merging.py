"""Best planes of clusters: no other direction is better, and two clusters together are what their contacts are."""

from __future__ import annotations

import numpy as np
import pytest

from drivers.core.contacts import Array
from tactile_lab.slam.shape.solids.merging import fit_normals, merge_clusters
from tactile_lab.slam.shape.solids.planes import fit_planes, weighted_contacts


def chi_square(scatter: Array, pull: Array, u: Array) -> Array:
    return np.asarray(np.einsum("...i,ij,...j->...", u, scatter, u) - 2 * u @ pull)


@pytest.mark.parametrize("stiffness", [0.0, 1.0, 1e3, 1e6])
def test_no_direction_is_better_than_the_fitted_normal(stiffness: float) -> None:
    rng = np.random.default_rng(5)
    arms, pulls = rng.normal(size=(8, 4, 3)), 100 * rng.normal(size=(8, 3))
    scatters = stiffness * np.einsum("kni,knj->kij", arms, arms)
    others = rng.normal(size=(4000, 3))
    others /= np.linalg.norm(others, axis=1, keepdims=True)
    for scatter, pull, u in zip(scatters, pulls, fit_normals(scatters, pulls), strict=True):
        assert np.linalg.norm(u) == pytest.approx(1.0)
        near = u + 1e-4 * others
        near /= np.linalg.norm(near, axis=1, keepdims=True)
        least = min(chi_square(scatter, pull, others).min(), chi_square(scatter, pull, near).min())
        assert chi_square(scatter, pull, u) <= least + 1e-9 * abs(least)


def test_points_that_stray_along_the_normal_alone_tilt_their_plane_no_matter_how() -> None:
    """The direction is then not determined, but its misfit is."""
    scatter, pull = np.diag([0.0, 0.0, 1000.0]), np.array([0.0, 0.0, 100.0])
    (u,) = fit_normals(scatter[None], pull[None])
    assert chi_square(scatter, pull, u) == pytest.approx(1000 * 0.1**2 - 2 * 100 * 0.1, abs=1e-3)


@pytest.mark.parametrize("seed", range(5))
def test_a_merger_costs_what_the_plane_of_all_its_contacts_misses(seed: int) -> None:
    """Two noisy faces at an angle: they are merged exactly if the limit is above the cost."""
    rng = np.random.default_rng(seed)
    normals = np.repeat([[0.0, 0.0, 1.0], [0.0, np.sin(0.3), np.cos(0.3)]], 5, axis=0)
    points = rng.uniform(-0.03, 0.03, (10, 3)) * [1.0, 1.0, 0.0] + 0.0005 * rng.normal(size=(10, 3))
    points[5:, 2] -= np.tan(0.3) * points[5:, 1]
    contacts = weighted_contacts(points, normals, 1e-3, 0.09)
    apart, one = (fit_planes(contacts, labels) for labels in (np.repeat([0, 1], 5), np.zeros(10, np.int64)))
    cost = one.chi_square - apart.chi_square
    columns = contacts.points_m, contacts.normals, contacts.point_weights, contacts.normal_weights
    for limit, count in ((0.999 * cost, 2), (1.001 * cost, 1)):
        assert len(set(merge_clusters(*columns, limit, 0.0).tolist())) == count
