"""All policies by name."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from types import MappingProxyType

import numpy as np

from tactile_lab.errors import ConfigurationError
from tactile_lab.exploration.candidates import Candidate, predict_contacts
from tactile_lab.exploration.policy import Belief, Decision, Policy, best_of, nothing_to_choose
from tactile_lab.exploration.rewards import variance_reward


@dataclass(frozen=True)
class RandomPolicy:
    """Any candidate, all alike."""

    name: str = "random"

    def choose(self, candidates: Sequence[Candidate], belief: Belief, rng: np.random.Generator) -> Decision:
        if settled := nothing_to_choose(self.name, candidates, belief):
            return settled
        chosen = int(rng.integers(len(candidates)))
        return Decision(self.name, "grasp", chosen, (0.0,) * len(candidates), "chosen by chance, as asked")


@dataclass(frozen=True)
class VariancePolicy:
    """Equation 4.20: the sum of the field's variances where the fingers are expected to touch."""

    name: str = "variance"

    def choose(self, candidates: Sequence[Candidate], belief: Belief, rng: np.random.Generator) -> Decision:
        if settled := nothing_to_choose(self.name, candidates, belief):
            return settled
        expected = [predict_contacts(candidate, belief.modelled) for candidate in candidates]
        scores = np.array([variance_reward(one) if one.fingers else -np.inf for one in expected])
        return best_of(self.name, scores, "its fingers are expected where the surface is known least", rng)


POLICIES: Mapping[str, Callable[[], Policy]] = MappingProxyType({"random": RandomPolicy, "variance": VariancePolicy})
"""How each policy is made, by its name."""


def make_policy(name: str) -> Policy:
    """The policy called ``name``. Raises ConfigurationError if there is none."""
    if name not in POLICIES:
        raise ConfigurationError(
            f"no policy is called {name!r}", where="policy", hint=f"Policies are {', '.join(POLICIES)}"
        )
    return POLICIES[name]()
