"""All policies by name."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace
from types import MappingProxyType

from tactile_lab.errors import ConfigurationError
from tactile_lab.exploration.expected_information import InformationSettings
from tactile_lab.exploration.information.igef import IgefSettings
from tactile_lab.exploration.information_policy import InformationPolicy
from tactile_lab.exploration.policy import Policy
from tactile_lab.exploration.pose_policies import (
    PoseSwitchPolicy,
    determinant_gain,
    information_gain,
    kl_gain,
    mixture_gain,
    renyi_gain,
)
from tactile_lab.exploration.regions import RegionSettings
from tactile_lab.exploration.surface_policies import (
    ClustersPolicy,
    ContactsPolicy,
    RandomPolicy,
    entropy_rating,
    igef_rating,
    variance_rating,
)

DEFAULT_POLICY = "information"


def _variance() -> Policy:
    return ContactsPolicy(
        "variance", variance_rating, "its fingers are expected where the surface is known least (4.20)"
    )


def _entropy() -> Policy:
    return ContactsPolicy("entropy", entropy_rating, "its contacts have the largest joint entropy (4.10)")


def _igef() -> Policy:
    rating = igef_rating(lambda metrics: metrics.product, IgefSettings())
    return ContactsPolicy("igef", rating, "its contacts are new, near and easy to turn to (4.15)")


def _igef_shape() -> Policy:
    rating = igef_rating(lambda metrics: metrics.shape_only, IgefSettings())
    return ContactsPolicy("igef-shape", rating, "its contacts are new and beside what is known (4.11, 4.13)")


POLICIES: Mapping[str, Callable[[], Policy]] = MappingProxyType(
    {
        "random": RandomPolicy,
        "variance": _variance,
        "clusters": ClustersPolicy,
        "clusters-appendix": lambda: ClustersPolicy(RegionSettings(weighting="appendix"), "clusters-appendix"),
        "entropy": _entropy,
        "igef": _igef,
        "igef-shape": _igef_shape,
        "det": lambda: PoseSwitchPolicy("det", determinant_gain, _variance()),
        "det-modes": lambda: PoseSwitchPolicy("det-modes", mixture_gain, _variance()),
        "kl": lambda: PoseSwitchPolicy("kl", kl_gain, _variance()),
        "mutual-information": lambda: PoseSwitchPolicy("mutual-information", information_gain, _variance()),
        "renyi": lambda: PoseSwitchPolicy("renyi", renyi_gain, _variance()),
        "information": InformationPolicy,
    }
)
"""How each policy is made, by its name."""


def make_policy(name: str, information: InformationSettings | None = None) -> Policy:
    """The policy called ``name``.

    Args:
        information: settings of the policy ``information``; the usual ones when None. The others are the thesis's, and
            stay as it has them, so that a comparison with them is one with it.

    Raises:
        ConfigurationError: there is no policy of that name.
    """
    if name not in POLICIES:
        hint = f"Policies are {', '.join(POLICIES)}"
        raise ConfigurationError(f"no policy is called {name!r}", where="policy", hint=hint)
    policy = POLICIES[name]()
    return replace(policy, settings=information) if information and isinstance(policy, InformationPolicy) else policy
