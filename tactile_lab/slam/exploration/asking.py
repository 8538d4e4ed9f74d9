"""Asks a policy, possibly an extension's: an invalid answer becomes a decision that says so."""

from __future__ import annotations

from collections.abc import Sequence
from typing import get_args

import numpy as np

from tactile_lab.slam.exploration.candidates import Candidate
from tactile_lab.slam.exploration.policies import POLICIES
from tactile_lab.slam.exploration.policy import Belief, Decision, Outcome, Policy


def ask(policy: Policy, candidates: Sequence[Candidate], belief: Belief, rng: np.random.Generator) -> Decision:
    """What a policy decides; never raises.

    Returns:
        the policy's decision. Where it raises, answers NaN or chooses what is not on offer: a decision of outcome
        "nothing", whose ``failure`` names the policy, its file and the line, so that the caller follows its own rule.
    """
    file = POLICIES.file(policy.name)
    try:
        decision = policy.choose(candidates, belief, rng)
        problem = _problem(decision, len(candidates))
    except (Exception, SystemExit) as error:
        problem = f"raises {POLICIES.explain(policy.name, error)}"
    if not problem:
        return decision
    failure = f"the policy {policy.name} of {file or type(policy).__module__} {problem}"
    return Decision(policy.name, "nothing", None, (float("-inf"),) * len(candidates), failure, failure=failure)


def _problem(decision: object, offered: int) -> str:
    """Why a decision is invalid; empty if it is valid."""
    if not isinstance(decision, Decision):
        return f"returned {type(decision).__name__} instead of a Decision"
    if len(decision.scores) != offered:
        return f"scores {len(decision.scores)} of {offered} candidates"
    if np.isnan(decision.scores).any() or (decision.promised_gain is not None and np.isnan(decision.promised_gain)):
        return "answers NaN"
    if decision.outcome not in get_args(Outcome):
        return f"answers {decision.outcome!r} where {', '.join(get_args(Outcome))} are possible"
    grasps = decision.outcome == "grasp"
    if grasps != (decision.chosen is not None) or (decision.chosen is not None and not 0 <= decision.chosen < offered):
        return f"answers {decision.outcome!r} and chooses {decision.chosen} of {offered} candidates"
    return ""
