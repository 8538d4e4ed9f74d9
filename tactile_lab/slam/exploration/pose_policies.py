"""The thesis's policies for shape and pose (section 4.5.2.2): for an uncertain pose first, then by (4.20).

While the determinant of the pose's covariance is above a threshold, every candidate's contacts are predicted by the
estimate, the particles are weighted by them, and the candidate with the most informative weighting wins: det (4.21),
its form for several modes (section 4.6), KL (4.6), mutual information (4.5), or Renyi's entropy (4.4).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from pydantic import Field

from drivers.core.configuration import StrictModel
from drivers.core.contacts import Array
from tactile_lab.slam.exploration.candidates import Candidate, outward
from tactile_lab.slam.exploration.information.distributions import kl_divergence, mutual_information, renyi_entropy
from tactile_lab.slam.exploration.information.particles import determinant, mixture_entropy, modes, weighted_covariance
from tactile_lab.slam.exploration.policy import Belief, Decision, Policy, best_of, nothing_to_choose
from tactile_lab.slam.exploration.prediction import sampled_poses
from tactile_lab.slam.exploration.surface_policies import expected_contacts
from tactile_lab.slam.shape.fields.field_grid import FieldGrid
from tactile_lab.slam.tracking.contacts.contact_set import ContactSet, planar_rotation
from tactile_lab.slam.tracking.contacts.motion import pose_vector
from tactile_lab.slam.tracking.filter.measurement import CalibratedMeasurement, CalibratedSettings, Known

_SMALLEST = 1e-30
_RENYI_ORDER = 2.0
_MARGIN_m = 0.030


class PoseSwitchSettings(StrictModel):
    """When a policy acts for the pose, and how it simulates measurements.

    Attributes:
        translation_m, rotation_rad: the threshold is the determinant of a pose known to these standard deviations.
        particles: number weighted for each candidate.
        point_sigma_m, normal_sigma_rad: of a simulated contact.
        contour_grid_m, surface_grid_m: spacing of the grid on which the particles look the surface up.
        likelihood: the calibrated measurement model.
    """

    translation_m: float = Field(default=0.003, gt=0)
    rotation_rad: float = Field(default=float(np.deg2rad(5.0)), gt=0)
    particles: int = Field(default=500, ge=10)
    point_sigma_m: float = Field(default=0.001, gt=0)
    normal_sigma_rad: float = Field(default=float(np.deg2rad(5.0)), gt=0)
    contour_grid_m: float = Field(default=0.004, gt=0)
    surface_grid_m: float = Field(default=0.010, gt=0)
    likelihood: CalibratedSettings = CalibratedSettings()

    @property
    def threshold(self) -> float:
        """Determinant of the covariance above which the pose counts as uncertain, m^4 rad^2."""
        return self.translation_m**4 * self.rotation_rad**2


Gain = Callable[[Array, Array, Array], float]
"""The information of a weighting, from the particles (p, 3) and their weights before and after."""


def determinant_gain(rows: Array, before: Array, after: Array) -> float:
    """Reduction of the determinant of (4.21): half the difference of logarithms, nats."""
    found = [determinant(weighted_covariance(rows, weights)) + _SMALLEST for weights in (before, after)]
    return float(0.5 * np.log(found[0] / found[1]))


def mixture_gain(rows: Array, before: Array, after: Array) -> float:
    """Reduction of the entropy of the particles as several Gaussians, nats."""
    return mixture_entropy(modes(rows, before)) - mixture_entropy(modes(rows, after))


def kl_gain(rows: Array, before: Array, after: Array) -> float:
    """Equation 4.6 of the weighted against the present particles: finite where a contact excludes some of them."""
    del rows
    return kl_divergence(after, before)


def information_gain(rows: Array, before: Array, after: Array) -> float:
    """Equation 4.5 with the entropy (4.3) of the weights."""
    del rows
    return mutual_information(before, after)


def renyi_gain(rows: Array, before: Array, after: Array) -> float:
    """The same with Renyi's entropy (4.4 by its standard definition) of order 2."""
    del rows
    return renyi_entropy(before, _RENYI_ORDER) - renyi_entropy(after, _RENYI_ORDER)


