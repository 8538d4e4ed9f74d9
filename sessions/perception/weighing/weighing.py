"""Mass and centre of mass from the wrench of the fingertips while the object hangs; friction from dragging it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from scipy.ndimage import gaussian_filter1d

from drivers.core.contacts import Array
from drivers.core.fingertip import ContinuousFingertip
from drivers.shadow.protocol.palm_images import Side
from sessions.perception.carrying.carry_record import CarrySamples
from sessions.perception.carrying.net_wrench import NetWrench, net_wrench
from sessions.perception.weighing.joint_errors import STEP_rad, joint_errors, turned_wrenches
from sessions.perception.weighing.table_pull import TablePull, table_pull, there_and_back

_GAIN = 0.01
"""Error of each force sensor's gain: 1 % of the reading (protocols: Nano17 ratings)."""
_LEAST_WEIGHT_N = 0.05
_DRAG_N, _DRAG_SHARE = 0.035, 0.12
"""Error of a measured friction: an object that has only begun to slide is held back by less, and so is one that turns
between the fingers.
"""
_HELD_BACK_N, _HELD_BACK_SHARE = 0.02, 0.025
"""By how much an object that hangs free seems to be held back: noise, and what inertia and creep make of its weight.
Errors of the joint angles are the same both ways, and cancel.
"""
_UNSTEADY_N, _UNSTEADY_SHARE = 0.02, 0.01
"""By how much the upward force on an object that hangs free varies; an edge on the table slips and catches."""
_SIDEWAYS_SIGMAS = 4.0
"""A force along the table that is larger than this, in standard deviations, is no error of the joint angles."""
_LEANED_SIGMAS = 25.0
"""Nor one of an edge on the table, which gives way: links carry much of it then."""
_SMOOTHING, _SLIP_SMOOTHING = 1.0, 3.0
"""Samples; of the upward force, against noise."""
_SLIPS_N, _SLIPS_SHARE = 0.05, 0.02
"""By how much the upward force on an object changes when it slips in the fingers, or comes down on something."""
_LEAST_SAMPLES = 20
_SLIDING_QUANTILE = 0.6
"""The dragged object lags behind when the hand turns round: the stronger pulls are those at which it slides."""


@dataclass(frozen=True)
class Hanging:
    """An object that hung from the fingers.

    Attributes:
        weight_N, weight_sigma_N: upward force of the fingertips.
        centre_m: of mass, world x and y, shape (2,), where it hung.
        centre_sigma_m: standard deviations, shape (2,).
        held_back_N: by how much something held the shifted object back: friction of an edge that stood on the table.
        unsteady_N: standard deviation of the upward force in time.
        sideways_sigmas: force of the fingertips along the table, in its standard deviations: as large as that of links,
            which feel nothing, against the object.
        pull: how the table held it back; None if it was not moved both ways.
    """

    weight_N: float
    weight_sigma_N: float
    centre_m: Array
    centre_sigma_m: Array
    held_back_N: float
    unsteady_N: float = 0.0
    sideways_sigmas: float = 0.0
    pull: TablePull | None = None

    @property
    def stands(self) -> bool:
        """Whether the table carries a part of it."""
        held_back = self.held_back_N > _HELD_BACK_N + _HELD_BACK_SHARE * self.weight_N
        return held_back or self.unsteady_N > _UNSTEADY_N + _UNSTEADY_SHARE * self.weight_N

    @property
    def is_leaned_on(self) -> bool:
        """Whether links of the fingers carry a part of it."""
        return self.sideways_sigmas > _SIDEWAYS_SIGMAS

    @property
    def is_tipped(self) -> bool:
        """Whether table and fingertips share it, without much help of links."""
        return self.stands and self.sideways_sigmas < _LEANED_SIGMAS

    @property
    def is_free(self) -> bool:
        """Whether nothing but the fingertips held it."""
        return self.weight_N > _LEAST_WEIGHT_N and not (self.stands or self.is_leaned_on)


@dataclass(frozen=True)
class Dragging:
    """An object that was dragged to and fro over the table.

    Attributes:
        friction_N, friction_sigma_N: of the table.
        pressed_N: by how much the fingers pressed it onto the table.
        pull: friction and upward force in the mean; None if it was not moved both ways.
    """

    friction_N: float
    friction_sigma_N: float
    pressed_N: float
    pull: TablePull | None = None


