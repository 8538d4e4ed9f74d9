"""Hypotheses of the whole trajectory, and their scores.

The cost of a hypothesis is the negative logarithm of its evidence: the likelihood of all contacts for these poses,
the shape integrated out (:mod:`pose_evidence`), the motion model, free space, and a price for every contact that is
left out because a contact explained by nothing costs less than this one does.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.special import gammaln

from drivers.core.contacts import Array
from tactile_lab.slam.tracking.contacts.contact_map import ContactMap, Moved, PlacedGrasp
from tactile_lab.slam.tracking.contacts.free_space import free_space_costs
from tactile_lab.slam.tracking.contacts.motion import MotionNoise
from tactile_lab.slam.tracking.contacts.pose_vectors import PoseVectors
from tactile_lab.slam.tracking.evidence.fixed_lag import condense
from tactile_lab.slam.tracking.evidence.motion_cost import MotionCost, pushed_nats
from tactile_lab.slam.tracking.evidence.pose_evidence import PoseEvidence
from tactile_lab.slam.tracking.joint.mechanisms import Mechanisms

_EXPECTED_RIGHT = 99.0
"""Prior number of right contacts per wrong one."""

_BREAK_COST = 20.0
"""Negative log probability that the object moves independently of the hand."""

_REMEMBERED = 8
"""Number of maps whose information matrix is cached, for pairwise comparison of trajectories."""

_SAME_TRANSLATION_m = 0.001
_SAME_ROTATION_rad = 0.03
_SAME_VALLEY = 0.5
"""Trajectories count as equal if their squared Mahalanobis distance per component is below this: poses that the data do
not distinguish differ by two on average.
"""


@dataclass(frozen=True)
class Hypothesis:
    """A trajectory and the map it makes.

    Attributes:
        map: poses and contacts.
        misfit: negative log posterior of the poses and the contacts that are part of the shape.
        intrusion: negative log probability that free places are free.
        left_out: cost of the contacts that are left out.
    """

    map: ContactMap
    misfit: float
    intrusion: float
    left_out: float

    @property
    def cost(self) -> float:
        """Negative log evidence."""
        return self.misfit + self.intrusion + self.left_out + self.map.settled_cost


class HypothesisScorer:
    """Scores, smooths and cleans hypotheses."""

    def __init__(self, noise: MotionNoise, unexplained_cost: float, mechanisms: Mechanisms | None = None) -> None:
        """
        Args:
            noise: of the motion model.
            unexplained_cost: negative log likelihood of a contact that nothing explains.
            mechanisms: which are on; None for all.
        """
        self._noise, self._unexplained_cost = noise, unexplained_cost
        self._mechanisms = mechanisms or Mechanisms()
        self._informed: dict[int, tuple[ContactMap, Array]] = {}

    def score(self, contact_map: ContactMap) -> Hypothesis:
        """The hypothesis of a map as it is."""
        return self._hypothesis(contact_map, self._misfit(contact_map))

    def smooth(self, contact_map: ContactMap, iterations: int) -> Hypothesis:
        """The poses of largest evidence nearby; repeated if contacts turn out not to fit them."""
        rows, _ = PoseEvidence(contact_map, self._noise).maximise(contact_map.rows, iterations)
        cleaned, value = self.clean(contact_map.with_rows(rows))
        if cleaned.left_out_count > contact_map.left_out_count:
            rows, value = PoseEvidence(cleaned, self._noise).maximise(cleaned.rows, iterations)
            cleaned = cleaned.with_rows(rows)
        return self._hypothesis(cleaned, value)

    def condense(self, hypothesis: Hypothesis, window: int, remembered: int) -> Hypothesis:
        """The hypothesis with only the last grasps open, at the same cost."""
        short = self.score(condense(hypothesis.map, window, remembered))
        settled = hypothesis.cost - short.cost + hypothesis.map.settled_cost
        return replace(short, map=replace(short.map, settled_cost=settled))

    def clean(self, contact_map: ContactMap, grasp: int | None = None) -> tuple[ContactMap, float]:
        """Leave out contacts, the worst first, while they cost more than unexplained contacts.

        Contacts of fingers that touched an object left in place before the hand closed stay: where it was is known, and
        a field may be wrong beside an edge however sure it is.

        Args:
            contact_map: with its present poses.
            grasp: whose contacts may be left out; None for all.

        Returns:
            The map, and the negative log posterior of its poses.
        """
        while True:
            asked = self._asked(contact_map, grasp)
            costs = contact_map.fit().leave_one_out_costs(asked)
            if len(asked) == 0 or costs.max() <= self._unexplained_cost or len(contact_map.grasp_indices) == 1:
                return contact_map, self._misfit(contact_map)
            contact_map = contact_map.without_contact(*contact_map.origins[asked[costs.argmax()]])

    def rough_cost(self, contact_map: ContactMap) -> float:
        """Cost of a map, roughly: each contact is explained by all others or by nothing, none is left out for it."""
        each = contact_map.fit().leave_one_out_costs(np.arange(len(contact_map.contacts)))
        motion = MotionCost.of(contact_map, self._noise).value(contact_map.rows)
        return motion + float(np.minimum(each, self._unexplained_cost).sum()) + self.price(contact_map)

    def _asked(self, contact_map: ContactMap, grasp: int | None) -> NDArray[np.intp]:
        """Indices of the contacts that may be left out, of one grasp or of all."""
        surely = [self._surely_there(one) for one in contact_map.placed]
        named = contact_map.grasp_indices == grasp if grasp is not None else True
        return np.flatnonzero(~np.concatenate(surely) & named)

    def _surely_there(self, grasp: PlacedGrasp) -> NDArray[np.bool_]:
        """Of the contacts of a grasp that are part of the shape, those of fingers that touched before it closed on an
        object left in place.
        """
        probed = grasp.contacts_world.probed
        if not len(probed) or not grasp.was_left(self._noise):
            return np.zeros(len(grasp.kept), dtype=bool)
        return probed[grasp.kept]

    def different(self, hypotheses: list[Hypothesis], *, by_contacts: bool = True) -> list[Hypothesis]:
        """The most likely ones of those with equal trajectories.

        Args:
            hypotheses: to choose from.
            by_contacts: those that leave out other contacts count as different, even if they are close.
        """
        return self.unlike(hypotheses, [], by_contacts=by_contacts)

    def unlike(
        self, hypotheses: list[Hypothesis], known: list[Hypothesis], *, by_contacts: bool = True
    ) -> list[Hypothesis]:
        """As :meth:`different`, of those that differ from all known trajectories."""
        kept: list[Hypothesis] = []
        for one in sorted(hypotheses, key=cost):
            if not any(self._same(one.map, other.map, by_contacts) for other in (*known, *kept)):
                kept.append(one)
        return kept

    def _same(self, one: ContactMap, other: ContactMap, by_contacts: bool) -> bool:
        """Whether two trajectories are equal: close, or different only where contacts do not determine poses.

        An optimiser that stops when little is gained ends at many places of one valley; kept apart, they would displace
        true alternatives.
        """
        gaps = one.space.deviation(one.rows, other.rows)
        if _near(gaps, one.space):
            return True
        if not self._mechanisms.has("valleys"):
            return False
        if not _near(gaps[0], one.space) or _left_out_contacts(one, by_contacts) != _left_out_contacts(
            other, by_contacts
        ):
            return False
        steps = gaps[1:].ravel()
        return bool(steps @ self._information(other) @ steps < _SAME_VALLEY * len(steps))

    def _information(self, contact_map: ContactMap) -> Array:
        """Information of all poses but the first; cached for the last maps."""
        known = self._informed.get(id(contact_map))
        if known is not None and known[0] is contact_map:
            return known[1]
        while len(self._informed) >= _REMEMBERED:
            del self._informed[next(iter(self._informed))]
        found = PoseEvidence(contact_map, self._noise).information(contact_map.rows)
        self._informed[id(contact_map)] = contact_map, found
        return found

    def forget(self) -> None:
        """Drop what was cached: the maps of a step are not compared with those of the next."""
        self._informed.clear()

    def price(self, contact_map: ContactMap) -> float:
        """Cost of the contacts that are left out, and of the steps in which the object did not move with the hand.

        The more contacts are wrong, the less surprising is one more (Beta-binomial: the share of wrong contacts is
        one in a hundred until the contacts say otherwise).
        """
        wrong = contact_map.left_out_count
        right = len(contact_map.contacts) + _EXPECTED_RIGHT
        share = float(gammaln(wrong + 1.0) + gammaln(right) - gammaln(wrong + right + 1.0))
        anywhere = self._unexplained_cost - float(np.log(_EXPECTED_RIGHT + 1.0))
        breaks, pushes = contact_map.moved.count(Moved.FREELY), contact_map.moved.count(Moved.PUSHED)
        moves = _BREAK_COST * breaks + pushed_nats(self._noise, contact_map.space) * pushes
        return wrong * anywhere - share + moves

    def _misfit(self, contact_map: ContactMap) -> float:
        """As :meth:`PoseEvidence.value`, by the field, which is needed anyway."""
        contacts = contact_map.contacts
        constant = 0.5 * len(contacts) * (contacts.dimension + 1) * np.log(2 * np.pi)
        motion = MotionCost.of(contact_map, self._noise).value(contact_map.rows)
        return motion - contact_map.fit().log_marginal_likelihood() - float(constant)

    def _hypothesis(self, contact_map: ContactMap, misfit: float) -> Hypothesis:
        intrusion = free_space_costs(contact_map.fit(), contact_map.free_points_m[None])[0]
        return Hypothesis(contact_map, misfit, float(intrusion), self.price(contact_map))


def cost(hypothesis: Hypothesis) -> float:
    """The sort key of hypotheses."""
    return hypothesis.cost


def likeliest(hypotheses: list[Hypothesis], count: int, gap: float) -> list[Hypothesis]:
    """The best ones, without those less likely than the best by more than ``gap`` (natural logarithm)."""
    ranked = sorted(hypotheses, key=cost)[:count]
    return [one for one in ranked if one.cost < ranked[0].cost + gap]


def weights(hypotheses: list[Hypothesis]) -> Array:
    """Their probabilities, if one of them is true, shape (n,)."""
    costs = np.array([hypothesis.cost for hypothesis in hypotheses])
    relative = np.exp(costs.min() - costs)
    return np.asarray(relative / relative.sum())


def _left_out_contacts(contact_map: ContactMap, by_contacts: bool) -> list[frozenset[int] | bool]:
    """The left-out contacts of each grasp; or only whether all are left out."""
    return [grasp.left_out if by_contacts else grasp.used for grasp in contact_map.placed]


def _near(gaps: Array, space: PoseVectors) -> bool:
    """Whether poses differ by less than the resolution."""
    limits = np.where(np.arange(space.size) < space.translations, _SAME_TRANSLATION_m, _SAME_ROTATION_rad)
    return bool((np.abs(gaps) <= limits).all())
