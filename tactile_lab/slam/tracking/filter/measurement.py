"""How well the contacts of a grasp fit the modelled surface, for every particle at once.

Two models of ``P(z_k | x_k)``:

- :class:`ThesisMeasurement`: equation 3.9 as printed, behind the gate of section 3.5.1.
- :class:`CalibratedMeasurement`: the field is close to a signed distance, so ``f / |grad f|`` is a distance in
  metres with a known variance, and the gradient predicts the normal. The map's own variance widens both: where nothing
  has been touched yet, contacts neither attract nor exclude.

All results are logarithms, minus infinity standing for a likelihood of zero.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal, Protocol

import numpy as np
from numpy.typing import NDArray
from pydantic import Field as Limit

from drivers.core.configuration import StrictModel
from drivers.core.contacts import Array
from drivers.core.observability import SCALE_m
from tactile_lab.slam.shape.fields.field_grid import Field
from tactile_lab.slam.tracking.contacts.contact_set import ContactSet
from tactile_lab.slam.tracking.contacts.pose_vectors import PLANAR

SMALLEST_SLOPE = 0.3
"""Far from all data the field flattens; distances are not divided by less than this slope."""

_BLOCK = 2048
"""So many particles at a time: what is computed in between stays in the processor's cache."""


@dataclass(frozen=True)
class Known:
    """The reference for a new grasp.

    Attributes:
        field: the modelled surface, object frame.
        previous: contacts of the grasp before, object frame.
        earlier: contacts of all grasps so far that are part of the shape, object frame; None: those of ``previous``.
    """

    field: Field
    previous: ContactSet
    earlier: ContactSet | None = None


class Measurement(Protocol):
    """A measurement model."""

    def log_likelihood(self, rows: Array, contacts: ContactSet, known: Known) -> Array:
        """``log P(z | x)`` for planar poses of shape (n, 3) and contacts in the world; shape (n,)."""


class GateSettings(StrictModel):
    """The gate of section 3.5.1 in the reading under which the thesis's filter does best (experiment
    ``thesis-readings``, decision 50); the thesis gives the number of contacts, the other values are this program's.

    Attributes:
        least_contacts: number of contacts that must be close to the reference.
        close_to: "previous" compares with the contacts of the previous grasp, "earlier" with those of all grasps
            before, "surface" with the modelled surface. The text allows all three.
        distance_m: largest distance of a close contact.
        normal_angle_rad: largest angle between the normals of close contacts.
        least_eigenvalue: smallest eigenvalue of (3.18) of the close contacts, lengths scaled by 30 mm.
    """

    least_contacts: int = Limit(default=4, ge=0)
    close_to: Literal["previous", "earlier", "surface"] = "surface"
    distance_m: float = Limit(default=0.005, gt=0)
    normal_angle_rad: float = Limit(default=float(np.deg2rad(40.0)), gt=0)
    least_eigenvalue: float = Limit(default=0.15, ge=0)


@dataclass(frozen=True)
class ThesisMeasurement:
    """Equation 3.9 with the four-contact gate.

    Attributes:
        gate: settings of the gate.
        label_distance_m: distance over which the thesis's field grows by one (its labels are +1 and -1 there);
            this program's field is in metres and is divided by it.
    """

    gate: GateSettings
    label_distance_m: float

    def log_likelihood(self, rows: Array, contacts: ContactSet, known: Known) -> Array:
        points, normals = PLANAR.to_object(rows[:, None], contacts.points_m, contacts.normals)
        values = known.field.predict(points.reshape(-1, contacts.dimension)).mean_m.reshape(len(rows), -1)
        matching = -np.abs(values / self.label_distance_m).sum(axis=1)  # the exponent of (3.9)
        return np.where(self._passes(points, normals, values, known), matching, -np.inf)

    def _passes(self, points: Array, normals: Array, values: Array, known: Known) -> NDArray[np.bool_]:
        """Whether there are enough close contacts, and these are observable."""
        if self.gate.close_to == "surface":
            close = np.abs(values) < self.gate.distance_m
        else:
            earlier = known.earlier if self.gate.close_to == "earlier" else None
            close = self._near(points, normals, earlier or known.previous)
        passes = np.asarray(close.sum(axis=1) >= self.gate.least_contacts)
        chosen = np.flatnonzero(passes)
        if len(chosen):
            eigenvalue = _smallest_eigenvalues(points[chosen], normals[chosen], close[chosen])
            passes[chosen] = eigenvalue >= self.gate.least_eigenvalue
        return passes

    def _near(self, points: Array, normals: Array, known: ContactSet) -> NDArray[np.bool_]:
        """Which contacts have a known one close by, with a similar normal."""
        least_cosine = np.cos(self.gate.normal_angle_rad)
        close = np.zeros(points.shape[:2], dtype=bool)
        for point, normal in zip(known.points_m, known.normals, strict=True):
            squared = np.sum((points - point) ** 2, axis=2)
            close |= (squared < self.gate.distance_m**2) & (normals @ normal > least_cosine)
        return close


