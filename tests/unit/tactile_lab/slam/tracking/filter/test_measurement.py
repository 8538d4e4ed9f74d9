"""Measurement models: eq. 3.9 with its gate, and the calibrated likelihood."""

from __future__ import annotations

import numpy as np
import pytest

from drivers.core.contacts import Array
from drivers.core.errors import ShapeError
from tactile_lab.slam.shape.fields.field_grid import FieldGrid
from tactile_lab.slam.shape.fields.gpis import Gpis
from tactile_lab.slam.shape.fields.posterior import Prediction
from tactile_lab.slam.tracking.contacts.contact_set import ContactSet
from tactile_lab.slam.tracking.contacts.motion import compose, inverse
from tactile_lab.slam.tracking.filter.measurement import (
    CalibratedMeasurement,
    CalibratedSettings,
    GateSettings,
    Known,
    ThesisMeasurement,
)

RADIUS_m = 0.030


class Disc:
    """The exact signed distance of a disc, with a given variance."""

    def __init__(self, variance_m2: float = 0.0) -> None:
        self._variance_m2 = variance_m2

    def predict(self, points_m: Array, *, gradient: bool = False, variance: bool = False) -> Prediction:
        radii = np.linalg.norm(points_m, axis=1)
        spread = np.full(len(points_m), self._variance_m2)
        return Prediction(radii - RADIUS_m, points_m / radii[:, None], spread)


def disc_contacts(angles_rad: list[float], offset_m: float = 0.0) -> ContactSet:
    outward = np.column_stack([np.cos(angles_rad), np.sin(angles_rad)])
    count = len(angles_rad)
    return ContactSet((RADIUS_m + offset_m) * outward, outward, np.full(count, 1e-3), np.full(count, 0.1))


AROUND = disc_contacts([0.1, 1.3, 2.5, 3.8, 5.0])
CORNERS = ContactSet(
    np.array([[50, 10], [50, -10], [-50, 0], [20, 30], [-20, -30]]) / 1000,
    np.array([[1, 0], [1, 0], [-1, 0], [0, 1], [0, -1]], dtype=float),
    np.full(5, 1e-3),
    np.full(5, 0.1),
)
NOWHERE = np.array([0.5, 0.5, 0.0])
PREVIOUS = GateSettings(close_to="previous", distance_m=0.015)


def test_equation_3_9_is_minus_the_sum_of_field_values() -> None:
    model = ThesisMeasurement(GateSettings(least_contacts=0, least_eigenvalue=0.0), label_distance_m=0.005)
    shifted = np.array([[0.0, 0.0, 0.0], [0.001, 0.0, 0.0]])
    found = model.log_likelihood(shifted, AROUND, Known(Disc(), AROUND))
    expected = -np.abs(np.linalg.norm(AROUND.points_m - shifted[1, :2], axis=1) - RADIUS_m).sum() / 0.005
    assert found[0] == pytest.approx(0.0, abs=1e-12)
    assert found[1] == pytest.approx(expected)


def test_the_gate_needs_four_contacts_near_the_previous_ones() -> None:
    model = ThesisMeasurement(PREVIOUS, label_distance_m=0.005)
    near, far = np.zeros(3), np.array([0.05, 0.0, 0.0])
    found = model.log_likelihood(np.array([near, far]), CORNERS, Known(Disc(), CORNERS))
    assert np.isfinite(found[0])
    assert found[1] == -np.inf


def test_a_gate_that_asks_for_no_contact_may_find_none() -> None:
    far = np.array([[0.5, 0.0, 0.0]])
    for least_eigenvalue, passes in ((0.0, True), (0.15, False)):
        gate = PREVIOUS.model_copy(update={"least_contacts": 0, "least_eigenvalue": least_eigenvalue})
        found = ThesisMeasurement(gate, 0.005).log_likelihood(far, CORNERS, Known(Disc(), CORNERS))
        assert np.isfinite(found[0]) == passes


def test_the_gate_compares_normals_too() -> None:
    model = ThesisMeasurement(PREVIOUS, label_distance_m=0.005)
    inward = ContactSet(CORNERS.points_m, -CORNERS.normals, CORNERS.point_sigma_m, CORNERS.normal_sigma_rad)
    assert model.log_likelihood(np.zeros((1, 3)), CORNERS, Known(Disc(), inward))[0] == -np.inf


def test_the_gate_refuses_close_contacts_that_are_not_observable() -> None:
    model = ThesisMeasurement(PREVIOUS, label_distance_m=0.005)
    assert model.log_likelihood(np.zeros((1, 3)), AROUND, Known(Disc(), AROUND))[0] == -np.inf


def test_the_gate_may_ask_for_contacts_of_any_grasp_before() -> None:
    elsewhere = ContactSet(CORNERS.points_m + 0.5, CORNERS.normals, CORNERS.point_sigma_m, CORNERS.normal_sigma_rad)
    both = ContactSet.concatenate([CORNERS, elsewhere])
    known = Known(Disc(), elsewhere, both)
    for close_to, passes in (("previous", False), ("earlier", True)):
        gate = PREVIOUS.model_copy(update={"close_to": close_to})
        found = ThesisMeasurement(gate, 0.005).log_likelihood(np.zeros((1, 3)), CORNERS, known)
        assert np.isfinite(found[0]) == passes


