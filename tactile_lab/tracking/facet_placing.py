"""Grasps looked at again once the object's faces are known: where else on the solid could each one lie?

While a solid is explored its field is round and vague, and a grasp that closes on a corner the wrong way round, or a
width further along, fits about as well as the right one. Flat faces tell such places apart, but moving poses and faces
together from the wrong place does not lead to the right one: it has to be proposed. Each grasp is driven onto the
solid's surface from many samples of the motion model, and the most promising other places are tried, one at a time.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from tactile_lab.geometry.contacts import Array
from tactile_lab.shape.solid_field import SolidField
from tactile_lab.tracking.contact_map import ContactMap
from tactile_lab.tracking.hypotheses import Hypothesis, cost
from tactile_lab.tracking.motion import MotionNoise
from tactile_lab.tracking.motion_cost import MotionCost
from tactile_lab.tracking.proposals import GraspMatch, ProposalSettings, elsewhere, propose
from tactile_lab.tracking.sharp_judge import SharpJudge

_MOST_ROUNDS = 3
_MOST_TRIED = 4
"""Places that are tried in a round, and so many rounds at most, each with the best place of the one before."""

_HOPELESS_nats = 6.0
"""A place that is foreseen to cost so much more is not tried: faces and neighbours that yield bring a few nats."""

_OF_A_GRASP = 2
_SAMPLES = 48
"""Enough on a solid, which pulls from farther away than a field that is vague between contacts."""

_LEAST_GAIN_nats = 0.5
_SURFACE_SIGMA_m = 0.0005


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


def placed_on_solid(best: Hypothesis, sharp: SharpJudge, noise: MotionNoise, settings: ProposalSettings) -> Hypothesis:
    """The hypothesis with single grasps at other places of its solid, as long as that makes it likelier.

    Args:
        best: a hypothesis in space; one without flat faces or upright walls stays as it is.
        sharp: rates it in the light of flat faces.
        noise: of the motion model.
        settings: of the search.
    """
    for _ in range(_MOST_ROUNDS):
        tried = [sharp.settled(_with(best.map, place)) for place in _places(best, sharp, noise, settings)]
        found = min((each for each in tried if each is not None), key=cost, default=best)
        if found.cost > best.cost - _LEAST_GAIN_nats:
            break
        best = found
    return best


def _places(best: Hypothesis, sharp: SharpJudge, noise: MotionNoise, settings: ProposalSettings) -> list[_Place]:
    """The most promising other places of all grasps but the first, the best first."""
    mesh = sharp.solid(best)
    if mesh is None:
        return []
    settings = settings.model_copy(update={"samples": _SAMPLES})
    solid, motion = SolidField(mesh, _SURFACE_SIGMA_m), MotionCost.of(best.map, noise)
    grasps = [index for index, grasp in enumerate(best.map.placed) if index and len(grasp.contacts_world)]
    found = [place for index in grasps for place in _places_of(best.map, index, solid, motion, noise, settings)]
    return sorted(found, key=lambda place: place.change)[:_MOST_TRIED]


def _places_of(
    contact_map: ContactMap,
    index: int,
    solid: SolidField,
    motion: MotionCost,
    noise: MotionNoise,
    settings: ProposalSettings,
) -> list[_Place]:
    """Other places of one grasp on the solid."""
    space, grasp, rows = contact_map.space, contact_map.placed[index], contact_map.rows
    contacts, wide = grasp.contacts_world, noise.accumulated(2)
    predicted = space.compose(grasp.motion, rows[index - 1])
    proposed, _ = propose(predicted, contacts, solid, wide, settings, space)
    match = GraspMatch(predicted, contacts, solid, wide, settings, space)
    asked = np.vstack([rows[index : index + 1], proposed])
    away = space.deviation(asked, predicted) / space.sigmas(wide)
    told = match.fit(asked, match.variance(asked)).cost - 0.5 * np.sum(away**2, axis=1)
    steps = np.array([motion.value(_moved(rows, index, row)) for row in asked])
    changes = (told - told[0] + steps - steps[0])[1:]
    hopeful = np.flatnonzero(elsewhere(proposed, rows[index], settings, space) & (changes < _HOPELESS_nats))
    return [_Place(index, proposed[i], float(changes[i])) for i in hopeful[np.argsort(changes[hopeful])][:_OF_A_GRASP]]


def _moved(rows: Array, index: int, row: Array) -> Array:
    changed = rows.copy()
    changed[index] = row
    return changed


def _with(contact_map: ContactMap, place: _Place) -> ContactMap:
    whole = replace(contact_map.placed[place.index], row=place.row, left_out=frozenset(), moved_freely=False)
    return contact_map.with_placed(place.index, whole)
