"""How late the fingertips' forces arrive against the joint angles, from the moments at which fingers touch.

A finger that closes stops where its force rises, and the force is that of a spring: it grows with how far the tip has
gone in. Each onset of a touch is fitted so, for a range of delays; what does not fit is added up over all onsets. The
best delay is that of the whole chain, sensors to arrival: odometry in the hand pairs forces and joint angles by their
arrival.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from drivers.core.clock import NANOSECONDS
from drivers.core.contacts import FINGERS, Array
from drivers.core.fingertip import ContinuousFingertip
from drivers.shadow.model.kinematics import forearm_T_palm_matrix, palm_T_distal_matrices
from drivers.shadow.protocol.palm_images import Side
from sessions.perception.carrying.carry_record import CarrySamples, SAMPLE_ns

_DELAYS_s = np.arange(-0.06, 0.1201, 0.0025)
_ONSET_N = 0.12
_BEFORE, _AFTER = 10, 15
"""Samples of an onset that are fitted."""
_MARGIN = 12
"""Samples around them, which the longest delay reaches."""
_STARTS = np.linspace(0.1, 0.95, 15)
"""Where the tip may have met the object, as quantiles of its way."""
_LEAST_ONSETS = 20
_TOLD_s, _TOLD_SIGMAS = 0.03, 3.0
"""Delays below this do odometry no harm, and hardly differ from what five grasps scatter by."""
_CURVES_SIGMA = 1.25 * 1.48
"""Standard error of a median, over the median deviation and the root of the number."""


class ForceDelay:
    """Collects onsets of touches, and tells the delay.

    Args:
        fingertips: that measure forces while they move, by finger.
        side: of the hand.
    """

    def __init__(self, fingertips: Mapping[str, ContinuousFingertip], side: Side) -> None:
        self._fingertips, self._side = fingertips, side
        self._misfits: list[Array] = []
        self.problem = ""
        """What is wrong, for people; empty while forces come in time."""

    @property
    def delay_s(self) -> tuple[float, float] | None:
        """The delay, positive where forces are late, and its standard error; None before enough touches."""
        if len(self._misfits) < _LEAST_ONSETS:
            return None
        misfits = np.array(self._misfits)
        best_s = float(_DELAYS_s[misfits.sum(axis=0).argmin()])
        each_s = _DELAYS_s[misfits.argmin(axis=1)]
        deviation_s = float(np.median(np.abs(each_s - best_s)))
        step_s = float(_DELAYS_s[1] - _DELAYS_s[0])
        return best_s, max(_CURVES_SIGMA * deviation_s / np.sqrt(len(each_s)), step_s)

    def on_closing(self, samples: CarrySamples) -> None:
        """Take the onsets of one closing."""
        world_T_palm = samples.world_T_forearm @ forearm_T_palm_matrix(samples.joints_rad, self._side)
        frames = world_T_palm[:, None] @ palm_T_distal_matrices(samples.joints_rad, self._side)
        for finger, tip in self._fingertips.items():
            at = FINGERS.index(finger)
            felt = np.nan_to_num(tip.wrenches(samples.readings[:, at], frames[:, at, :3, :3]))
            forces = np.einsum("nij,nj->ni", frames[:, at, :3, :3], felt[:, :3])
            self._take(forces, frames[:, at])
        self.problem = self._in_words()

    def _in_words(self) -> str:
        if (delay := self.delay_s) is None or delay[0] < max(_TOLD_s, _TOLD_SIGMAS * delay[1]):
            return ""
        late_ms, sigma_ms = (1e3 * value for value in delay)
        return (
            f"their forces arrive {late_ms:.0f} ms later than the joint angles of the same moment (standard error "
            f"{sigma_ms:.0f} ms): look for a filter or a slow connection of the force sensors"
        )

    def _take(self, forces_N: Array, frames: Array) -> None:
        sizes_N = np.linalg.norm(forces_N, axis=1)
        onsets = np.flatnonzero((sizes_N[1:] > _ONSET_N) & (sizes_N[:-1] <= _ONSET_N)) + 1
        if not len(onsets):
            return
        first, last = onsets[0] - _BEFORE - _MARGIN, onsets[0] + _AFTER + _MARGIN
        if first < 0 or last > len(sizes_N):
            return
        against = forces_N[onsets[0] + 2] / max(float(np.linalg.norm(forces_N[onsets[0] + 2])), 1e-9)
        inwards_m = -(frames[first:last, :3, 3] + 0.02 * frames[first:last, :3, 2]) @ against
        self._misfits.append(_misfits(sizes_N[first + _MARGIN : last - _MARGIN], inwards_m))


def _misfits(sizes_N: Array, inwards_m: Array) -> Array:
    """Share of the force that a spring does not explain, for each delay."""
    now = np.arange(_MARGIN, _MARGIN + len(sizes_N))
    shift = _DELAYS_s * NANOSECONDS / SAMPLE_ns
    ways_m = np.interp(now - shift[:, None], np.arange(len(inwards_m)), inwards_m)
    met_m = np.quantile(ways_m, _STARTS, axis=1).T[..., None]
    deep_m = np.maximum(ways_m[:, None] - met_m, 0.0)
    explained = (deep_m @ sizes_N) ** 2 / np.maximum((deep_m**2).sum(axis=-1), 1e-12)
    return np.asarray(1.0 - explained.max(axis=1) / (sizes_N @ sizes_N))
