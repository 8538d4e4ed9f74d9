"""Several hypotheses of the whole trajectory, each smoothed jointly with the shape integrated out.

The filter of algorithm 3.1 commits to one map grasp by grasp and cannot take a wrong pose back. Here a
hypothesis is a whole trajectory, and its evidence (:mod:`hypotheses`) replaces a particle's weight. At each grasp the
best hypotheses branch into the poses that the measurement proposes, are smoothed, compared, and the best are kept. A
contact that fits worse than an unexplained one is left out; a grasp whose contacts mostly fit nowhere is put aside as a
whole, until the object is better known.
"""

from __future__ import annotations

from dataclasses import replace
from functools import partial

import numpy as np

from drivers.core.contacts import Array, StepSigma
from tactile_lab.slam.tracking.contacts.contact_map import ContactMap
from tactile_lab.slam.tracking.contacts.contact_set import ContactSet
from tactile_lab.slam.tracking.contacts.motion import MotionNoise
from tactile_lab.slam.tracking.evidence.fixed_lag import unfold
from tactile_lab.slam.tracking.evidence.motion_cost import estimated_noise
from tactile_lab.slam.tracking.faces.faceted_scorer import FacetedScorer
from tactile_lab.slam.tracking.faces.resolved_errors import with_errors_resolved
from tactile_lab.slam.tracking.filter.particle_filter import PoseEstimate
from tactile_lab.slam.tracking.joint.branching import Branching
from tactile_lab.slam.tracking.joint.crossed_readings import crossed_readings
from tactile_lab.slam.tracking.joint.deferred_association import Relocate, propose_pushes, relocate_last
from tactile_lab.slam.tracking.joint.hypotheses import Hypothesis, HypothesisScorer, cost, likeliest, weights
from tactile_lab.slam.tracking.joint.mechanisms import Mechanisms
from tactile_lab.slam.tracking.joint.pose_covariance import PoseCovariances, with_covariances
from tactile_lab.slam.tracking.joint.second_opinions import SecondOpinions
from tactile_lab.slam.tracking.joint.settings import JointSettings

_LEAST_TO_RELOCATE = 3
_LEAST_KNOWN = 30
"""Contacts that a grasp and the object must have before the grasp is searched anywhere on it."""

_POOR_GAIN = 2.5
"""Largest evidence (natural logarithm) of a contact on an unknown part; on a known part it is 6 to 10."""

_LEAST_FOR_FACES = 3
"""Number of grasps; fewer have hardly any faces in common."""

_LARGE_FIELD = 150
"""Contacts; in the plane its factor takes 1.6 MB, and four times as much for twice as many."""

_BACKWARD_SPREAD = {2: (4, 8), 3: (3, 4)}
"""Hypotheses kept, and branches smoothed, when a session is read backwards, by the dimension of the contacts: the
second pass need not be as thorough as the first, and in space it costs as much.
"""


