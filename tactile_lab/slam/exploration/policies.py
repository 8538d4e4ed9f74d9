"""All policies by name."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

from drivers.core.errors import ConfigurationError
from drivers.core.registry import Registry
from tactile_lab.slam.exploration.expected_information import InformationSettings
from tactile_lab.slam.exploration.information.igef import IgefSettings
from tactile_lab.slam.exploration.information_policy import InformationPolicy
from tactile_lab.slam.exploration.policy import Policy
from tactile_lab.slam.exploration.pose_policies import (
    Gain,
    PoseSwitchPolicy,
    determinant_gain,
    information_gain,
    kl_gain,
    mixture_gain,
    renyi_gain,
)
from tactile_lab.slam.exploration.regions import RegionSettings
from tactile_lab.slam.exploration.surface_policies import (
    ClustersPolicy,
    ContactsPolicy,
    RandomPolicy,
    entropy_rating,
    igef_rating,
    variance_rating,
)


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
    return ContactsPolicy("igef-shape", rating, "its contacts are new and next to known surface (4.11, 4.13)")


def _clusters_appendix() -> Policy:
    return ClustersPolicy(RegionSettings(weighting="appendix"), "clusters-appendix")


def _by_pose(name: str, gain: Gain) -> Callable[[], Policy]:
    return lambda: PoseSwitchPolicy(name, gain, _variance())


POLICIES: Registry[Callable[[], Policy]] = Registry("policy", "policies", group="policies")
"""Constructors of the policies, by name. See ``docs/extending.md`` for adding one."""

POLICIES.register("random", RandomPolicy)
POLICIES.register("variance", _variance)
POLICIES.register("clusters", ClustersPolicy)
POLICIES.register("clusters-appendix", _clusters_appendix)
POLICIES.register("entropy", _entropy)
POLICIES.register("igef", _igef)
POLICIES.register("igef-shape", _igef_shape)
POLICIES.register("det", _by_pose("det", determinant_gain))
POLICIES.register("det-modes", _by_pose("det-modes", mixture_gain))
POLICIES.register("kl", _by_pose("kl", kl_gain))
POLICIES.register("mutual-information", _by_pose("mutual-information", information_gain))
POLICIES.register("renyi", _by_pose("renyi", renyi_gain))
POLICIES.register("information", InformationPolicy)


def make_policy(name: str, information: InformationSettings | None = None) -> Policy:
    """Make the policy ``name``.

    Args:
        information: settings of the policy ``information``; the defaults if None. The others are the thesis's policies
            and stay unchanged for comparison.

    Raises:
        ConfigurationError: there is no policy of that name, or it cannot be made; names its file.
    """
    factory = POLICIES[name]
    try:
        policy = factory()
        own_name = policy.name
    except (Exception, SystemExit) as error:
        what = f"the policy {name!r} cannot be made: {POLICIES.explain(name, error)}"
        raise ConfigurationError(what, where=POLICIES.file(name), hint="Correct it, or choose another") from error
    if own_name != name:
        what = f"the policy registered as {name!r} calls itself {own_name!r}"
        raise ConfigurationError(what, where=POLICIES.file(name), hint="Give it one name")
    return replace(policy, settings=information) if information and isinstance(policy, InformationPolicy) else policy
