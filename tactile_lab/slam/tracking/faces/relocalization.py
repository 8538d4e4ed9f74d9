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

The first grasps are grasps like the others, though the object frame was born there. Nothing precedes them, so that
they are predicted from the first one that stays, by the motion read backwards.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from tactile_lab.slam.shape.solids.solid_field import TabulatedSolid
from tactile_lab.slam.tracking.contacts.contact_map import ContactMap, Moved, PlacedGrasp
from tactile_lab.slam.tracking.contacts.motion import MotionNoise
from tactile_lab.slam.tracking.faces.faceted_scorer import FacetedScorer
from tactile_lab.slam.tracking.faces.other_places import Outlook, Place, movable, promising, search_of
from tactile_lab.slam.tracking.joint.hypotheses import Hypothesis, cost
from tactile_lab.slam.tracking.joint.proposals import Matched, ProposalSettings

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
        search = search_of(best.map)
        for _ in range(search.rounds):
            tried, limit = self._try(best, self._places(best)), best.cost - search.least_gain_nats
            if all(one.cost > limit for one in tried):
                tried = self._reconsidered(tried, best)
            if all(one.cost > limit for one in tried):
                self.rivals = tuple(tried)
                break
            best = tried[0]
        if best.map.dimension == 2:
            self.rivals = (*self.rivals, *self._try(best, self._places_of_all(best)))
        return best

    def _try(self, best: Hypothesis, places: list[Place]) -> list[Hypothesis]:
        tried = [_try(best.map, place, self._sharp) for place in places]
        return sorted((each for each in tried if each is not None), key=cost)

    def _reconsidered(self, tried: list[Hypothesis], best: Hypothesis) -> list[Hypothesis]:
        """Those that came close in space, with other contacts left out: what is wrong here may fit there, and what had
        a face of its own, because the grasp was here, is wrong there.
        """
        if best.map.dimension == 2:
            return tried
        again = (self._sharp.reconsidered(one) if one.cost < best.cost + _CLOSE_nats else one for one in tried)
        return sorted(again, key=cost)

    def _places(self, best: Hypothesis) -> list[Place]:
        """The most promising other places of all grasps, best first."""
        known, settings = best.map, self._settings
        if known.dimension == 3:
            onto, settings = _onto_solid(best, self._sharp), settings.model_copy(update={"samples": _SAMPLES})
        else:
            strayed = self._sharp.strayed(known)
            poor = [i for i in movable(known) if i in strayed or _fits_poorly(known.placed[i])]
            onto = _onto_others(known, poor)
        search = search_of(known)
        return promising(Outlook(known, onto, self._noise, settings), search.hopeless_nats)[: search.tried]

    def _places_of_all(self, best: Hypothesis) -> list[Place]:
        """Close rivals of grasps in the plane that fit well where they are: nobody would move them, but they may be
        wrong nevertheless."""
        known = best.map
        well = [i for i in movable(known) if len(known.placed[i].kept) and not _fits_poorly(known.placed[i])]
        return promising(Outlook(known, _onto_others(known, well), self._noise, self._settings), _CLOSE_nats)[
            :_TRIED_OF_ALL
        ]


def _try(contact_map: ContactMap, place: Place, sharp: FacetedScorer) -> Hypothesis | None:
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
    """The field of all other grasps, for each of these; none where no other has a contact."""
    others = {index: known.without_grasp(index) for index in grasps}
    return {index: rest.fit() for index, rest in others.items() if len(rest.contacts)}


def _onto_solid(best: Hypothesis, sharp: FacetedScorer) -> dict[int, Matched]:
    """The surface that each grasp is driven onto, by number: the solid of all contacts, if any."""
    mesh = sharp.solid(best)
    if mesh is None:
        return {}
    solid = TabulatedSolid(mesh, _SURFACE_SIGMA_m)
    return {i: solid for i in movable(best.map) if len(best.map.placed[i].contacts_world)}


def _fits_poorly(grasp: PlacedGrasp) -> bool:
    """Whether a grasp has contacts that do not fit at its place, or few that do."""
    return len(grasp.contacts_world) >= _LITTLE and (bool(grasp.left_out) or len(grasp.kept) <= _LITTLE)