@dataclass(frozen=True)
class PoseSwitchPolicy:
    """Above the threshold for the pose, below it as another policy.

    Attributes:
        name: of the policy.
        gain: of a simulated weighting.
        otherwise: chooses while the pose is known well enough.
        settings: the threshold and the simulated measurements.
    """

    name: str
    gain: Gain
    otherwise: Policy
    settings: PoseSwitchSettings = field(default_factory=PoseSwitchSettings)

    def choose(self, candidates: Sequence[Candidate], belief: Belief, rng: np.random.Generator) -> Decision:
        if settled := nothing_to_choose(self.name, candidates, belief):
            return settled
        uncertain = determinant(belief.pose_covariance) > self.settings.threshold
        if not uncertain or belief.surface is None:
            return self._for_shape(candidates, belief, rng)
        scores = self._pose_scores(candidates, belief, rng)
        x_mm, y_mm, yaw_deg = np.sqrt(np.maximum(np.diag(belief.pose_covariance), 0)) * [1e3, 1e3, 180 / np.pi]
        sigmas = f"{x_mm:.0f} mm, {y_mm:.0f} mm, {yaw_deg:.0f} deg"
        reason = f"the pose is uncertain ({sigmas}): this grasp is the most informative"
        return best_of(self.name, scores, reason, rng)

    def _for_shape(self, candidates: Sequence[Candidate], belief: Belief, rng: np.random.Generator) -> Decision:
        chosen = self.otherwise.choose(candidates, belief, rng)
        reason = f"the pose is known well enough: {chosen.reason}" if belief.surface is not None else chosen.reason
        return replace(chosen, policy=self.name, reason=reason)

    def _pose_scores(self, candidates: Sequence[Candidate], belief: Belief, rng: np.random.Generator) -> Array:
        simulated = simulate_weights(candidates, belief, self.settings, rng)
        before = np.full(len(simulated.rows), 1.0 / len(simulated.rows))
        gains = [-np.inf if after is None else self.gain(simulated.rows, before, after) for after in simulated.weights]
        return np.array(gains)


@dataclass(frozen=True)
class SimulatedWeights:
    """What the particles would weigh after each candidate's expected contacts.

    Attributes:
        rows: the particles, equally probable before, rows (x m, y m, yaw rad), shape (p, 3).
        weights: of each candidate, shape (p,), largest 1; None for one that is expected to touch nothing.
    """

    rows: Array
    weights: tuple[Array | None, ...]


def simulate_weights(
    candidates: Sequence[Candidate], belief: Belief, settings: PoseSwitchSettings, rng: np.random.Generator
) -> SimulatedWeights:
    """Weigh sampled poses by the contacts that the estimate expects of each candidate; the belief has a surface."""
    assert belief.surface is not None
    rows, known = sampled_poses(belief, settings.particles, rng), _tabulate_surface(belief, settings)
    weights = [
        _weigh(rows, imagine(points, belief, settings), known, settings) if len(points) else None
        for points in expected_contacts(candidates, belief, belief.surface)
    ]
    return SimulatedWeights(rows, tuple(weights))


def weigh(rows: Array, contacts: ContactSet, belief: Belief, settings: PoseSwitchSettings) -> Array:
    """Weights of particles, rows of shape (p, 3), after contacts in the world; shape (p,), the largest is 1."""
    return _weigh(rows, contacts, _tabulate_surface(belief, settings), settings)


def _weigh(rows: Array, contacts: ContactSet, known: Known, settings: PoseSwitchSettings) -> Array:
    log_likelihood = CalibratedMeasurement(settings.likelihood).log_likelihood(rows, contacts, known)
    return np.asarray(np.exp(log_likelihood - log_likelihood.max()))


def imagine(points_m: Array, belief: Belief, settings: PoseSwitchSettings) -> ContactSet:
    """Contacts in the world as the estimate expects them, at points of shape (m, d) in the object frame."""
    row = pose_vector(belief.world_T_object)
    turn = planar_rotation(float(row[2]))
    places, directions = points_m.copy(), outward(belief.field, points_m)
    places[:, :2] = points_m[:, :2] @ turn.T + row[:2]
    directions[:, :2] = directions[:, :2] @ turn.T
    count = len(points_m)
    return ContactSet(
        places, directions, np.full(count, settings.point_sigma_m), np.full(count, settings.normal_sigma_rad)
    )


def _tabulate_surface(belief: Belief, settings: PoseSwitchSettings) -> Known:
    """The surface tabulated for many particles; grids that are given as such are used."""
    nothing = ContactSet(belief.contacts_m[:0], belief.normals[:0], np.empty(0), np.empty(0))
    if isinstance(belief.field, FieldGrid):
        return Known(belief.field, nothing)
    lower, upper = belief.contacts_m.min(axis=0) - _MARGIN_m, belief.contacts_m.max(axis=0) + _MARGIN_m
    spacing_m = settings.contour_grid_m if belief.dimension == 2 else settings.surface_grid_m
    grid = FieldGrid.tabulate(belief.field, lower, upper, spacing_m, gradient=True, variance=True, variance_step=2)
    return Known(grid, nothing)
