"""Measurements of a carry as a worse hand would have them: errors of joints, links and force sensors."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from types import MappingProxyType
from typing import TypeAlias

import numpy as np

from drivers.core.contacts import FINGERS
from drivers.core.fingertip import ContinuousFingertip
from drivers.shadow.model.kinematics import JOINTS
from sessions.perception.carrying.carry_record import CarrySamples, SAMPLE_ns

GAIN, CROSSTALK = 0.02, 0.02
"""Of joint angles, and between the axes of a force sensor; one standard deviation."""
PLAY_rad, BENDING_rad_N = float(np.radians(0.5)), float(np.radians(0.3))
LATE_ns = 5_000_000
"""Delay of the force sensors."""
_UNITS = np.array([1.0, 1.0, 1.0, 0.01, 0.01, 0.01])
"""Forces and moments that compare: a fingertip's size is 10 mm."""

Tips: TypeAlias = Mapping[str, ContinuousFingertip]
Spoiler: TypeAlias = Callable[[CarrySamples, Tips, np.random.Generator], CarrySamples]

_OF_FINGERS = np.array([not name.startswith("WR") for name in JOINTS])


def wrong_gains(samples: CarrySamples, tips: Tips, rng: np.random.Generator) -> CarrySamples:
    """Angles of the fingers' joints are wrong by a constant share."""
    gains = 1.0 + GAIN * rng.standard_normal(len(JOINTS)) * _OF_FINGERS
    return replace(samples, joints_rad=samples.joints_rad * gains)


def play(samples: CarrySamples, tips: Tips, rng: np.random.Generator) -> CarrySamples:
    """What is measured follows the joint only when it has moved through the play."""
    measured = samples.joints_rad.copy()
    for n in range(1, len(measured)):
        near = samples.joints_rad[n] + PLAY_rad / 2 * np.array([[-1.0], [1.0]])
        measured[n] = np.where(_OF_FINGERS, np.clip(measured[n - 1], *near), samples.joints_rad[n])
    return replace(samples, joints_rad=measured)


def bending_links(samples: CarrySamples, tips: Tips, rng: np.random.Generator) -> CarrySamples:
    """Links bend under the fingertip's force as if J2 and J3 turned, which no joint sensor shows."""
    joints_rad = samples.joints_rad.copy()
    upright = np.tile(np.eye(3), (len(joints_rad), 1, 1))
    for finger, tip in tips.items():
        felt = tip.wrenches(samples.readings[:, FINGERS.index(finger)], upright)
        force_N = np.linalg.norm(np.nan_to_num(felt[:, :3]), axis=1)
        for joint in (f"{finger}J2", f"{finger}J3"):
            joints_rad[:, JOINTS.index(joint)] += BENDING_rad_N * force_N
    return replace(samples, joints_rad=joints_rad)


def crosstalk(samples: CarrySamples, tips: Tips, rng: np.random.Generator) -> CarrySamples:
    """Every axis of a force sensor shows a part of the others."""
    mixed = CROSSTALK * rng.standard_normal((len(FINGERS), 6, 6))
    scaled = samples.readings / _UNITS
    return replace(samples, readings=(scaled + np.einsum("fij,nfj->nfi", mixed, scaled)) * _UNITS)


def late_forces(samples: CarrySamples, tips: Tips, rng: np.random.Generator) -> CarrySamples:
    """Force sensors answer later than the hand."""
    share = LATE_ns / SAMPLE_ns
    earlier = np.concatenate([samples.readings[:1], samples.readings[:-1]])
    return replace(samples, readings=(1.0 - share) * samples.readings + share * earlier)


AS_MEASURED = "as measured"
SPOILT: Mapping[str, Sequence[Spoiler]] = MappingProxyType(
    {
        AS_MEASURED: (),
        "joint gains": (wrong_gains,),
        "play": (play,),
        "bending": (bending_links,),
        "crosstalk": (crosstalk,),
        "late forces": (late_forces,),
        "all of these": (wrong_gains, play, bending_links, crosstalk, late_forces),
    }
)
"""What a worse hand does to the samples, by name."""


def spoil(samples: CarrySamples, how: str, tips: Tips, rng: np.random.Generator) -> CarrySamples:
    """The samples as a worse hand would have measured them; ``how`` is one of :data:`SPOILT`."""
    for spoiler in SPOILT[how]:
        samples = spoiler(samples, tips, rng)
    return samples
