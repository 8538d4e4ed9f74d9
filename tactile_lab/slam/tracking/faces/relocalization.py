"""Relocalization: searches other places of grasps on the object once it is known better.

While an object is explored its field is round and vague, and a grasp that closes on a corner the wrong way round, or a
width further along, fits about as well as the right one. Flat faces distinguish such places, but moving poses and faces
together from the wrong place does not lead to the right one: it must be proposed. Each grasp is driven onto the object
from many samples of the motion model, and the most promising other places are tried, one at a time.

A wrong turn of a trajectory persists: the following grasps fit each other, and none of them can go back alone. So in
space the grasps after it are also driven onto the object from its other place, and tried with it.

In space grasps are driven onto the solid that the faces make, and contacts that do not fit the field at the other
place are left out there: a wrong contact costs more than the right place of its grasp gains. In the plane only grasps
that the outline explains badly, that slid off the end of a face, or that have few contacts are tested again, and they
are driven onto the field of all others.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from drivers.core.contacts import Array
from tactile_lab.slam.shape.solids.solid_field import TabulatedSolid
from tactile_lab.slam.tracking.contacts.contact_map import ContactMap, Moved, PlacedGrasp
from tactile_lab.slam.tracking.contacts.motion import MotionNoise
from tactile_lab.slam.tracking.evidence.motion_cost import MotionCost
from tactile_lab.slam.tracking.faces.faceted_scorer import FacetedScorer
from tactile_lab.slam.tracking.joint.hypotheses import Hypothesis, cost
from tactile_lab.slam.tracking.joint.proposals import GraspMatch, Matched, ProposalSettings, elsewhere, propose

_OF_A_GRASP = 2
_SAMPLES = 48
"""Number of samples, enough for a solid, which has a larger basin of attraction than a field that is vague between
contacts.
"""

_SURFACE_SIGMA_m = 0.0005
_CLOSE_nats = 8.0
_TRIED_OF_ALL = 3
"""A grasp that fits well has a rival worth a try if that is predicted to cost at most this much more; so many are
tried.
"""

_LITTLE = 2
"""This few contacts fit many places."""


@dataclass(frozen=True)
class _Search:
    """Settings of the search.

    Attributes:
        rounds: largest number of places accepted, one after the other.
        tried: number of places per round, each with the best place of the previous round.
        hopeless_nats: a place with a predicted cost this much higher is not tried; refitting neighbours and faces gains
            a few nats, and contacts that turn out to be right some more.
        least_gain_nats: least gain of a place. A grasp with wrong contacts fits elsewhere nearly as well.
        longest_run: largest number of successive grasps that are moved together.
    """

    rounds: int
    tried: int
    hopeless_nats: float
    least_gain_nats: float
    longest_run: int


_IN_SPACE = _Search(rounds=12, tried=4, hopeless_nats=6.0, least_gain_nats=0.5, longest_run=6)
_IN_PLANE = _Search(rounds=3, tried=6, hopeless_nats=15.0, least_gain_nats=3.0, longest_run=1)


@dataclass(frozen=True)
class _Place:
    """A grasp at another place, or a few successive ones.

    Attributes:
        index: of the first grasp.
        rows: their poses there, shape (k, size).
        change: predicted change of the cost, with the rest unchanged.
    """

    index: int
    rows: Array
    change: float


class Relocalizer:
    """Searches other places of grasps on their object, and remembers those that came close.

    Attributes:
        rivals: the hypotheses of the last search that were tried and are not more likely, the most likely first.
    """

    def __init__(self, sharp: FacetedScorer, noise: MotionNoise, settings: ProposalSettings) -> None:
        """
        Args:
            sharp: scores hypotheses by flat faces.
            noise: of the motion model.
            settings: of the search.
        """
        self._sharp, self._noise, self._settings = sharp, noise, settings
        self.rivals: tuple[Hypothesis, ...] = ()

    def improve(self, best: Hypothesis) -> Hypothesis:
        """The hypothesis with grasps at other places on its object, as long as that makes it more likely.

        A hypothesis in space without flat faces or upright walls is unchanged.
        """
        search = _search(best.map)
        for _ in range(search.rounds):
            tried = self._try(best, self._places(best))
            if not tried or tried[0].cost > best.cost - search.least_gain_nats:
                self.rivals = tuple(tried)
                break
            best = tried[0]
        if best.map.dimension == 2:
            self.rivals = (*self.rivals, *self._try(best, self._places_of_all(best)))
        return best

    def _try(self, best: Hypothesis, places: list[_Place]) -> list[Hypothesis]:
        tried = [_try(best.map, place, self._sharp) for place in places]
        return sorted((each for each in tried if each is not None), key=cost)

    def _places(self, best: Hypothesis) -> list[_Place]:
        """The most promising other places of all grasps but the first, best first."""
        known, settings = best.map, self._settings
        if known.dimension == 3:
            onto, settings = _onto_solid(best, self._sharp), settings.model_copy(update={"samples": _SAMPLES})
        else:
            strayed = self._sharp.strayed(known)
            poor = [i for i, grasp in enumerate(known.placed) if i and (i in strayed or _fits_poorly(grasp))]
            onto = _onto_others(known, poor)
        search = _search(known)
        return _promising(_Outlook(known, onto, self._noise, settings), search.hopeless_nats)[: search.tried]

    def _places_of_all(self, best: Hypothesis) -> list[_Place]:
        """Close rivals of grasps in the plane that fit well where they are: nobody would move them, but they may be
        wrong nevertheless."""
        known = best.map
        well = [i for i, grasp in enumerate(known.placed) if i and len(grasp.kept) and not _fits_poorly(grasp)]
        return _promising(_Outlook(known, _onto_others(known, well), self._noise, self._settings), _CLOSE_nats)[
            :_TRIED_OF_ALL
        ]


def _promising(outlook: _Outlook, hopeless_nats: float) -> list[_Place]:
    """The places of all grasps that may be as likely as the present ones, best first."""
    found = sorted(outlook.all_places(), key=lambda place: place.change)
    return [place for place in found if place.change < hopeless_nats]


def _search(contact_map: ContactMap) -> _Search:
    return _IN_SPACE if contact_map.dimension == 3 else _IN_PLANE


def _try(contact_map: ContactMap, place: _Place, sharp: FacetedScorer) -> Hypothesis | None:
    """The map with grasps at another place, smoothed; None if its faces enclose nothing."""
    moved = contact_map
    for index, row in enumerate(place.rows, start=place.index):
        whole = replace(moved.placed[index], pose=row, left_out=frozenset(), moved=Moved.AS_MEANT)
        moved = moved.with_placed(index, whole)
    if contact_map.dimension == 2:
        return sharp.smooth(moved)
    for index in range(place.index, place.index + len(place.rows)):
        moved = sharp.clean(moved, index)
    return sharp.settle(moved)


def _onto_others(known: ContactMap, grasps: Sequence[int]) -> dict[int, Matched]:
    """The field of all other grasps, for each of these."""
    return {index: known.without_grasp(index).fit() for index in grasps}


def _onto_solid(best: Hypothesis, sharp: FacetedScorer) -> dict[int, Matched]:
    """The surface that each grasp but the first is driven onto, by number: the solid of all contacts, if any."""
    mesh = sharp.solid(best)
    if mesh is None:
        return {}
    solid = TabulatedSolid(mesh, _SURFACE_SIGMA_m)
    return {i: solid for i, grasp in enumerate(best.map.placed) if i and len(grasp.contacts_world)}


def _fits_poorly(grasp: PlacedGrasp) -> bool:
    """Whether a grasp has contacts that do not fit at its place, or few that do."""
    return len(grasp.contacts_world) >= _LITTLE and (bool(grasp.left_out) or len(grasp.kept) <= _LITTLE)


class _Outlook:
    """Other places of a trajectory's grasps, and their costs.

    Args:
        contact_map: the trajectory.
        onto: surfaces that grasps are driven onto, by their number; other grasps stay.
        noise: of the motion model.
        settings: of the proposals.
    """

    def __init__(
        self, contact_map: ContactMap, onto: dict[int, Matched], noise: MotionNoise, settings: ProposalSettings
    ) -> None:
        self._map, self._onto, self._settings = contact_map, onto, settings
        self._rows, self._search = contact_map.rows, _search(contact_map)
        self._wide, self._motion = noise.accumulate(2), MotionCost.of(contact_map, noise)
        self._now = self._motion.steps(self._rows)
        self._known: dict[int, tuple[Array, Array]] = {}

    def all_places(self) -> list[_Place]:
        """Other places of all grasps."""
        return [place for index in self._onto for place in self.places(index)]

    def places(self, index: int) -> list[_Place]:
        """Other places of one grasp, and of those that follow it as far as a wrong turn may reach."""
        rows, told = self._elsewhere(index, *self._drive_now(index))
        alone = [self._place(index, row[None], each) for row, each in zip(rows, told, strict=True)]
        paid = told + [self._step_changes(index, row[None])[index - 1] for row in rows]
        first = [i for i in np.argsort(paid)[:_OF_A_GRASP] if paid[i] < self._search.hopeless_nats]
        together = [place for i in first for place in self._runs(index, rows[i], float(told[i]), float(paid[i]))]
        return self._best(alone) + self._best(together)

    def _best(self, places: list[_Place]) -> list[_Place]:
        hopeful = [place for place in places if place.change < self._search.hopeless_nats]
        return sorted(hopeful, key=lambda place: place.change)[:_OF_A_GRASP]

    def _runs(self, index: int, row: Array, told: float, paid: float) -> list[_Place]:
        """A grasp at another place, with one or more of the following ones at their resulting places.

        Args:
            index: of the grasp.
            row: its pose there.
            told: change of its contacts' cost there.
            paid: the same with that of the step to it.
        """
        found, run = [], row[None]
        for following in range(index + 1, min(index + self._search.longest_run, len(self._rows))):
            if following not in self._onto or paid > self._search.hopeless_nats:
                break
            rows, changes = self._elsewhere(following, *self._drive(following, run[-1]))
            if len(rows) == 0:
                break
            longer = [np.vstack([run, each]) for each in rows]
            prices = changes + [self._step_changes(index, each)[following - 1] for each in longer]
            best = int(np.argmin(prices))
            run, told, paid = longer[best], told + float(changes[best]), paid + float(prices[best])
            found.append(self._place(index, run, told))
        return found

    def _elsewhere(self, index: int, rows: Array, costs: Array) -> tuple[Array, Array]:
        """The poses of a grasp that are other places, and the change of its contacts' costs there."""
        now, costs_now = self._drive_now(index)
        other, here = self._is_elsewhere(index, rows), ~self._is_elsewhere(index, now)
        return rows[other], costs[other] - np.min(costs_now[here])

    def _is_elsewhere(self, index: int, rows: Array) -> NDArray[np.bool_]:
        return elsewhere(rows, self._rows[index], self._settings, self._map.space)

    def _drive_now(self, index: int) -> tuple[Array, Array]:
        """As :meth:`_driven` with the previous grasp unchanged; computed once."""
        if index not in self._known:
            self._known[index] = self._drive(index, self._rows[index - 1])
        return self._known[index]

    def _drive(self, index: int, before: Array) -> tuple[Array, Array]:
        """The place of a grasp and its places driven onto the object, with its contacts' costs."""
        space, grasp, field = self._map.space, self._map.placed[index], self._onto[index]
        predicted = space.compose(grasp.motion, before)
        proposed, _ = propose(predicted, grasp.contacts_world, field, self._wide, self._settings, space)
        match = GraspMatch(predicted, grasp.contacts_world, field, self._wide, self._settings, space)
        rows = np.vstack([self._rows[index], proposed])
        away = space.deviation(rows, predicted) / space.sigmas(self._wide)
        return rows, match.fit(rows, match.variance(rows)).cost - 0.5 * np.sum(away**2, axis=1)

    def _place(self, index: int, rows: Array, told: float) -> _Place:
        return _Place(index, rows, told + float(np.sum(self._step_changes(index, rows))))

    def _step_changes(self, index: int, rows: Array) -> Array:
        """How the cost of each step changes with a run of grasps, from one on, at other poses, shape (k - 1,)."""
        moved = self._rows.copy()
        moved[index : index + len(rows)] = rows
        return self._motion.steps(moved) - self._now
