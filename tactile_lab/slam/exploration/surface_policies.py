"""The thesis's policies for the shape: variance (4.20), entropy (4.10), IGEF (4.15), clusters (appendix B)."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

import numpy as np
from scipy.spatial import cKDTree

from drivers.core.contacts import Array
from tactile_lab.slam.exploration.candidates import Candidate
from tactile_lab.slam.exploration.information.igef import IgefMetrics, IgefSettings, igef
from tactile_lab.slam.exploration.information.surface_uncertainty import POINT_SIGMA_m, contact_entropy
from tactile_lab.slam.exploration.policy import (
    Belief,
    Decision,
    Surface,
    best_of,
    nothing_to_choose,
    surface_to_foresee,
)
from tactile_lab.slam.exploration.prediction import expected_touches, most_fingers, nominal_world
from tactile_lab.slam.exploration.regions import Region, RegionSettings, nearest_first, unexplored_regions
from tactile_lab.slam.shape.fields.gpis import Gpis

_BESIDE_m = 0.008
"""A contact this near to a region's vertices explores the region."""
_PATIENCE = 3
"""After this many fingers that met nothing in a region it ranks behind the others."""


@dataclass(frozen=True)
class RandomPolicy:
    """Chooses a candidate at random."""

    name: str = "random"

    def choose(self, candidates: Sequence[Candidate], belief: Belief, rng: np.random.Generator) -> Decision:
        if settled := nothing_to_choose(self.name, candidates, belief):
            return settled
        chosen = int(rng.integers(len(candidates)))
        return Decision(self.name, "grasp", chosen, (0.0,) * len(candidates), "chosen by chance, as asked")


Rating = Callable[[Belief, Surface, Sequence[Array]], Array]
"""Scores of all candidates, shape (c,), from where the contacts of each are expected, shape (m, d), m may be 0."""


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
        surface = surface_to_foresee(self.name, candidates, belief, rng)
        if isinstance(surface, Decision):
            return surface
        found = expected_contacts(candidates, belief, surface)
        touching = np.array([len(points) > 0 for points in found])
        if not touching.any():
            return best_of(self.name, np.full(len(candidates), -np.inf), self.reason, rng)
        scores = np.where(touching, self.rating(belief, surface, found), -np.inf)
        return best_of(self.name, scores, self.reason, rng)


@dataclass(frozen=True)
class ClustersPolicy:
    """The unexplored region nearest to the latest grasp (section 4.5.1); within it the reward (4.20)."""

    settings: RegionSettings = field(default_factory=RegionSettings)
    name: str = "clusters"

    def choose(self, candidates: Sequence[Candidate], belief: Belief, rng: np.random.Generator) -> Decision:
        surface = surface_to_foresee(self.name, candidates, belief, rng)
        if isinstance(surface, Decision):
            return surface
        found = expected_contacts(candidates, belief, surface)
        regions = self._in_turn(belief, surface)
        variances = variances_at(belief, found)
        for number, region in enumerate(regions):
            scores = _rewards_in(region, surface, found, variances)
            if scores.max() > 0:
                passed = f" ({number} nearer ones are out of reach)" if number else ""
                reason = f"explores the region nearest to the last grasp{passed}, {len(regions)} are unexplored"
                return best_of(self.name, np.where(scores > 0, scores, -np.inf), reason, rng)
        why = "no candidate reaches an unexplored region" if regions else "no region is unexplored"
        rewards = np.array([own.sum() if len(own) else -np.inf for own in variances])
        return best_of(self.name, rewards, f"{why}: the largest variance counts instead", rng)

    def _in_turn(self, belief: Belief, surface: Surface) -> list[Region]:
        """Nearest first; regions in which fingers repeatedly met nothing come last."""
        latest = belief.contacts_m[belief.latest_contacts]
        place = latest.mean(axis=0) if len(latest) else surface.points_m.mean(axis=0)
        ordered = nearest_first(unexplored_regions(surface, self.settings), place)
        return sorted(ordered, key=lambda region: _misses(region, surface, belief) >= _PATIENCE)


def expected_contacts(candidates: Sequence[Candidate], belief: Belief, surface: Surface) -> list[Array]:
    """Contacts of each candidate if everything is as estimated and executed as planned, object frame, each (m, d)."""
    world = nominal_world(belief, surface, most_fingers(candidates))
    touches = expected_touches(candidates, belief, world)
    return [points[0][met[0]] for points, met in zip(touches.points_m, touches.touching, strict=True)]


def variances_at(belief: Belief, found: Sequence[Array]) -> list[Array]:
    """The field's variance at every expected contact of every candidate, square metres."""
    together = np.concatenate(found)
    if len(together) == 0:
        return [np.empty(0) for _ in found]
    variances = np.asarray(belief.field.predict(together, variance=True).variance_m2)
    return np.split(variances, np.cumsum([len(points) for points in found])[:-1])


def variance_rating(belief: Belief, surface: Surface, found: Sequence[Array]) -> Array:
    """Equation 4.20: the sum of the field's variances at each candidate's contacts, square metres."""
    del surface
    return np.array([own.sum() for own in variances_at(belief, found)])


def entropy_rating(belief: Belief, surface: Surface, found: Sequence[Array]) -> Array:
    """Equation 4.10 of each candidate's contacts; of independent ones where the field knows no joint covariance."""
    del surface
    if not isinstance(belief.field, Gpis):
        return np.array([np.log1p(own / POINT_SIGMA_m**2).sum() for own in variances_at(belief, found)])
    joint = belief.field.joint_covariance(np.concatenate(found))
    ends = np.cumsum([len(points) for points in found])
    blocks = [joint[end - len(points) : end, end - len(points) : end] for points, end in zip(found, ends, strict=True)]
    return np.array([contact_entropy(block) for block in blocks])


def igef_rating(part: Callable[[IgefMetrics], Array], settings: IgefSettings) -> Rating:
    """Sum of (4.15), or of a part of it, over the expected contacts, seen from the latest grasp's contacts."""

    def rating(belief: Belief, surface: Surface, found: Sequence[Array]) -> Array:
        latest = belief.latest_contacts
        metrics = igef(surface, belief.contacts_m[latest], belief.normals[latest], np.concatenate(found), settings)
        owners = np.repeat(np.arange(len(found)), [len(points) for points in found])
        return np.asarray(np.bincount(owners, part(metrics), minlength=len(found)), dtype=float)

    return rating


def _rewards_in(region: Region, surface: Surface, found: Sequence[Array], variances: Sequence[Array]) -> Array:
    """Reward (4.20) of each candidate's contacts in a region, 0 where none is."""
    tree = cKDTree(surface.points_m[region.members])
    inside = [np.asarray(tree.query(points)[0] < _BESIDE_m) if len(points) else np.empty(0, bool) for points in found]
    return np.array([own[near].sum() for own, near in zip(variances, inside, strict=True)])


def _misses(region: Region, surface: Surface, belief: Belief) -> int:
    if len(belief.missed_m) == 0:
        return 0
    return int(np.sum(cKDTree(surface.points_m[region.members]).query(belief.missed_m)[0] < 2 * _BESIDE_m))