class CalibratedSettings(StrictModel):
    """Parameters of the calibrated likelihood.

    Attributes:
        normal_length_m: a map uncertain by sigma predicts normals to ``sigma / normal_length_m`` radians.
        outlier_share: share of uninformative contacts (wrong finger part, wrong estimate); limits the influence of a
            single bad contact.
        outlier_range_m: such contacts are taken as uniform over this distance and all directions.
    """

    normal_length_m: float = Limit(default=0.016, gt=0)
    outlier_share: float = Limit(default=0.01, gt=0, lt=1)
    outlier_range_m: float = Limit(default=0.100, gt=0)


@dataclass(frozen=True)
class CalibratedMeasurement:
    """Distance and angle to the surface with their standard deviations, robust against outliers."""

    settings: CalibratedSettings

    def log_likelihood(self, rows: Array, contacts: ContactSet, known: Known) -> Array:
        blocks = np.array_split(rows, max(1, -(-len(rows) // _BLOCK)))
        return np.concatenate([self._of_block(block, contacts, known.field) for block in blocks])

    def _of_block(self, rows: Array, contacts: ContactSet, field: Field) -> Array:
        points, normals = PLANAR.to_object(rows[:, None], contacts.points_m, contacts.normals)
        found = field.predict(points.reshape(-1, contacts.dimension), gradient=True, variance=True)
        assert found.gradient is not None
        assert found.variance_m2 is not None
        shape = points.shape[:2]
        gradient = found.gradient.reshape(points.shape)
        per_contact = self._contact_terms(
            found.mean_m.reshape(shape), gradient, found.variance_m2.reshape(shape), normals, contacts
        )
        return np.asarray(per_contact.sum(axis=1))

    def _contact_terms(
        self, values: Array, gradient: Array, variance: Array, normals: Array, contacts: ContactSet
    ) -> Array:
        """Log likelihood of each contact in each particle, shape (n, m)."""
        slope = np.sqrt(np.einsum("nmd,nmd->nm", gradient, gradient))
        scale = np.maximum(slope, SMALLEST_SLOPE)
        distance_variance = contacts.point_sigma_m**2 + variance / scale**2
        cosine = np.einsum("nmd,nmd->nm", gradient, normals) / np.maximum(slope, 1e-9)
        angle_variance = contacts.normal_sigma_rad**2 + np.minimum(variance / self.settings.normal_length_m**2, 1.0)
        angles = contacts.dimension - 1
        log_density = -((values / scale) ** 2) / (2 * distance_variance) - (1 - cosine) / angle_variance
        log_density -= 0.5 * np.log(distance_variance) + 0.5 * angles * np.log(angle_variance)
        return np.asarray(np.logaddexp(log_density, self._log_outlier_density(angles)))

    def _log_outlier_density(self, angles: int) -> float:
        """Density of an uninformative contact, up to the constants left out of the other."""
        uniform = 1 / (self.settings.outlier_range_m * np.pi**angles)
        return float(np.log(self.settings.outlier_share * uniform) + 0.5 * (1 + angles) * np.log(2 * np.pi))


def _smallest_eigenvalues(points: Array, normals: Array, close: NDArray[np.bool_]) -> Array:
    """Smallest eigenvalue of (3.18) for planar motions, of the close contacts of each particle."""
    weights = close[..., None] / np.maximum(close.sum(axis=1), 1)[:, None, None]  # none close: nothing is observable
    arms = (points - (points * weights).sum(axis=1, keepdims=True))[..., :2] / SCALE_m
    turning = arms[..., 0] * normals[..., 1] - arms[..., 1] * normals[..., 0]
    rows = np.stack([turning, normals[..., 0], normals[..., 1]], axis=-1) * close[..., None]
    return np.asarray(np.linalg.eigvalsh(np.einsum("nmi,nmj->nij", rows, rows))[:, 0])
