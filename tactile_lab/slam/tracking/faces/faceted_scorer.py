"""Scores hypotheses by flat faces, with other poses and other contacts left out than the smooth field.

A smooth field treats the only contact on a small face as an error, and a wrong contact as a bulge.
Faces distinguish these: a contact on its own face must be worth that face.
"""

from __future__ import annotations

import numpy as np

from drivers.core.errors import ShapeError
from tactile_lab.slam.shape.surfaces.surface import SurfaceMesh
from tactile_lab.slam.tracking.contacts.contact_map import ContactMap
from tactile_lab.slam.tracking.contacts.motion import MotionNoise
from tactile_lab.slam.tracking.evidence.motion_cost import MotionCost
from tactile_lab.slam.tracking.faces.facet_smoothing import FacetSmoother, smoothed_with_faces
from tactile_lab.slam.tracking.faces.flat_faces import flat_faces
from tactile_lab.slam.tracking.faces.regular_faces import made_regular
from tactile_lab.slam.tracking.faces.sharp_evidence import away_from_m, best_solid, explain, intrusion_cost, polygon
from tactile_lab.slam.tracking.faces.side_smoothing import smoothed_with_sides
from tactile_lab.slam.tracking.faces.solid_face_extents import solid_face_extents
from tactile_lab.slam.tracking.joint.hypotheses import Hypothesis, HypothesisScorer, cost
from tactile_lab.slam.tracking.joint.mechanisms import Mechanisms

_SMALL_FACE = 2
_DOUBTFUL_CHI_SQUARE = 16.0
_MOST_DOUBTS = 12
"""Contacts that are tested again: on faces of this few, or this far from theirs, and at most this many."""

_MOST_LONE = 3
"""Contacts alone on a face that are taken for wrong ones together."""

_HOPELESS_nats = 100.0
"""Flat faces that are less likely than the field by more than this are rejected, whichever contacts are left out."""

_SAME_nats = 1e-6
_ASTRAY_SIGMAS = 5.0
"""From the outline: a contact whose face holds it may be so far beyond that face's end."""
_SETTLING_STEPS = 15
_FIELD_STEPS = 10


