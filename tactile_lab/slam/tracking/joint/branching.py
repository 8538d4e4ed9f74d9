"""Branches trajectories: the poses at which a new grasp's contacts fit the known object."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.spatial.distance import cdist

from drivers.core.contacts import Array, StepSigma
from tactile_lab.slam.tracking.contacts.contact_map import ContactMap, PlacedGrasp
from tactile_lab.slam.tracking.contacts.contact_set import ContactSet
from tactile_lab.slam.tracking.contacts.free_space import free_space_costs
from tactile_lab.slam.tracking.contacts.motion import MotionNoise
from tactile_lab.slam.tracking.contacts.pose_vectors import PoseVectors
from tactile_lab.slam.tracking.joint.hypotheses import Hypothesis, HypothesisScorer, likeliest
from tactile_lab.slam.tracking.joint.proposals import propose
from tactile_lab.slam.tracking.joint.settings import JointSettings

_UNTOUCHED_m = 0.015
"""Farther than this from all contacts the shape is a guess."""


@dataclass(frozen=True)
class Branching:
    """A grasp by which hypotheses are continued.

    Attributes:
        contacts: of the grasp, world frame.
        motion: of the hand before it, a pose vector.
        motion_sigma: its own standard deviations, if it was felt.
        noise: of the motion model.
        scorer: scores the result.
        settings: of the search.
        space: kind of the pose vectors.
    """

    contacts: ContactSet
    motion: Array
    motion_sigma: StepSigma | None
    noise: MotionNoise
    scorer: HypothesisScorer
    settings: JointSettings
    space: PoseVectors

    def branches(self, hypotheses: Sequence[Hypothesis]) -> list[Hypothesis]:
        """The most likely hypotheses with the grasp placed; if it fits none of them, all with the grasp left out."""
        return self._place(hypotheses) or [self._leave_unplaced(hypothesis) for hypothesis in hypotheses]

    def surprised(self, hypotheses: Sequence[Hypothesis], found: Hypothesis) -> list[Hypothesis]:
        """The hypotheses continued with another kernel, if contacts on an object left in place do not fit.

        Where nobody touched it before, its shape is a guess that depends on the kernel. As the object has hardly moved,
        its contacts may be right and the guess wrong: the kernel is estimated again with all of them. The evidence
        decides; so the continuation without them is given the kernel that suits it best, too. In space only: an outline
        is touched all around by each grasp, and what does not fit there is rather a push.

        Args:
            hypotheses: to continue, the most likely first.
            found: the most likely continuation with the present kernel.
        """
        is_left = found.map.placed[-1].was_left(self.noise)
        if self.contacts.dimension == 2 or not is_left or not self._is_new(found.map):
            return []
        settings = hypotheses[0].map.with_grasp(self._expected(hypotheses[0])).with_best_kernel().settings
        again = [self.scorer.score(replace(each.map, settings=settings)) for each in hypotheses]
        return [*self._place(again), self.scorer.score(found.map.with_best_kernel())]

    def _is_new(self, found: ContactMap) -> bool:
        """Whether a contact that the last grasp leaves out lies where nobody touched the object before.

        Contacts of fingers that only touched are not left out: whether one of them does not fit.
        """
        last, before = len(found.placed) - 1, found.grasp_indices < len(found.placed) - 1
        if self.contacts.by_touch:
            costs = found.fit().leave_one_out_costs(np.flatnonzero(~before))
            return bool(costs.max(initial=-np.inf) > self.settings.proposals.unexplained_cost)
        left_out = found.contacts_of(last).points_m[sorted(found.placed[last].left_out)]
        if len(left_out) == 0:
            return False
        return bool(cdist(left_out, found.contacts.points_m[before]).min(axis=1).max() > _UNTOUCHED_m)

    def _expected(self, hypothesis: Hypothesis) -> PlacedGrasp:
        """The grasp where the motion model alone says that the object is."""
        last = hypothesis.map.placed[-1]
        row = self.space.compose(self.motion, last.pose)
        noise = self.noise.after(self.motion, self.motion_sigma)
        covariance = last.covariance + np.diag(self.space.sigmas(noise) ** 2)
        return PlacedGrasp(self.contacts, row, covariance, self.motion, motion_sigma=self.motion_sigma)

    def _leave_unplaced(self, hypothesis: Hypothesis) -> Hypothesis:
        """All contacts of the grasp left out: the motion model alone says where the object is."""
        longer = hypothesis.map.with_grasp(self._expected(hypothesis).put_aside())
        return replace(hypothesis, map=longer, left_out=self.scorer.price(longer))

    def _place(self, hypotheses: Sequence[Hypothesis]) -> list[Hypothesis]:
        """The most likely continuations of all hypotheses, without contacts that do not fit them.

        A grasp is only placed if most of its contacts fit: a few may fit anywhere by chance.
        """
        if len(self.contacts) == 0:
            return []
        proposed = [each for hypothesis in hypotheses for each in self._propose(hypothesis)]
        promising = likeliest(proposed, 2 * self.settings.smoothed, self.settings.evidence_gap)
        cleaned = [self._clean(branch) for branch in promising]
        return [each for each in cleaned if 2 * len(each.map.placed[-1].kept) > len(self.contacts)]

    def _clean(self, branch: Hypothesis) -> Hypothesis:
        """The branch without contacts of the last grasp that do not fit."""
        cleaned, misfit = self.scorer.clean(branch.map, len(branch.map.placed) - 1)
        return Hypothesis(cleaned, misfit, branch.intrusion, self.scorer.price(cleaned))

    def _propose(self, hypothesis: Hypothesis) -> list[Hypothesis]:
        """Continuations of a hypothesis, scored by single contacts only."""
        unplaced, placed = hypothesis.map.trailing_unplaced, hypothesis.map.placed
        before = placed[len(placed) - unplaced :]
        motions = np.array([self.motion, *(grasp.motion for grasp in before)])
        noise = self.noise.over(motions, [self.motion_sigma, *(grasp.motion_sigma for grasp in before)])
        predicted = self.space.compose(self.motion, hypothesis.map.placed[-1].pose)
        fitted = hypothesis.map.fit()
        rows, fit = propose(predicted, self.contacts, fitted, noise, self.settings.proposals, self.space)
        places, _ = self.space.to_object(rows[:, None], self.contacts.free_m, self.contacts.free_m)
        intrusions = hypothesis.intrusion + free_space_costs(fitted, places)
        found = zip(rows, np.linalg.inv(fit.information), fit.cost, intrusions, strict=True)
        proposed = []
        for row, covariance, misfit, intrusion in found:
            grasp = PlacedGrasp(self.contacts, row, covariance, self.motion, motion_sigma=self.motion_sigma)
            longer = hypothesis.map.with_grasp(grasp)
            proposed.append(
                Hypothesis(longer, hypothesis.misfit + float(misfit), float(intrusion), hypothesis.left_out)
            )
        return proposed
