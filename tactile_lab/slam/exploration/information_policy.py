"""The default policy: the grasp with the most expected information about shape and pose together, per second.

See :mod:`tactile_lab.slam.exploration.expected_information`. Where the estimate has alternatives, what a grasp tells
about which of them is right counts too (:mod:`tactile_lab.slam.exploration.alternative_information`).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from drivers.core.contacts import Array
from tactile_lab.slam.exploration.alternative_information import told_apart
from tactile_lab.slam.exploration.candidates import Candidate
from tactile_lab.slam.exploration.expected_information import (
    InformationSettings,
    Promise,
    predict_promise,
    unexplored_vertices,
)
from tactile_lab.slam.exploration.policy import Belief, Decision, Surface, best_of, surface_to_foresee

_AHEAD = 3
"""Number of grasps by which a pose of the object is rated before it is carried there."""


@dataclass(frozen=True)
class InformationPolicy:
    """Expected information per second; see the module's docstring."""

    settings: InformationSettings = field(default_factory=InformationSettings)
    name: str = "information"

    def choose(self, candidates: Sequence[Candidate], belief: Belief, rng: np.random.Generator) -> Decision:
        surface = surface_to_foresee(self.name, candidates, belief, rng)
        if isinstance(surface, Decision):
            return surface
        promise = predict_promise(candidates, belief, surface, self.settings, rng)
        apart = told_apart(candidates, belief, surface, self.settings.point_sigma_m, self.settings.execution.finger_m)
        return self._decide(candidates, surface, belief, promise, apart, rng)

    def best_rate(
        self,
        candidates: Sequence[Candidate],
        belief: Belief,
        rng: np.random.Generator,
        lost_nats: float = 0.0,
        seconds: float = 0.0,
    ) -> float:
        """The largest expected information per second over the next few grasps, 1/s; 0 if nothing can be predicted.

        Information about the pose is lost and regained once; sides that only these candidates reach can be used by
        several grasps, as long as each adds information.

        Args:
            candidates, belief, rng: as for a choice.
            lost_nats: knowledge of the pose that is lost on the way to these candidates.
            seconds: duration of the carrying, besides the candidates' own times.
        """
        if not candidates or belief.surface is None:
            return 0.0
        promise = predict_promise(candidates, belief, belief.surface, self.settings, rng)
        times = seconds + _AHEAD * np.array([candidate.time_s for candidate in candidates])
        shape = np.minimum(_AHEAD * promise.shape, promise.together)
        told = self.settings.pose_weight * promise.pose + shape
        rates = (self._worth(candidates, belief) * told - self.settings.pose_weight * lost_nats) / times
        return float(np.max(rates[promise.touching > 0], initial=0.0))

    def _decide(
        self,
        candidates: Sequence[Candidate],
        surface: Surface,
        belief: Belief,
        promise: Promise,
        apart: Array,
        rng: np.random.Generator,
    ) -> Decision:
        times = np.array([candidate.time_s for candidate in candidates])
        nats = self.settings.pose_weight * promise.pose + promise.shape + apart
        rates = np.where(promise.touching > 0, self._worth(candidates, belief) * nats / times, -np.inf)
        decision = best_of(self.name, rates, "", rng)
        if decision.chosen is None:
            return decision
        if why := self._stops(surface, belief, nats):
            return Decision(self.name, "stop", None, decision.scores, why)
        best = decision.chosen
        reason = _reason(promise, best, candidates[best].pushes) + _apart(apart[best], belief) + decision.reason
        return Decision(self.name, "grasp", best, decision.scores, reason, float(promise.new_share[best]))

    def _worth(self, candidates: Sequence[Candidate], belief: Belief) -> Array:
        """Weight of each candidate's expected information."""
        pushing = self.settings.worth_of_push(belief.dimension)
        return np.where([candidate.pushes for candidate in candidates], pushing, 1.0)

    def _stops(self, surface: Surface, belief: Belief, nats: Array) -> str:
        """Why to end here, or ""."""
        if nats.max() < self.settings.least_gain:
            return (
                f"no grasp promises more than {nats.max():.2g} nats, less than the {self.settings.least_gain:g} asked"
            )
        limit = self.settings.known_sigma_m
        if limit is None or float(np.quantile(surface.sigma_m, self.settings.enough)) > limit:
            return ""
        fresh = unexplored_vertices(surface, belief, self.settings.reach(belief.dimension))
        sizes = surface.sizes * surface.touchable(belief.origin_height_m)
        share = float(sizes[~fresh].sum() / sizes.sum())
        if share < self.settings.enough:
            return ""
        return f"{100 * share:.0f} % of the surface has been touched and it is known to {1e3 * limit:.3g} mm"


def _apart(nats: float, belief: Belief) -> str:
    """The information of the chosen grasp about alternatives, in words; empty if there are none."""
    if not belief.rivals:
        return ""
    chance = sum(rival.probability for rival in belief.rivals)
    return f", {nats:.1f} nats about which placing is right ({chance:.0%} for another)"


def _reason(promise: Promise, best: int, pushes: bool) -> str:
    push = ", though it may push the object" if pushes else ""
    pose = f" and {promise.pose[best]:.1f} nats about the pose" if promise.pose[best] > 0.05 else ""
    return (
        f"{promise.touching[best]:.1f} contacts expected, with {promise.shape[best]:.1f} nats about the shape"
        f"{pose}, {100 * promise.new_share[best]:.1f} % of the surface new{push}"
    )
