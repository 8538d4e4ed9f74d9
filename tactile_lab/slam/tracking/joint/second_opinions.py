"""Second opinions at the end of a session: trajectories spliced, put-aside grasps placed, flat faces, relocalization.

An early error affects all later poses, and no single grasp takes it back. Each opinion here changes a whole trajectory,
and the evidence decides whether it is kept.
"""

from __future__ import annotations

from functools import partial

from tactile_lab.slam.tracking.contacts.motion import MotionNoise
from tactile_lab.slam.tracking.faces.faceted_scorer import FacetedScorer
from tactile_lab.slam.tracking.faces.missing_face import with_missing_face
from tactile_lab.slam.tracking.faces.relocalization import Relocalizer
from tactile_lab.slam.tracking.joint.deferred_association import Relocate, associate_deferred, readmit_contacts
from tactile_lab.slam.tracking.joint.hypotheses import Hypothesis, HypothesisScorer, cost, likeliest
from tactile_lab.slam.tracking.joint.mechanisms import Mechanisms
from tactile_lab.slam.tracking.joint.settings import JointSettings
from tactile_lab.slam.tracking.joint.trajectory_splicing import splice_trajectories

_MOST_SPLICINGS = 3
"""A trajectory with several wrong turns is repaired at one after the other."""

_MOST_REVISIONS = 3
"""So often contacts are doubted again after grasps were moved, and grasps moved again after that."""


class SecondOpinions:
    """Changes hypotheses where that makes them more likely.

    Args:
        scorer: smooths and scores without faces.
        noise: of the motion model.
        settings: of method "joint".
        mechanisms: switched on, and those that acted.
        relocate: proposes poses anywhere on the object; None for none.
    """

    def __init__(
        self,
        scorer: HypothesisScorer,
        noise: MotionNoise,
        settings: JointSettings,
        mechanisms: Mechanisms,
        relocate: Relocate | None,
    ) -> None:
        self._scorer, self._noise, self._settings = scorer, noise, settings
        self._mechanisms, self._relocate = mechanisms, relocate
        self.rivals: tuple[Hypothesis, ...] = ()
        """After :meth:`with_faces`: hypotheses that were compared with the most likely one and found less likely."""

    def splice_best(self, hypotheses: list[Hypothesis]) -> list[Hypothesis]:
        """The hypotheses, and the most likely one spliced, which is repeated with a more likely result."""
        for _ in range(_MOST_SPLICINGS):
            best = min(hypotheses, key=cost)
            spliced = self._splice(best) if self._mechanisms.has("splicing") else []
            found = self._scorer.different(hypotheses + spliced)
            hypotheses = likeliest(found, self._settings.hypotheses, self._settings.evidence_gap)
            if any(kept is one for kept in hypotheses for one in spliced):
                self._mechanisms.changed.add("splicing")
            if hypotheses[0].cost >= best.cost:
                break
        return hypotheses

    def _splice(self, hypothesis: Hypothesis) -> list[Hypothesis]:
        """The hypothesis spliced at its least likely steps."""
        others = [
            self._scorer.score(one)
            for one in splice_trajectories(hypothesis.map, self._noise, self._settings.proposals)
        ]
        promising = sorted(others, key=cost)[: self._settings.smoothed]
        return [self._scorer.smooth(other.map, self._settings.iterations) for other in promising]

    def readmit_contacts(self, best: Hypothesis) -> list[Hypothesis]:
        """The hypothesis with the contacts that it leaves out; none if it leaves out hardly any, or rightly."""
        return self._mechanisms.add("deferred association", lambda: readmit_contacts(best, self._scorer))

    def with_faces(self, hypotheses: list[Hypothesis], further: list[Hypothesis]) -> list[Hypothesis]:
        """The hypotheses scored by flat faces, most likely first.

        If splicing the most likely one makes it more likely without faces, the result is tested too. Faces decide again
        which contacts are left out, so that trajectories that differ only in these are tested once.

        Args:
            hypotheses: to be tested.
            further: those that are tested however like the others they are.
        """
        sharp = FacetedScorer(self._scorer, self._noise, self._mechanisms)
        known = self._scorer.different(hypotheses, by_contacts=False)
        found = [sharp.better(one.map) for one in (*known, *further)]
        best = min(found, key=cost)
        limit = self._scorer.score(best.map).cost
        likelier = self._mechanisms.add("splicing", lambda: self._spliced_below(limit, best, known))
        ranked = sorted(found + [sharp.better(one.map) for one in likelier], key=cost)
        best = self._mechanisms.improve("regular faces", self._relocalize(ranked[0], sharp), sharp.regular)
        return [best, *self._scorer.unlike(ranked[1:], [best])]

    def _spliced_below(self, limit: float, best: Hypothesis, known: list[Hypothesis]) -> list[Hypothesis]:
        """Other splices of a hypothesis that are more likely than a limit and differ from all known trajectories."""
        others = self._scorer.unlike(self._splice(best), known, by_contacts=False)
        return [one for one in others if one.cost < limit]

    def _relocalize(self, hypothesis: Hypothesis, sharp: FacetedScorer) -> Hypothesis:
        """The hypothesis with grasps relocalized on its object."""
        relocalizer = Relocalizer(sharp, self._noise, self._settings.proposals)
        placed = self._retry_unplaced(hypothesis, sharp)
        found = self._place_on_object(placed, relocalizer)
        for _ in range(_MOST_REVISIONS):
            if found.map is placed.map or (revised := self._revise_contacts(found, sharp)).map is found.map:
                break
            placed, found = revised, self._place_on_object(revised, relocalizer)
        self.rivals = relocalizer.rivals
        onto_missing = partial(with_missing_face, sharp=sharp, noise=self._noise)
        return self._mechanisms.improve("placing on the object", found, onto_missing)

    def _place_on_object(self, hypothesis: Hypothesis, relocalizer: Relocalizer) -> Hypothesis:
        return self._mechanisms.improve("placing on the object", hypothesis, relocalizer.improve)

    def _revise_contacts(self, hypothesis: Hypothesis, sharp: FacetedScorer) -> Hypothesis:
        """A faceted hypothesis in space that leaves out contacts, with others left out where that is more likely.

        In the plane that was done with each place of a grasp.
        """
        wrong = hypothesis.map.dimension == 3 and hypothesis.map.left_out_count > 0
        return sharp.reconsidered(hypothesis) if wrong and sharp.is_sharp(hypothesis) else hypothesis

    def _retry_unplaced(self, best: Hypothesis, sharp: FacetedScorer) -> Hypothesis:
        """The hypothesis with grasps placed that did not fit the shape with a wrong contact, if more likely."""
        again = self.place_deferred(self._scorer.score(best.map))
        return best if again.map is best.map else min(best, sharp.better(again.map), key=cost)

    def place_deferred(self, hypothesis: Hypothesis) -> Hypothesis:
        """The hypothesis with grasps placed that were put aside or fit badly, now that the object is known better."""
        relocate = self._relocate if self._mechanisms.has("relocation") else None
        noise, proposals, pushes = self._noise, self._settings.proposals, self._mechanisms.has("pushes")
        return self._mechanisms.improve(
            "deferred association",
            hypothesis,
            lambda given: associate_deferred(given, noise, proposals, relocate, self._scorer, pushes=pushes),
        )