def hanging(
    samples: CarrySamples,
    fingertips: Mapping[str, ContinuousFingertip],
    side: Side,
    joint_sigma_rad: float,
    height_m: float,
) -> Hanging:
    """Weight and centre of an object that hung during these samples.

    Args:
        samples: while it hung and was shifted there and back.
        fingertips: by finger.
        side: of the hand.
        joint_sigma_rad: constant error of each joint angle.
        height_m: of the contacts above the table: forces there that do not cancel make moments.
    """
    felt, turned = net_wrench(samples, fingertips, side), turned_wrenches(samples, fingertips, side)
    errors = joint_errors(felt, turned, joint_sigma_rad)
    found = net_wrench(samples, fingertips, side, errors.turned_rad)
    best = _measured(found, height_m)
    by_joint = (np.array([_measured(each, height_m) for each in turned]) - _measured(felt, height_m)) / STEP_rad
    spread = np.einsum("ik,ij,jk->k", by_joint, errors.covariance, by_joint)
    centre_m = np.append(best[1:3], height_m)
    sigma = np.sqrt(spread + _drift(fingertips, best[0], found.tips_m.mean(axis=0) - centre_m) ** 2)
    alone = [net_wrench(samples, {finger: tip}, side, errors.turned_rad) for finger, tip in fingertips.items()]
    carried_N = [float(each.force_N[:, 2].mean()) for each in alone]
    return Hanging(
        weight_N=float(best[0]),
        weight_sigma_N=float(np.linalg.norm([sigma[0], *(_GAIN * each_N for each_N in carried_N)])),
        centre_m=best[1:3],
        centre_sigma_m=sigma[1:3],
        held_back_N=abs(_held_back_N(found)),
        unsteady_N=float(gaussian_filter1d(found.force_N[:, 2], _SMOOTHING, mode="nearest").std()),
        sideways_sigmas=float(np.linalg.norm(best[3:] / sigma[3:])),
        pull=table_pull(felt),
    )


def until_it_slips(
    samples: CarrySamples, fingertips: Mapping[str, ContinuousFingertip], side: Side
) -> CarrySamples | None:
    """The samples of an object that hung free, until it slipped, or all; None if it slipped at once."""
    upward_N = gaussian_filter1d(net_wrench(samples, fingertips, side).force_N[:, 2], _SLIP_SMOOTHING, mode="nearest")
    usual_N = float(np.median(upward_N[:_LEAST_SAMPLES]))
    slips = np.flatnonzero(np.abs(upward_N - usual_N) > _SLIPS_N + _SLIPS_SHARE * usual_N)
    steady = len(upward_N) if not len(slips) else int(slips[0]) - _LEAST_SAMPLES // 2
    return samples.until(int(samples.stamps_ns[steady - 1])) if steady > _LEAST_SAMPLES else None


def dragging(samples: CarrySamples, fingertips: Mapping[str, ContinuousFingertip], side: Side) -> Dragging:
    """Friction of the table on an object that was dragged to and fro during these samples."""
    found = net_wrench(samples, fingertips, side)
    friction_N = _held_back_N(found, _SLIDING_QUANTILE)
    sigma_N = float(np.hypot(_DRAG_N, _DRAG_SHARE * friction_N))
    return Dragging(friction_N, sigma_N, -float(found.force_N[:, 2].mean()), table_pull(found))


def _measured(wrench: NetWrench, height_m: float) -> Array:
    """Weight (N), centre (m, m) and force along the table (N, N), shape (5,)."""
    force, moment, palm = wrench.force_N.mean(axis=0), wrench.moment_Nm.mean(axis=0), wrench.palm_m.mean(axis=0)
    below_m, weight_N = height_m - palm[2], max(float(force[2]), _LEAST_WEIGHT_N)
    x = (below_m * force[0] - moment[1]) / weight_N
    y = (below_m * force[1] + moment[0]) / weight_N
    return np.array([force[2], palm[0] + x, palm[1] + y, force[0], force[1]])


def _drift(fingertips: Mapping[str, ContinuousFingertip], weight_N: float, arms_m: Array) -> Array:
    """Standard deviations by the drift of the sensors since their tare; shape and order of :func:`_measured`.

    Args:
        fingertips: by finger.
        weight_N: of the object.
        arms_m: from its centre, at the height of the contacts, to each fingertip, shape (tips, 3).
    """
    drifts = np.array([tip.drift for tip in fingertips.values()]).reshape(-1, 2, 3)
    by_N, by_Nm = np.square(drifts).mean(axis=2).T
    force_N = float(np.sqrt(by_N.sum()))
    levers = [by_N @ (arms_m[:, axis] ** 2 + arms_m[:, 2] ** 2) + by_Nm.sum() for axis in (0, 1)]
    lever_m = np.sqrt(levers) / max(weight_N, _LEAST_WEIGHT_N)
    return np.array([force_N, *lever_m, force_N, force_N])


def _held_back_N(wrench: NetWrench, quantile: float = 0.5) -> float:
    """Half the difference of the pull on the object between moving one way and the other, along the motion.

    Args:
        wrench: of the fingertips.
        quantile: of the pull in each direction that counts, reckoned from the weakest.
    """
    pull_N, there, back = there_and_back(wrench)
    if not (there.any() and back.any()):
        return 0.0
    return float((np.quantile(pull_N[there], quantile) - np.quantile(pull_N[back], 1.0 - quantile)) / 2)