def test_the_gate_may_ask_the_surface_instead_of_the_previous_grasp() -> None:
    model = ThesisMeasurement(GateSettings(close_to="surface", least_eigenvalue=0.0), label_distance_m=0.005)
    rows = np.array([[0.0, 0.0, 0.0], NOWHERE])
    found = model.log_likelihood(rows, AROUND, Known(Disc(), CORNERS))
    assert np.isfinite(found[0])
    assert found[1] == -np.inf


def test_the_calibrated_likelihood_is_gaussian_near_the_surface() -> None:
    model = CalibratedMeasurement(CalibratedSettings(outlier_share=1e-9))
    near = model.log_likelihood(np.zeros((1, 3)), AROUND, Known(Disc(), AROUND))[0]
    off = model.log_likelihood(np.zeros((1, 3)), disc_contacts([0.1], 0.002), Known(Disc(), AROUND))[0]
    on = model.log_likelihood(np.zeros((1, 3)), disc_contacts([0.1]), Known(Disc(), AROUND))[0]
    assert on - off == pytest.approx(0.5 * (0.002 / 0.001) ** 2, rel=1e-6)
    assert near == pytest.approx(5 * on, rel=1e-6)


def test_an_uncertain_map_neither_attracts_nor_forbids() -> None:
    model = CalibratedMeasurement(CalibratedSettings())
    rows = np.array([[0.0, 0.0, 0.0], [0.004, 0.0, 0.0]])
    sharp = model.log_likelihood(rows, AROUND, Known(Disc(), AROUND))
    vague = model.log_likelihood(rows, AROUND, Known(Disc(0.02**2), AROUND))
    assert sharp[0] - sharp[1] > 10 * (vague[0] - vague[1]) > 0


def test_one_wild_contact_does_not_decide() -> None:
    model = CalibratedMeasurement(CalibratedSettings())
    points = AROUND.points_m.copy()
    points[0] += 0.2
    wild = ContactSet(points, AROUND.normals, AROUND.point_sigma_m, AROUND.normal_sigma_rad)
    good = model.log_likelihood(np.zeros((1, 3)), AROUND, Known(Disc(), AROUND))[0]
    assert good - model.log_likelihood(np.zeros((1, 3)), wild, Known(Disc(), AROUND))[0] < 25.0


def test_both_models_do_not_depend_on_where_the_world_is() -> None:
    move = np.array([0.3, -0.2, 1.1])
    rows = np.array([[0.0, 0.0, 0.0], [0.002, 0.001, 0.05]])
    world = CORNERS.in_object_frame(inverse(move))
    for model in (ThesisMeasurement(GateSettings(), 0.005), CalibratedMeasurement(CalibratedSettings())):
        here = model.log_likelihood(rows, CORNERS, Known(Disc(), CORNERS))
        there = model.log_likelihood(compose(move, rows), world, Known(Disc(), CORNERS))
        assert np.allclose(here, there)


@pytest.mark.parametrize("dimension", [2, 3])
def test_particles_weigh_the_same_whatever_their_number(dimension: int) -> None:
    rng = np.random.default_rng(1)
    normals = rng.normal(size=(9, dimension))
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    contacts = ContactSet(RADIUS_m * normals, normals, np.full(9, 1e-3), np.linspace(0.05, 0.2, 9))
    grid = FieldGrid.around(Gpis.fit(contacts.points_m, contacts.normals), margin_m=0.01, spacing_m=0.005)
    rows = rng.normal(size=(4100, 3)) * [0.02, 0.02, 2.0]
    model = CalibratedMeasurement(CalibratedSettings())
    in_one = model.log_likelihood(rows, contacts, Known(grid, contacts))
    in_parts = [model.log_likelihood(part, contacts, Known(grid, contacts)) for part in np.array_split(rows, 10)]
    np.testing.assert_allclose(in_one, np.concatenate(in_parts), rtol=1e-12, atol=1e-10)


def test_weighting_keeps_its_range_with_very_many_contacts() -> None:
    many = disc_contacts(list(np.linspace(0, 6, 600)))
    grid = FieldGrid.around(Gpis.fit(AROUND.points_m, AROUND.normals))
    model = CalibratedMeasurement(CalibratedSettings())
    found = model.log_likelihood(np.zeros((5, 3)), many, Known(grid, AROUND))
    assert np.isfinite(found).all()
    assert found[0] == pytest.approx(model.log_likelihood(np.zeros((1, 3)), many, Known(grid, AROUND))[0])


def test_a_grid_without_variances_can_not_weigh() -> None:
    grid = FieldGrid.around(Gpis.fit(AROUND.points_m, AROUND.normals), variance=False)
    with pytest.raises(ShapeError, match="without variances"):
        CalibratedMeasurement(CalibratedSettings()).log_likelihood(np.zeros((1000, 3)), AROUND, Known(grid, AROUND))


def test_a_grid_weighs_like_the_field_itself() -> None:
    gpis = Gpis.fit(AROUND.points_m, AROUND.normals, AROUND.point_sigma_m, AROUND.normal_sigma_rad)
    rows = np.random.default_rng(0).normal(size=(200, 3)) * [0.004, 0.004, 0.1]
    model = CalibratedMeasurement(CalibratedSettings())
    exact = model.log_likelihood(rows, AROUND, Known(gpis, AROUND))
    gridded = model.log_likelihood(rows, AROUND, Known(FieldGrid.around(gpis, spacing_m=0.001), AROUND))
    assert np.abs(exact - gridded).max() < 0.2
