"""Other places of grasps on their object, and what each is predicted to cost."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from drivers.core.contacts import Array
from tactile_lab.slam.tracking.contacts.contact_map import ContactMap
from tactile_lab.slam.tracking.contacts.motion import MotionNoise
from tactile_lab.slam.tracking.evidence.motion_cost import MotionCost
from tactile_lab.slam.tracking.joint.proposals import GraspMatch, Matched, ProposalSettings, elsewhere, propose

_OF_A_GRASP = 2


@dataclass(frozen=True)
class Search:
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


_IN_SPACE = Search(rounds=12, tried=4, hopeless_nats=6.0, least_gain_nats=0.5, longest_run=6)
_IN_PLANE = Search(rounds=3, tried=6, hopeless_nats=15.0, least_gain_nats=3.0, longest_run=1)


@dataclass(frozen=True)
class Place:
    """A grasp at another place, or a few successive ones.

    Attributes:
        index: of the first grasp.
        rows: their poses there, shape (k, size).
        change: predicted change of the cost, with the rest unchanged.
    """

    index: int
    rows: Array
    change: float


def search_of(contact_map: ContactMap) -> Search:
    """The settings for a trajectory in the plane or in space."""
    return _IN_SPACE if contact_map.dimension == 3 else _IN_PLANE


def movable(contact_map: ContactMap) -> range:
    """Grasps that may be elsewhere: not one alone, nor the first of a long session, which sums its settled ones up."""
    count = len(contact_map.placed)
    return range(1 if contact_map.archive else 0, count if count > 1 else 0)


def promising(outlook: Outlook, hopeless_nats: float) -> list[Place]:
    """The places of all grasps that may be as likely as the present ones, best first."""
    found = sorted(outlook.all_places(), key=lambda place: place.change)
    return [place for place in found if place.change < hopeless_nats]


class Outlook:
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
        self._rows, self._search = contact_map.rows, search_of(contact_map)
        self._wide, self._motion = noise.accumulate(2), MotionCost.of(contact_map, noise)
        self._now = self._motion.steps(self._rows)
        self._known: dict[int, tuple[Array, Array]] = {}

    def all_places(self) -> list[Place]:
        """Other places of all grasps."""
        later = [place for index in self._onto if index > 0 for place in self.places(index)]
        return later if self._map.archive else later + self._beginnings()

    def _beginnings(self) -> list[Place]:
        """Other places of the first grasps of a session, read backwards from the one after them."""
        longest = min(self._search.longest_run, len(self._rows) - 1)
        return self._best([place for count in range(1, longest + 1) for place in self._beginning(count)])

    def _beginning(self, count: int) -> list[Place]:
        """Other places of so many first grasps."""
        found, last = [], count - 1
        if not all(index in self._onto for index in range(count)):
            return []
        rows, told = self._elsewhere(last, *self._drive(last, self._before(last, self._rows[count])))
        paid = told + [self._step_change_into(count, last, row[None]) for row in rows]
        for first in [i for i in np.argsort(paid)[:_OF_A_GRASP] if paid[i] < self._search.hopeless_nats]:
            place = self._led_back(last, rows[first], float(told[first]))
            found += [] if place is None else [place]
        return found

    def _led_back(self, last: int, row: Array, told: float) -> Place | None:
        """The grasps before one at another place, at their resulting places; None if they have none."""
        run = row[None]
        for earlier in range(last - 1, -1, -1):
            rows, changes = self._elsewhere(earlier, *self._drive(earlier, self._before(earlier, run[0])))
            if len(rows) == 0:
                return None
            longer = [np.vstack([each, run]) for each in rows]
            prices = changes + [self._step_change_into(earlier + 1, earlier, each) for each in longer]
            best = int(np.argmin(prices))
            run, told = longer[best], told + float(changes[best])
        return self._place(0, run, told)

    def places(self, index: int) -> list[Place]:
        """Other places of one grasp, and of those that follow it as far as a wrong turn may reach."""
        rows, told = self._elsewhere(index, *self._drive_now(index))
        alone = [self._place(index, row[None], each) for row, each in zip(rows, told, strict=True)]
        paid = told + [self._step_change_into(index, index, row[None]) for row in rows]
        first = [i for i in np.argsort(paid)[:_OF_A_GRASP] if paid[i] < self._search.hopeless_nats]
        together = [place for i in first for place in self._runs(index, rows[i], float(told[i]), float(paid[i]))]
        return self._best(alone) + self._best(together)

    def _best(self, places: list[Place]) -> list[Place]:
        hopeful = [place for place in places if place.change < self._search.hopeless_nats]
        return sorted(hopeful, key=lambda place: place.change)[:_OF_A_GRASP]

    def _runs(self, index: int, row: Array, told: float, paid: float) -> list[Place]:
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
            rows, changes = self._elsewhere(following, *self._drive(following, self._after(following, run[-1])))
            if len(rows) == 0:
                break
            longer = [np.vstack([run, each]) for each in rows]
            prices = changes + [self._step_change_into(following, index, each) for each in longer]
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
        """As :meth:`_drive` with the other grasps unchanged; computed once."""
        if index not in self._known:
            before = self._after(index, self._rows[index - 1]) if index else self._before(0, self._rows[1])
            self._known[index] = self._drive(index, before)
        return self._known[index]

    def _after(self, index: int, before: Array) -> Array:
        """Where the hand's motion leads from the place of the grasp before."""
        return self._map.space.compose(self._map.placed[index].motion, before)

    def _before(self, index: int, after: Array) -> Array:
        """Where the hand's motion to the place of the grasp after it came from."""
        return self._map.space.compose(self._map.space.inverse(self._map.placed[index + 1].motion), after)

    def _drive(self, index: int, predicted: Array) -> tuple[Array, Array]:
        """The place of a grasp and its places driven onto the object, with its contacts' costs."""
        space, grasp, field = self._map.space, self._map.placed[index], self._onto[index]
        proposed, _ = propose(predicted, grasp.contacts_world, field, self._wide, self._settings, space)
        match = GraspMatch(predicted, grasp.contacts_world, field, self._wide, self._settings, space)
        rows = np.vstack([self._rows[index], proposed])
        away = space.deviation(rows, predicted) / space.sigmas(self._wide)
        return rows, match.fit(rows, match.variance(rows)).cost - 0.5 * np.sum(away**2, axis=1)

    def _place(self, index: int, rows: Array, told: float) -> Place:
        return Place(index, rows, told + float(np.sum(self._step_changes(index, rows))))

    def _step_change_into(self, grasp: int, index: int, rows: Array) -> float:
        """How the cost of the step to a grasp changes with a run of grasps, from one on, at other poses."""
        return float(self._step_changes(index, rows)[grasp - 1])

    def _step_changes(self, index: int, rows: Array) -> Array:
        """How the cost of each step changes with a run of grasps, from one on, at other poses, shape (k - 1,)."""
        moved = self._rows.copy()
        moved[index : index + len(rows)] = rows
        return self._motion.steps(moved) - self._now