class FacetedScorer:
    """Scores hypotheses whose object has flat faces."""

    def __init__(self, scorer: HypothesisScorer, noise: MotionNoise, mechanisms: Mechanisms | None = None) -> None:
        """
        Args:
            scorer: for smooth objects, with the price of contacts that are left out.
            noise: of the motion model.
            mechanisms: which are on; None for all.
        """
        self._scorer, self._noise, self._mechanisms = scorer, noise, mechanisms or Mechanisms()

    def better(self, contact_map: ContactMap) -> Hypothesis:
        """The map, or the one with poses smoothed together with flat faces if those explain its contacts better."""
        smooth = self._scorer.score(contact_map)
        sharp = self.smooth_with_facets(contact_map) or self._sharp(contact_map) or self._sharp_without_one(contact_map)
        if sharp is None or sharp.cost > smooth.cost + _HOPELESS_nats:
            return smooth
        return _likelier(smooth, self.reconsidered(sharp))

    def reconsidered(self, sharp: Hypothesis) -> Hypothesis:
        """A faceted hypothesis with other contacts left out where that is more likely, and smoothed again if so."""
        settled = self._mechanisms.improve("doubts", sharp, self._reconsider)
        return settled if settled.map is sharp.map else _likelier(settled, self.smooth_with_facets(settled.map))

    def without_errors(self, contact_map: ContactMap) -> ContactMap:
        """The map at its poses, without the contacts that neither a field nor flat faces explain."""
        cleaned, _ = self._scorer.clean(contact_map)
        sharp = self._sharp(cleaned) or self._sharp_without_one(cleaned)
        if sharp is None:
            return cleaned
        return _likelier(self._scorer.score(cleaned), self._mechanisms.improve("doubts", sharp, self._reconsider)).map

    def clean(self, contact_map: ContactMap, grasp: int) -> ContactMap:
        """The map without those contacts of one grasp that the field does not explain."""
        return self._scorer.clean(contact_map, grasp)[0]

    def solid(self, best: Hypothesis) -> SurfaceMesh | None:
        """The surface of a faceted hypothesis in space; None for others."""
        if not self._mechanisms.has("faces"):
            return None
        try:
            evidence, mesh = best_solid(best.map, best.map.fit())
        except ShapeError:
            return None
        sharp = self._score_explained(best.map, evidence, intrusion_cost(best.map))
        return None if sharp.cost > best.cost + _SAME_nats else mesh

    def settle(self, contact_map: ContactMap) -> Hypothesis | None:
        """Poses and faces in space smoothed together, with contacts within their faces; otherwise None."""
        try:
            faces, _ = flat_faces(contact_map)
            ends = solid_face_extents(contact_map, faces)
        except ShapeError:
            return None
        found = FacetSmoother(contact_map, self._noise, ends).fit(contact_map.rows, faces, _SETTLING_STEPS)
        return self._sharp(contact_map.with_rows(found.rows))

    def regular(self, best: Hypothesis) -> Hypothesis:
        """A faceted hypothesis with faces and poses as regular as contacts and motion allow, if more likely."""
        if not self.is_sharp(best):
            return best
        try:
            faces, _ = flat_faces(best.map)
            ends = solid_face_extents(best.map, faces) if best.map.dimension == 3 else None
        except ShapeError:
            return best
        smoother = FacetSmoother(best.map, self._noise, ends)
        at = smoother.fit(best.map.rows, faces, _SETTLING_STEPS)
        settled = best.map.with_rows(at.rows)
        faces = made_regular(settled, at.faces, smoother.information(at.rows, at.faces))
        found = smoother.fit(at.rows, faces, _SETTLING_STEPS)
        return _likelier(best, self._sharp(best.map.with_rows(found.rows)))

    def is_sharp(self, best: Hypothesis) -> bool:
        """Whether flat faces explain a hypothesis best."""
        sharp = self._sharp(best.map)
        return sharp is not None and sharp.cost <= best.cost + _SAME_nats

    def strayed(self, contact_map: ContactMap) -> frozenset[int]:
        """Grasps in the plane that have a contact on the line of a face but far beyond its ends."""
        fitted = contact_map.fit()
        try:
            away_m, weights = away_from_m(polygon(fitted), fitted)
        except ShapeError:  # nothing enclosed, or no faces in it
            return frozenset()
        return frozenset(contact_map.grasp_indices[away_m * np.sqrt(weights) > _ASTRAY_SIGMAS].tolist())

    def smooth(self, contact_map: ContactMap) -> Hypothesis:
        """As :meth:`better`, after the poses were smoothed with the field, and contacts left out that do not fit it."""
        return self.better(self._scorer.smooth(contact_map, _FIELD_STEPS).map)

    def smooth_with_facets(self, contact_map: ContactMap) -> Hypothesis | None:
        """Poses and faces smoothed together; None if there are no faces that enclose anything."""
        if not self._mechanisms.has("faces"):
            return None
        faceted = smoothed_with_faces(contact_map, self._noise)
        found = self._sharp(contact_map.with_rows(faceted.rows)) if faceted else None
        rounded = smoothed_with_sides(contact_map, self._noise)
        return found if rounded is None else _likelier_of(self._sharp(rounded), found)

    def _sharp(self, contact_map: ContactMap) -> Hypothesis | None:
        """The unchanged map, its contacts explained by a sharp shape; None if there is none."""
        if not self._mechanisms.has("faces"):
            return None
        try:
            return self._score_explained(contact_map, *explain(contact_map, contact_map.fit()))
        except ShapeError:  # nothing enclosed, or no faces in it
            return None

    def _score_explained(self, contact_map: ContactMap, explained: float, intrusion: float) -> Hypothesis:
        """The unchanged map, given the log evidence of its sharp shape and the cost of free places it fills."""
        contacts = contact_map.contacts
        constant = 0.5 * len(contacts) * (contacts.dimension + 1) * np.log(2 * np.pi)
        motion = MotionCost.of(contact_map, self._noise).value(contact_map.rows)
        misfit = motion - explained - float(constant)
        return Hypothesis(contact_map, misfit, intrusion, self._scorer.price(contact_map))

    def _sharp_without_one(self, contact_map: ContactMap) -> Hypothesis | None:
        """The most likely sharp shape of all contacts but one that may be wrong: that can be enough for faces that
        enclose nothing.
        """
        if not self._mechanisms.has("without one"):
            return None
        found = (
            self._solid_without_lone(contact_map)
            if contact_map.dimension == 3
            else self._outline_without_one(contact_map)
        )
        if found is not None:
            self._mechanisms.changed.add("without one")
        return found

    def _outline_without_one(self, contact_map: ContactMap) -> Hypothesis | None:
        """Without one of the contacts that the field explains worst."""
        costs = contact_map.fit().leave_one_out_costs(np.arange(len(contact_map.contacts)))
        worst = [contact_map.origins[each] for each in np.argsort(-costs)[:_MOST_DOUBTS]]
        found = [self._sharp(contact_map.without_contact(*each)) for each in worst]
        return min((each for each in found if each is not None), key=cost, default=None)

    def _solid_without_lone(self, contact_map: ContactMap) -> Hypothesis | None:
        """Smoothed without the contacts that are alone on their faces, if these are few; many are those of a round
        body.
        """
        faceted = smoothed_with_faces(contact_map, self._noise) if self._mechanisms.has("faces") else None
        if faceted is None:
            return None
        sizes = np.bincount(faceted.faces.labels, minlength=faceted.faces.count)
        lone = np.flatnonzero(sizes[faceted.faces.labels] == 1)
        if not 0 < len(lone) <= _MOST_LONE:
            return None
        fewer = contact_map
        for each in lone:
            fewer = fewer.without_contact(*contact_map.origins[each])
        return self.smooth_with_facets(fewer)

    def _reconsider(self, sharp: Hypothesis) -> Hypothesis:
        """Leave out contacts that a sharp shape explains only by themselves; restore those it explains better."""
        asked: set[tuple[int, int]] = set()
        while doubts := [each for each in _doubtful(sharp.map) if each not in asked]:
            for each in doubts:
                sharp = _likelier(sharp, self._sharp(sharp.map.without_contact(*each)))
            asked.update(doubts)
        return self._restore(sharp)

    def _restore(self, sharp: Hypothesis) -> Hypothesis:
        """Restore contacts that are better explained than left out: all at once, or one after the other."""
        left_out = [(i, each) for i, grasp in enumerate(sharp.map.placed) if grasp.used for each in grasp.left_out]
        whole = sharp.map
        for index, contact in left_out:
            whole = whole.with_contact(index, contact)
        fuller = _likelier(sharp, self._sharp(whole)) if left_out else sharp
        if fuller.map is whole:
            return fuller
        for index, contact in sorted(left_out)[:_MOST_DOUBTS]:
            sharp = _likelier(sharp, self._sharp(sharp.map.with_contact(index, contact)))
        return sharp


