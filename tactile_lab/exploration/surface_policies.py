"""The thesis's policies for the shape: variance (4.20), entropy (4.10), IGEF (4.15), clusters (appendix B)."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

import numpy as np
from scipy.spatial import cKDTree

from tactile_lab.exploration.candidates import Candidate
from tactile_lab.exploration.information.igef import IgefMetrics, IgefSettings, igef
from tactile_lab.exploration.information.surface_uncertainty import contact_entropy
from tactile_lab.exploration.policy import Belief, Decision, Surface, best_of, nothing_to_choose
from tactile_lab.exploration.prediction import expected_touches, most_fingers, nominal_world
from tactile_lab.exploration.regions import Region, RegionSettings, nearest_first, unexplored_regions
from tactile_lab.geometry.contacts import Array
from tactile_lab.shape.gpis import Gpis

_BESIDE_m = 0.008
"""A contact this near to a region's vertices explores the region."""
_PATIENCE = 3
"""So many fingers that met nothing in a region put it behind the others."""
_NOTHING_YET = "the contacts enclose nothing yet, so nothing can be foreseen"


@dataclass(frozen=True)
class RandomPolicy:
    """Any candidate, all alike."""

    name: str = "random"

    def choose(self, candidates: Sequence[Candidate], belief: Belief, rng: np.random.Generator) -> Decision:
        if settled := nothing_to_choose(self.name, candidates, belief):
            return settled
        chosen = int(rng.integers(len(candidates)))
        return Decision(self.name, "grasp", chosen, (0.0,) * len(candidates), "chosen by chance, as asked")


Rating = Callable[[Belief, Surface, Array], float]
"""Score of a candidate from where its contacts are expected, shape (m, d), m at least 1."""


@dataclass(frozen=True)
class ContactsPolicy:
    """Rates each candidate by where its contacts are expected on the estimated surface.

    Attributes:
        name: of the policy.
        rating: of a candidate's expected contacts.
        reason: for the winner.
    """

    name: str
    rating: Rating
    reason: str

    def choose(self, candidates: Sequence[Candidate], belief: Belief, rng: np.random.Generator) -> Decision:
        if settled := nothing_to_choose(self.name, candidates, belief):
            return settled
        if belief.surface is None:
            return best_of(self.name, np.zeros(len(candidates)), _NOTHING_YET, rng)
        surface = belief.surface
        found = expected_contacts(candidates, belief, surface)
        scores = [self.rating(belief, surface, points) if len(points) else -np.inf for points in found]
        return best_of(self.name, np.array(scores), self.reason, rng)


@dataclass(frozen=True)
class ClustersPolicy:
    """The unexplored region nearest to the latest grasp (section 4.5.1); within it the reward (4.20)."""

    settings: RegionSettings = field(default_factory=RegionSettings)
    name: str = "clusters"

    def choose(self, candidates: Sequence[Candidate], belief: Belief, rng: np.random.Generator) -> Decision:
        if settled := nothing_to_choose(self.name, candidates, belief):
            return settled
        if belief.surface is None:
            return best_of(self.name, np.zeros(len(candidates)), _NOTHING_YET, rng)
        surface = belief.surface
        found = expected_contacts(candidates, belief, surface)
        regions = self._in_turn(belief, surface)
        for number, region in enumerate(regions):
            scores = np.array([_reward_in(region, surface, belief, points) for points in found])
            if scores.max() > 0:
                passed = f" ({number} nearer ones are out of reach)" if number else ""
                reason = f"explores the region nearest to the last grasp{passed}, {len(regions)} are unexplored"
                return best_of(self.name, np.where(scores > 0, scores, -np.inf), reason, rng)
        why = "no candidate reaches an unexplored region" if regions else "no region is unexplored"
        rewards = [variance_at(belief, surface, points) if len(points) else -np.inf for points in found]
        return best_of(self.name, np.array(rewards), f"{why}: the largest variance counts instead", rng)

    def _in_turn(self, belief: Belief, surface: Surface) -> list[Region]:
        """Nearest first; regions in which fingers have met nothing again and again come last."""
        latest = belief.contacts_m[belief.latest_contacts]
        place = latest.mean(axis=0) if len(latest) else surface.points_m.mean(axis=0)
        ordered = nearest_first(unexplored_regions(surface, self.settings), place)
        return sorted(ordered, key=lambda region: _misses(region, surface, belief) >= _PATIENCE)


def expected_contacts(candidates: Sequence[Candidate], belief: Belief, surface: Surface) -> list[Array]:
    """Where each candidate touches if all is as estimated and executed as planned, object frame, each (m, d)."""
    world = nominal_world(belief, surface, most_fingers(candidates))
    touches = expected_touches(candidates, belief, world)
    return [points[0][met[0]] for points, met in zip(touches.points_m, touches.touching, strict=True)]


def variance_at(belief: Belief, surface: Surface, points_m: Array) -> float:
    """Equation 4.20: the sum of the field's variances, square metres."""
    del surface
    return float(np.sum(belief.field.predict(points_m, variance=True).variance_m2))


def entropy_at(belief: Belief, surface: Surface, points_m: Array) -> float:
    """Equation 4.10 for fields that know their joint covariance, else the same of independent contacts."""
    if isinstance(belief.field, Gpis):
        return contact_entropy(belief.field, points_m)
    del surface
    variances = np.asarray(belief.field.predict(points_m, variance=True).variance_m2)
    return float(np.sum(np.log1p(variances / 1e-6)))


def igef_rating(part: Callable[[IgefMetrics], Array], settings: IgefSettings) -> Rating:
    """Sum of (4.15), or of a part of it, over the expected contacts, seen from the latest grasp's contacts."""

    def rating(belief: Belief, surface: Surface, points_m: Array) -> float:
        latest = belief.latest_contacts
        metrics = igef(surface, belief.contacts_m[latest], belief.normals[latest], points_m, settings)
        return float(np.sum(part(metrics)))

    return rating


def _reward_in(region: Region, surface: Surface, belief: Belief, points_m: Array) -> float:
    """Reward of the contacts that lie in a region; 0 if none does."""
    if len(points_m) == 0:
        return 0.0
    inside = np.asarray(cKDTree(surface.points_m[region.members]).query(points_m)[0] < _BESIDE_m)
    return variance_at(belief, surface, points_m[inside]) if inside.any() else 0.0


def _misses(region: Region, surface: Surface, belief: Belief) -> int:
    if len(belief.missed_m) == 0:
        return 0
    return int(np.sum(cKDTree(surface.points_m[region.members]).query(belief.missed_m)[0] < 2 * _BESIDE_m))
