"""Grasps looked at again once the object is known: where else on it could each one lie?

While an object is explored its field is round and vague, and a grasp that closes on a corner the wrong way round, or a
width further along, fits about as well as the right one. Flat faces tell such places apart, but moving poses and faces
together from the wrong place does not lead to the right one: it has to be proposed. Each grasp is driven onto the
object from many samples of the motion model, and the most promising other places are tried, one at a time.

In space grasps are driven onto the solid that the faces make. An outline tells its grasps apart as it grows; only those
are asked again there that it explains badly or that say little, and they are driven onto the field of all others.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from tactile_lab.geometry.contacts import Array
from tactile_lab.shape.solid_field import SolidField
from tactile_lab.tracking.contact_map import ContactMap, Moved, PlacedGrasp
from tactile_lab.tracking.hypotheses import Hypothesis, cost
from tactile_lab.tracking.motion import MotionNoise
from tactile_lab.tracking.motion_cost import MotionCost
from tactile_lab.tracking.proposals import GraspMatch, Matched, ProposalSettings, elsewhere, propose
from tactile_lab.tracking.sharp_judge import SharpJudge

_MOST_ROUNDS = 3
_OF_A_GRASP = 2
_SAMPLES = 48
"""Enough on a solid, which pulls from farther away than a field that is vague between contacts."""

_SURFACE_SIGMA_m = 0.0005
_LITTLE = 2
"""So few contacts fit many places."""


@dataclass(frozen=True)
class _Search:
    """How far to look.

    Attributes:
        tried: so many places in a round, each with the best place of the round before.
        hopeless_nats: a place that is foreseen to cost so much more is not tried; neighbours and faces that yield bring
            a few nats, and wrong contacts that turn out to be right some more.
        least_gain_nats: what a place has to bring. A grasp that has wrong contacts fits elsewhere nearly as well.
    """

    tried: int
    hopeless_nats: float
    least_gain_nats: float


_IN_SPACE = _Search(tried=4, hopeless_nats=6.0, least_gain_nats=0.5)
_IN_PLANE = _Search(tried=6, hopeless_nats=15.0, least_gain_nats=3.0)


@dataclass(frozen=True)
class _Place:
    """One grasp at another place.

    Attributes:
        index: of the grasp.
        row: its pose there.
        change: foreseen in the cost, the rest staying where it is.
    """

    index: int
    row: Array
    change: float


def placed_on_object(best: Hypothesis, sharp: SharpJudge, noise: MotionNoise, settings: ProposalSettings) -> Hypothesis:
    """The hypothesis with single grasps at other places of its object, as long as that makes it likelier.

    Args:
        best: a hypothesis; one in space without flat faces or upright walls stays as it is.
        sharp: rates it in the light of flat faces.
        noise: of the motion model.
        settings: of the search.
    """
    search = _search(best.map)
    for _ in range(_MOST_ROUNDS):
        tried = [_tried(best.map, place, sharp) for place in _places(best, sharp, noise, settings)]
        found = min((each for each in tried if each is not None), key=cost, default=best)
        if found.cost > best.cost - search.least_gain_nats:
            break
        best = found
    return best


def _search(contact_map: ContactMap) -> _Search:
    return _IN_SPACE if contact_map.dimension == 3 else _IN_PLANE


def _tried(contact_map: ContactMap, place: _Place, sharp: SharpJudge) -> Hypothesis | None:
    """The map with a grasp at another place, smoothed; None where its faces enclose nothing."""
    whole = replace(contact_map.placed[place.index], row=place.row, left_out=frozenset(), moved=Moved.AS_MEANT)
    moved = contact_map.with_placed(place.index, whole)
    return sharp.settled(moved) if contact_map.dimension == 3 else sharp.smoothed(moved)


def _places(best: Hypothesis, sharp: SharpJudge, noise: MotionNoise, settings: ProposalSettings) -> list[_Place]:
    """The most promising other places of all grasps but the first, the best first."""
    search, known = _search(best.map), best.map
    if known.dimension == 3:
        onto, settings = _onto_solid(best, sharp), settings.model_copy(update={"samples": _SAMPLES})
    else:
        onto = {i: known.without_grasp(i).fit() for i, grasp in enumerate(known.placed) if i and _is_doubtful(grasp)}
    found = [place for i, field in onto.items() for place in _places_of(known, i, field, noise, settings)]
    return sorted(found, key=lambda place: place.change)[: search.tried]


def _onto_solid(best: Hypothesis, sharp: SharpJudge) -> dict[int, Matched]:
    """What each grasp but the first is driven onto, by its number: the solid of all contacts; nothing without one."""
    mesh = sharp.solid(best)
    if mesh is None:
        return {}
    solid = SolidField(mesh, _SURFACE_SIGMA_m)
    return {i: solid for i, grasp in enumerate(best.map.placed) if i and len(grasp.contacts_world)}


def _is_doubtful(grasp: PlacedGrasp) -> bool:
    """Whether a grasp has contacts that do not fit where it is, or hardly any that do."""
    return len(grasp.contacts_world) >= _LITTLE and (bool(grasp.left_out) or len(grasp.kept) <= _LITTLE)


def _places_of(
    contact_map: ContactMap, index: int, field: Matched, noise: MotionNoise, settings: ProposalSettings
) -> list[_Place]:
    """Other places of one grasp on the object."""
    space, grasp, rows = contact_map.space, contact_map.placed[index], contact_map.rows
    contacts, wide, motion = grasp.contacts_world, noise.accumulated(2), MotionCost.of(contact_map, noise)
    predicted = space.compose(grasp.motion, rows[index - 1])
    proposed, _ = propose(predicted, contacts, field, wide, settings, space)
    match = GraspMatch(predicted, contacts, field, wide, settings, space)
    asked = np.vstack([rows[index : index + 1], proposed])
    away = space.deviation(asked, predicted) / space.sigmas(wide)
    told = match.fit(asked, match.variance(asked)).cost - 0.5 * np.sum(away**2, axis=1)
    steps = np.array([motion.value(_moved(rows, index, row)) for row in asked])
    changes = (told - told[0] + steps - steps[0])[1:]
    hopeful = changes < _search(contact_map).hopeless_nats
    chosen = np.flatnonzero(elsewhere(proposed, rows[index], settings, space) & hopeful)
    return [_Place(index, proposed[i], float(changes[i])) for i in chosen[np.argsort(changes[chosen])][:_OF_A_GRASP]]


def _moved(rows: Array, index: int, row: Array) -> Array:
    changed = rows.copy()
    changed[index] = row
    return changed