class JointTracker:
    """Keeps the most likely trajectories."""

    def __init__(
        self,
        first: ContactMap,
        noise: MotionNoise,
        settings: JointSettings,
        kernel_every: int,
        relocate: Relocate | None = None,
    ) -> None:
        """
        Args:
            first: map of the first grasp.
            noise: of the motion model.
            settings: see there.
            kernel_every: kernel parameters are estimated again after this many grasps.
            relocate: proposes poses anywhere on the object if it was lost; None for none.
        """
        self._relocate, self._configured = relocate, noise
        self._noise, self._settings, self._kernel_every = noise, settings, kernel_every
        self._space = first.space
        self.mechanisms = Mechanisms(settings.without)
        self._scorer = HypothesisScorer(noise, settings.proposals.unexplained_cost, self.mechanisms)
        self._hypotheses = [self._scorer.score(self._without_free_space(first))]
        self._branches: list[Hypothesis] = []
        self._motion = np.zeros(self._space.size)
        self._motion_sigma: StepSigma | None = None
        self._whole: tuple[ContactMap, ContactMap] | None = None
        self._refined: tuple[ContactMap, ContactMap] | None = None
        self._has_ended = False
        self._rivals: tuple[Hypothesis, ...] = ()
        self._common_covariances = np.empty((0, self._space.size, self._space.size))
        self.effective_count = 1.0

    @property
    def map(self) -> ContactMap:
        best = self._hypotheses[0].map
        if self._whole is None or self._whole[0] is not best:
            self._whole = (best, unfold(best))
        return self._whole[1]

    @property
    def refined(self) -> ContactMap:
        """The most likely trajectory with flat faces, as at the end of a session; hypotheses are unchanged.

        A field binds neighbouring contacts only, so that poses that are right to a millimetre at the end are off by a
        centimetre in between.
        """
        best = self._hypotheses[0].map
        if self._refined is None or self._refined[0] is not best:
            self._refined = (best, self._with_faces(best))
        return self._refined[1]

    def _with_faces(self, best: ContactMap) -> ContactMap:
        if self._has_ended or len(best.placed) < _LEAST_FOR_FACES:
            return self.map
        return unfold(FacetedScorer(self._scorer, self._noise, self.mechanisms).better(best).map)

    @property
    def hypotheses(self) -> tuple[Hypothesis, ...]:
        """The present hypotheses, most likely first."""
        return tuple(self._hypotheses)

    @property
    def common_covariances(self) -> Array:
        """At the end of a session: of the last poses in the best common object frame, shape (n, size, size).

        See :class:`~tactile_lab.slam.tracking.joint.pose_covariance.PoseCovariances`. Settled grasps of a long session
        have none.
        """
        return self._common_covariances

    @property
    def contenders(self) -> tuple[Hypothesis, ...]:
        """The kept hypotheses but the most likely one, with all their grasps."""
        return tuple(replace(one, map=unfold(one.map)) for one in self._hypotheses[1:])

    @property
    def rivals(self) -> tuple[Hypothesis, ...]:
        """At the end of a session: hypotheses that differ from the most likely one and were found less likely."""
        rivals = (*self._hypotheses[1:], *self._rivals) if self._has_ended else ()
        return tuple(replace(one, map=unfold(one.map)) for one in rivals)

    @property
    def _has_settled(self) -> bool:
        """Whether the session is so long that its early grasps are summarized."""
        return len(self.map.placed) > 2 * self._settings.window

    def predict(self, motion: Array, measured: StepSigma | None = None) -> None:
        self._motion, self._motion_sigma = motion, measured

    def weigh(self, contacts: ContactSet) -> bool:
        """Branch every hypothesis into the poses proposed for this grasp, smooth the most likely ones and rank them."""
        contacts = contacts if self.mechanisms.has("free space") else contacts.without_free_places()
        given = self._motion, self._motion_sigma, self._noise, self._scorer, self._settings, self._space
        step = Branching(contacts, *given)
        smoothed = self._smooth(step.branches(self._hypotheses))
        best = min(smoothed, key=cost)
        smoothed += self.mechanisms.add("surprises", lambda: self._smooth(step.surprised(self._hypotheses, best)))
        smoothed += self.mechanisms.add("pushes", lambda: self._push(best))
        smoothed += self.mechanisms.add("relocation", lambda: self._relocate_grasp(min(smoothed, key=cost)))
        self._branches = self._likeliest(self._scorer.different(smoothed), self._settings.hypotheses)
        self.effective_count = float(1 / np.sum(weights(self._branches) ** 2))
        return self._branches[0].map.placed[-1].used

    def _smooth(self, branches: list[Hypothesis]) -> list[Hypothesis]:
        """The most likely branches, smoothed."""
        promising = likeliest(branches, self._settings.smoothed, self._settings.branch_gap)
        return [self._scorer.smooth(branch.map, self._settings.iterations) for branch in promising]

    def _without_free_space(self, first: ContactMap) -> ContactMap:
        """The map of the first grasp, without free space if that mechanism is off."""
        if self.mechanisms.has("free space"):
            return first
        grasp = first.placed[0]
        return first.with_placed(0, replace(grasp, contacts_world=grasp.contacts_world.without_free_places()))

    def estimate(self) -> PoseEstimate:
        """The most likely hypothesis's pose; the covariance includes its own and the spread of the hypotheses."""
        best = self._branches[0].map.placed[-1]
        rows = np.array([branch.map.placed[-1].pose for branch in self._branches])
        away = self._space.deviation(rows, best.pose)
        spread = (away * weights(self._branches)[:, None]).T @ away
        return PoseEstimate(best.pose, best.covariance + spread)

    def update_shape(self, contacts: ContactSet, certain: bool) -> None:
        """The branches contain the contacts; the last grasp gets the covariance with the spread of hypotheses."""
        best = self._branches[0]
        last = replace(best.map.placed[-1], covariance=self.estimate().covariance)
        self._branches[0] = replace(best, map=replace(best.map, placed=(*best.map.placed[:-1], last)))

    def resample(self) -> None:
        """Continue with the ranked branches; from time to time with new kernel parameters, the same for all."""
        self._hypotheses = self._branches
        count = len(self._hypotheses[0].map.placed)
        if count % self._kernel_every == 0:
            self._share_best_kernel()
            if self._settings.estimate_motion:
                self._trust(estimated_noise(self._hypotheses[0].map, self._configured))
            self._hypotheses = sorted((self._scorer.score(one.map) for one in self._hypotheses), key=cost)
        lag = self._settings
        if count > 2 * lag.window:
            self._hypotheses = [self._scorer.condense(one, lag.window, lag.remembered) for one in self._hypotheses]
        self._hypotheses = [_stored(one) for one in self._hypotheses]
        self._branches = self._hypotheses
        self._scorer.forget()

    def adopt(self, corrected: ContactMap) -> None:
        """Accept other kernel parameters; the poses are smoothed already."""
        if corrected is not self.map:
            self._hypotheses[0] = replace(self._hypotheses[0], map=corrected)

    def finish(self) -> None:
        """Smooth the remaining hypotheses to the end, including those of the session read backwards.

        If the first grasps were misleading the last ones may not be, and the evidence decides which is right.
        """
        readable = len(self.map.placed) > 2 and len(self.map.placed[-1].contacts_world) > 0
        if self._settings.backwards and not self._has_settled and readable:
            self._hypotheses = self._scorer.different(self._hypotheses + self._read_again())
        opinions = SecondOpinions(self._scorer, self._noise, self._settings, self.mechanisms, self._relocate)
        self._hypotheses = opinions.splice_best(self._hypotheses)
        for _ in range(2):
            iterations = self._settings.final_iterations
            smoothed = [self._scorer.smooth(one.map, iterations) for one in self._hypotheses]
            self._hypotheses = self._likeliest(self._scorer.different(smoothed), self._settings.hypotheses)
            self._share_best_kernel()
        placed = [opinions.place_deferred(one) for one in self._hypotheses]
        faceted = opinions.with_faces(placed, opinions.readmit_contacts(min(placed, key=cost)))
        self._rivals = opinions.rivals
        faceted[0] = self._resolve_errors(faceted[0])
        found = PoseCovariances.of(faceted[0].map, self._noise)
        faceted[0] = replace(faceted[0], map=with_covariances(faceted[0].map, found.birth))
        self._common_covariances = found.common
        self._hypotheses = [replace(one, map=unfold(one.map)) for one in faceted]
        self._has_ended = True

    def _resolve_errors(self, best: Hypothesis) -> Hypothesis:
        """The hypothesis without the errors of fingers, if its contacts say how these move them, and flat faces, which
        tell these, explain them.
        """
        told = best.map.contacts_world.shared.can_be_estimated
        if not told or not FacetedScorer(self._scorer, self._noise, self.mechanisms).is_sharp(best):
            return best
        resolve = partial(with_errors_resolved, noise=self._noise)
        return replace(best, map=self.mechanisms.improve("finger errors", best.map, resolve))

    def _push(self, best: Hypothesis) -> list[Hypothesis]:
        return propose_pushes(best, self._noise, self._settings.proposals, self._scorer)

    def _read_again(self) -> list[Hypothesis]:
        """The session read backwards, and joined with the session as it was read."""
        backwards = self._backwards()
        readings = self.map, min(backwards, key=cost).map
        return backwards + crossed_readings(*readings, self._scorer, self._settings.proposals)

    def _backwards(self) -> list[Hypothesis]:
        """The hypotheses of the same grasps in the opposite order."""
        placed, space = self.map.placed, self._space
        last = replace(placed[-1], left_out=frozenset(), covariance=placed[0].covariance)
        spread = _BACKWARD_SPREAD[self.map.dimension]
        settings = self._settings.model_copy(update={"hypotheses": spread[0], "smoothed": spread[1]})
        tracker = JointTracker(replace(self.map, placed=(last,)), self._noise, settings, self._kernel_every)
        for grasp, later in zip(placed[-2::-1], placed[:0:-1], strict=True):
            tracker.predict(space.inverse(later.motion), later.motion_sigma)
            tracker.weigh(grasp.contacts_world)
            tracker.update_shape(grasp.contacts_world, certain=True)
            tracker.resample()
        self.mechanisms.changed |= tracker.mechanisms.changed
        return [self._scorer.score(self.map.reread(one.map)) for one in tracker.hypotheses]

    def _relocate_grasp(self, best: Hypothesis) -> list[Hypothesis]:
        """Poses anywhere on the object, if a grasp does not fit the known part of it near the predicted pose."""
        contacts, known = len(best.map.placed[-1].contacts_world), len(best.map.contacts)
        gain = self._hypotheses[0].cost - best.cost
        expected = contacts >= _LEAST_TO_RELOCATE and known >= _LEAST_KNOWN
        asked = expected and gain <= _POOR_GAIN * contacts
        return relocate_last(best, self._relocate, self._scorer) if self._relocate and asked else []

    def _likeliest(self, hypotheses: list[Hypothesis], count: int) -> list[Hypothesis]:
        return likeliest(hypotheses, count, self._settings.evidence_gap)

    def _trust(self, noise: MotionNoise) -> None:
        """Continue with another noise of the motion model."""
        self._noise, self._scorer = (
            noise,
            HypothesisScorer(noise, self._settings.proposals.unexplained_cost, self.mechanisms),
        )

    def _share_best_kernel(self) -> None:
        best = self._hypotheses[0].map.with_best_kernel()
        self._hypotheses = [replace(one, map=replace(one.map, settings=best.settings)) for one in self._hypotheses]


def _stored(hypothesis: Hypothesis) -> Hypothesis:
    """The hypothesis as it waits for the next grasp: a large field is sooner computed again than kept."""
    large = len(hypothesis.map.contacts) > _LARGE_FIELD
    return replace(hypothesis, map=hypothesis.map.without_field()) if large else hypothesis
