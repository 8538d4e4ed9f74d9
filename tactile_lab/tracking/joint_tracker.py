"""Several hypotheses of the whole trajectory, each smoothed jointly with the shape integrated out.

The filter of algorithm 3.1 commits to one map grasp by grasp and can not take a wrong pose back. Here a
hypothesis is a whole trajectory, and the place of a particle's weight is taken by its evidence: the likelihood
of all contacts for these poses (:mod:`pose_evidence`), the motion model, and free space. Each grasp the best
hypotheses branch into the poses that the measurement proposes, are smoothed, compared, and the best are kept.
A contact that fits worse than a contact explained by nothing is left out; one more branch always leaves out all
contacts of a grasp. It wins where every placement would tear the shape or the motion, and is dropped when later
grasps tell better.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from pydantic import Field as Limit

from tactile_lab.geometry.contacts import Array
from tactile_lab.shape.field_grid import Field, FieldGrid
from tactile_lab.shape.polygon_segmentation import log_evidence
from tactile_lab.strict_yaml import StrictModel
from tactile_lab.tracking.contact_map import ContactMap, PlacedGrasp
from tactile_lab.tracking.contact_set import ContactSet
from tactile_lab.tracking.facet_smoothing import smoothed_with_faces
from tactile_lab.tracking.free_space import free_space_cost
from tactile_lab.tracking.motion import MotionNoise, compose, deviation
from tactile_lab.tracking.particle_filter import PoseEstimate
from tactile_lab.tracking.pose_evidence import PoseEvidence
from tactile_lab.tracking.proposals import ProposalSettings, fit_poses, propose

GRID_MARGIN_m = 0.040
GRID_SPACING_m = 0.003


class JointSettings(StrictModel):
    """Parameters of the hypotheses.

    Attributes:
        proposals: how poses are proposed.
        hypotheses: so many are kept from grasp to grasp.
        smoothed: so many of the branches, by evidence before smoothing, are smoothed.
        evidence_gap: hypotheses that much less likely than the best (natural logarithm) are given up.
        iterations: of the optimiser at each grasp.
        final_iterations: of the optimiser at the end.
    """

    proposals: ProposalSettings = ProposalSettings()
    hypotheses: int = Limit(default=4, ge=1)
    smoothed: int = Limit(default=6, ge=1)
    evidence_gap: float = Limit(default=25.0, gt=0)
    iterations: int = Limit(default=15, ge=1)
    final_iterations: int = Limit(default=80, ge=1)


@dataclass(frozen=True)
class Hypothesis:
    """A trajectory and the map it makes; ``cost`` is the negative log evidence."""

    map: ContactMap
    cost: float


class JointTracker:
    """Keeps the most likely trajectories."""

    def __init__(
        self,
        first: ContactMap,
        noise: MotionNoise,
        settings: JointSettings,
        kernel_every: int,
    ) -> None:
        self._noise, self._settings, self._kernel_every = noise, settings, kernel_every
        self._hypotheses = [self._rated(first)]
        self._branches: list[Hypothesis] = []
        self._motion = np.zeros(3)
        self.effective_count = 1.0

    @property
    def map(self) -> ContactMap:
        return self._hypotheses[0].map

    def predict(self, motion: Array) -> None:
        self._motion = motion

    def weigh(self, contacts: ContactSet) -> bool:
        """Branch every hypothesis into the poses proposed for this grasp, smooth the likeliest and rank them."""
        unplaced = [self._unplaced(hypothesis, contacts) for hypothesis in self._hypotheses]
        branches = self._likeliest(unplaced + self._branched(contacts), self._settings.smoothed)
        smoothed = [self._smoothed(branch, self._settings.iterations) for branch in branches]
        self._branches = self._likeliest(_different(smoothed), self._settings.hypotheses)
        weights = self._weights(self._branches)
        self.effective_count = float(1 / np.sum(weights**2))
        return self._branches[0].map.placed[-1].used

    def estimate(self) -> PoseEstimate:
        """The likeliest hypothesis's pose; the covariance holds its own and the spread of the hypotheses."""
        best = self._branches[0].map.placed[-1]
        away = deviation(np.array([branch.map.placed[-1].row for branch in self._branches]), best.row)
        spread = (away * self._weights(self._branches)[:, None]).T @ away
        return PoseEstimate(best.row, best.covariance + spread)

    def update_shape(self, contacts: ContactSet, certain: bool) -> None:
        """The branches hold the new contacts already, each hypothesis where it believes them to be."""
        best = self._branches[0]
        last = replace(best.map.placed[-1], covariance=self.estimate().covariance)
        self._branches[0] = replace(best, map=replace(best.map, placed=(*best.map.placed[:-1], last)))

    def resample(self) -> None:
        """Go on with the ranked branches; now and then with new kernel parameters, the same for all."""
        self._hypotheses = self._branches
        if len(self.map.placed) % self._kernel_every == 0:
            self._share_kernel(self.map.with_best_kernel())
            self._hypotheses = sorted((self._rated(one.map) for one in self._hypotheses), key=lambda one: one.cost)

    def adopt(self, corrected: ContactMap) -> None:
        self._hypotheses[0] = replace(self._hypotheses[0], map=corrected)

    def finish(self) -> None:
        """Smooth the remaining hypotheses to the end, kernel parameters included."""
        for _ in range(2):
            smoothed = [self._smoothed(hypothesis, self._settings.final_iterations) for hypothesis in self._hypotheses]
            self._hypotheses = self._likeliest(_different(smoothed), self._settings.hypotheses)
            self._share_kernel(self.map.with_best_kernel())
        self._hypotheses = sorted((self._with_faces(one) for one in self._hypotheses), key=lambda one: one.cost)

    def _with_faces(self, hypothesis: Hypothesis) -> Hypothesis:
        """The hypothesis with poses smoothed together with flat faces, if those explain its contacts better."""
        rated = self._rated(hypothesis.map)
        faceted = smoothed_with_faces(hypothesis.map, self._noise) if hypothesis.map.dimension == 2 else None
        if faceted is None:
            return rated
        moved = hypothesis.map.with_rows(faceted.rows)
        contacts = moved.contacts
        explained = log_evidence(
            faceted.chi_square, faceted.faces.count, contacts.point_sigma_m, contacts.normal_sigma_rad
        )
        constant = 0.5 * len(contacts) * (contacts.dimension + 1) * np.log(2 * np.pi)
        cost = faceted.motion_cost - explained - constant + self._other_costs(moved)
        return Hypothesis(moved, cost) if cost < rated.cost else rated

    def _unplaced(self, hypothesis: Hypothesis, contacts: ContactSet) -> Hypothesis:
        last = hypothesis.map.placed[-1]
        row, covariance = compose(self._motion, last.row), last.covariance + np.diag(self._noise.sigmas**2)
        grasp = PlacedGrasp(contacts, row, covariance, self._motion).put_aside()
        return self._rated(hypothesis.map.with_grasp(grasp))

    def _branched(self, contacts: ContactSet) -> list[Hypothesis]:
        """The likeliest continuations of all hypotheses, contacts that do not fit them left out.

        A grasp is only placed if most of its contacts fit: the rest could be anywhere by chance.
        """
        if len(contacts) == 0:
            return []
        proposed = [each for hypothesis in self._hypotheses for each in self._proposed(hypothesis, contacts)]
        promising = self._likeliest(proposed, 2 * self._settings.smoothed)
        latest = len(self.map.placed)
        cleaned = [self._without_outliers(branch.map, [latest]) for branch in promising]
        return [each for each in cleaned if 2 * len(each.map.placed[-1].kept) > len(contacts)]

    def _proposed(self, hypothesis: Hypothesis, contacts: ContactSet) -> list[Hypothesis]:
        """Continuations of a hypothesis, rated contact by contact only."""
        predicted = compose(self._motion, hypothesis.map.placed[-1].row)
        field, settings = self._field(hypothesis.map), self._settings.proposals
        noise = self._noise.accumulated(1 + _trailing_unplaced(hypothesis.map))
        rows, costs = propose(predicted, contacts, field, noise, settings)
        fit = fit_poses(rows, predicted, contacts, field, noise, settings)
        grasps = [
            PlacedGrasp(contacts, row, covariance, self._motion)
            for row, covariance in zip(rows, np.linalg.inv(fit.information), strict=True)
        ]
        return [
            Hypothesis(hypothesis.map.with_grasp(grasp), hypothesis.cost + float(cost))
            for grasp, cost in zip(grasps, costs, strict=True)
        ]

    @staticmethod
    def _field(contact_map: ContactMap) -> Field:
        """In the plane a coarse grid is cheaper than the field itself; in space it is not, for so few samples."""
        fitted = contact_map.fit()
        if fitted.contacts_m.shape[1] == 3:
            return fitted
        return FieldGrid.around(fitted, margin_m=GRID_MARGIN_m, spacing_m=GRID_SPACING_m)

    def _rated(self, contact_map: ContactMap) -> Hypothesis:
        evidence = PoseEvidence(contact_map, self._noise).value(contact_map.rows)
        return Hypothesis(contact_map, evidence + self._other_costs(contact_map))

    def _smoothed(self, hypothesis: Hypothesis, iterations: int) -> Hypothesis:
        """The poses of largest evidence nearby; once more if contacts turn out not to fit them."""
        smoothed = hypothesis.map.with_rows(
            PoseEvidence(hypothesis.map, self._noise).maximised(hypothesis.map.rows, iterations)[0]
        )
        cleaned = self._without_outliers(smoothed, range(len(smoothed.placed)))
        if cleaned.map is smoothed:
            return cleaned
        rows, cost = PoseEvidence(cleaned.map, self._noise).maximised(smoothed.rows, iterations)
        again = cleaned.map.with_rows(rows)
        return Hypothesis(again, cost + self._other_costs(again))

    def _without_outliers(self, contact_map: ContactMap, grasps: Sequence[int]) -> Hypothesis:
        """Leave out contacts of some grasps, the worst first, while they cost more than being explained by nothing."""
        while True:
            value, costs = PoseEvidence(contact_map, self._noise).value_and_leave_one_out_costs(contact_map.rows)
            costs[~np.isin(contact_map.grasp_indices, grasps)] = -np.inf
            worst = int(costs.argmax())
            if costs[worst] <= self._settings.proposals.unexplained_cost or len(costs) == 1:
                return Hypothesis(contact_map, value + self._other_costs(contact_map))
            contact_map = contact_map.without_contact(worst)

    def _other_costs(self, contact_map: ContactMap) -> float:
        """What the poses are judged by beside the contacts in place: free space and the contacts left out."""
        sigma_m = float(contact_map.placed[0].contacts_world.point_sigma_m.mean())
        free = free_space_cost(contact_map.fit(), contact_map.free_points_m, sigma_m)
        return free + self._settings.proposals.unexplained_cost * contact_map.left_out_count

    def _likeliest(self, hypotheses: list[Hypothesis], count: int) -> list[Hypothesis]:
        ranked = sorted(hypotheses, key=lambda hypothesis: hypothesis.cost)[:count]
        return [one for one in ranked if one.cost < ranked[0].cost + self._settings.evidence_gap]

    @staticmethod
    def _weights(hypotheses: list[Hypothesis]) -> Array:
        costs = np.array([hypothesis.cost for hypothesis in hypotheses])
        weights = np.exp(costs.min() - costs)
        return np.asarray(weights / weights.sum())

    def _share_kernel(self, best: ContactMap) -> None:
        self._hypotheses = [replace(one, map=replace(one.map, settings=best.settings)) for one in self._hypotheses]


def _trailing_unplaced(contact_map: ContactMap) -> int:
    """How many grasps in a row were left out last."""
    used = [grasp.used for grasp in reversed(contact_map.placed)]
    return used.index(True)


def _different(hypotheses: list[Hypothesis]) -> list[Hypothesis]:
    """The likeliest of those that ended at the same trajectory (within 0.5 mm and 0.6 degrees)."""
    kept: list[Hypothesis] = []
    for one in sorted(hypotheses, key=lambda hypothesis: hypothesis.cost):
        gaps = [np.abs(deviation(one.map.rows, other.map.rows)).max(axis=0) for other in kept]
        if all((gap > [0.0005, 0.0005, 0.01]).any() for gap in gaps):
            kept.append(one)
    return kept