def _doubtful(contact_map: ContactMap) -> list[tuple[int, int]]:
    """Origins of contacts on faces of one or two, and those that do not fit their face, the worst first."""
    seen = contact_map.contacts
    try:
        faces, _ = flat_faces(contact_map)
    except ShapeError:
        return []
    outward = faces.normals[faces.labels]
    away = np.einsum("nd,nd->n", outward, seen.points_m) - faces.offsets_m[faces.labels]
    misfit = (away / seen.point_sigma_m) ** 2
    misfit += ~faces.leaning * np.sum((seen.normals - outward) ** 2, axis=1) / seen.normal_sigma_rad**2
    lonely = np.bincount(faces.labels, minlength=faces.count)[faces.labels] <= _SMALL_FACE
    doubts = np.flatnonzero(lonely | (misfit > _DOUBTFUL_CHI_SQUARE))
    worst_first = doubts[np.argsort(-misfit[doubts], kind="stable")][:_MOST_DOUBTS]
    origins = contact_map.origins
    return [origins[i] for i in worst_first]


def _likelier_of(one: Hypothesis | None, other: Hypothesis | None) -> Hypothesis | None:
    return other if one is None else _likelier(one, other)


def _likelier(one: Hypothesis, other: Hypothesis | None) -> Hypothesis:
    return one if other is None or one.cost <= other.cost else other
