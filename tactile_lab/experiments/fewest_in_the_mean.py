"""How few grasps any policy needs in the mean, however it plans: a lower bound, contacts alone counted.

A policy does not know beforehand how its grasps will turn out. Every function V of the places still untouched that is
zero where enough is touched gives a bound of what such a policy needs (Brown, Smith and Sun 2010, "Information
relaxations and duality in stochastic dynamic programs"): V at the start, plus the mean over all outcomes of the
smallest sum of ``1 + E V(after a grasp) - V(before it)`` over the plans of one who knows these outcomes. Were V what
the best policy still needs, no term would be negative and the bound exact. V here is a parabola in the mean-field
number of grasps to go (:mod:`tactile_lab.experiments.mean_field`); the bound holds whatever its coefficients.

The smallest sum is looked for by beam search, so that what is found is too large where the beam is too narrow.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from tactile_lab.experiments.mean_field import after_grasps, grasps_to_go
from tactile_lab.geometry.contacts import Array

_SAMPLES = 300
_BEAM, _BRANCHES = 32, 8
_LONGEST = 36
_HOPELESS = 0.5
_FAR_m = 1e3

Places = NDArray[np.bool_]


@dataclass(frozen=True)
class Law:
    """How grasps turn out.

    Attributes:
        touched: places in each of the equally likely outcomes of every candidate, shape (a, n, k).
        means: their mean, shape (k, a).
        allowed: how many places may be left untouched.
    """

    touched: Places
    means: NDArray[np.float32]
    allowed: int

    @classmethod
    def of(cls, contacts_m: Array, places_m: Array, near_m: float, goal: float) -> Law:
        """From the contacts of many grasps with every candidate.

        Args:
            contacts_m: shape (a, n, f, 2), not finite where a finger met nothing.
            places_m: of the true contour, evenly spaced, shape (k, 2).
            near_m: how near a contact has to be.
            goal: share of the places that is enough.
        """
        shape = (*contacts_m.shape[:2], len(places_m))
        touched = np.zeros(shape, dtype=bool)
        near = cKDTree(places_m).query_ball_point(np.where(np.isfinite(contacts_m), contacts_m, _FAR_m), near_m)
        for (candidate, outcome, _), places in np.ndenumerate(near):
            touched[candidate, outcome, places] = True
        allowed = int(np.floor((1.0 - goal) * len(places_m) + 1e-9))
        return cls(touched, np.ascontiguousarray(touched.mean(axis=1).T, dtype=np.float32), allowed)

    def drawn(self, count: int, rng: np.random.Generator) -> Places:
        """Outcomes of every candidate, by chance, shape (a, count, k)."""
        return self.touched[:, rng.integers(self.touched.shape[1], size=count)]


@dataclass(frozen=True)
class GraspsStillNeeded:
    """The function V.

    Attributes:
        law: of the outcomes.
        parabola: coefficients of the mean-field number of grasps to go, constant first.
    """

    law: Law
    parabola: tuple[float, float, float]

    def at(self, untouched: Places) -> float:
        """In one state, shape (k,)."""
        return float(self._of(np.array(grasps_to_go(untouched.astype(np.float32), self.law.means, self.law.allowed))))

    def expected(self, untouched: Places, candidates: NDArray[np.int64], touched: Places) -> Array:
        """Its mean after one grasp more, shape (b, t).

        The number of places touched for the first time, whose mean is known, takes most of the chance out of the
        sampled outcomes.

        Args:
            untouched: states, shape (b, k).
            candidates: shape (b, t).
            touched: sampled outcomes, shape (a, m, k).
        """
        after = after_grasps(untouched.astype(np.float32), candidates, touched, self.law.means, self.law.allowed)
        needed, new = self._of(after[..., 0]), after[..., 1]
        awry = new - new.mean(axis=-1, keepdims=True)
        slope = np.sum(awry * needed, axis=-1) / np.maximum(np.sum(awry**2, axis=-1), 1e-9)
        known = np.take_along_axis(untouched @ self.law.means, candidates, axis=1)
        return np.asarray(needed.mean(axis=-1) + slope * (known - new.mean(axis=-1)))

    def _of(self, to_go: Array) -> Array:
        return np.where(to_go > 0.0, np.polynomial.polynomial.polyval(to_go, self.parabola), 0.0)


def fewest_in_the_mean(needed: GraspsStillNeeded, rng: np.random.Generator) -> float:
    """The bound for one drawing of all outcomes, the first grasp by chance; its mean over many drawings counts."""
    law = needed.law
    sampled, outcomes = law.drawn(_SAMPLES, rng), law.drawn(_LONGEST, rng)
    start = ~law.drawn(1, rng)[rng.integers(len(law.touched)), 0]
    beam, sums, best = start[None], np.zeros(1), np.inf
    for grasp in range(_LONGEST):
        options = np.argsort(-(beam @ law.means), axis=1)[:, :_BRANCHES]
        before = np.array([needed.at(state) for state in beam])
        plans = sums[:, None] + 1.0 + needed.expected(beam, options, sampled) - before[:, None]
        after = beam[:, None] & ~outcomes[options, grasp]
        done = after.sum(axis=-1) <= law.allowed
        best = min(best, float(plans[done].min(initial=np.inf)))
        beam, sums = _smallest(after[~done], plans[~done])
        if len(sums) == 0 or sums[0] > best + _HOPELESS:
            break
    return 1.0 + needed.at(start) + best


def _smallest(states: Places, sums: Array) -> tuple[Places, Array]:
    """The plans with the smallest sums, one for each state, smallest first."""
    order = np.argsort(sums)
    states, sums = states[order], sums[order]
    kept = np.sort(np.unique(np.packbits(states, axis=1), axis=0, return_index=True)[1])[:_BEAM]
    return states[kept], sums[kept]
