"""Runs a policy in a session: gives it the belief and the feasible candidates, and records its decisions.

No ground truth is used: the belief comes from the estimation, the candidates from kinematics.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from gtsam import Pose2
from numpy.typing import NDArray

from drivers.core.contacts import Array, Grasp
from sessions.motion.grasp_frame import GraspFrame
from sessions.motion.grasp_plan import GraspPlan
from sessions.perception.hand_odometry import HandMotion
from tactile_lab.autonomy.hand_candidates import HandCandidate, HandLimits, Offer, offer
from tactile_lab.autonomy.heuristic_planner import HasRoom, PlanSettings, anywhere
from tactile_lab.autonomy.regrasp_planner import RegraspPlanner, with_contacts
from tactile_lab.autonomy.variance_planner import KnownShape
from tactile_lab.slam.exploration.asking import ask
from tactile_lab.slam.exploration.candidates import ModelledObject, PredictedContacts, predict_contacts
from tactile_lab.slam.exploration.policy import Belief, Decision, Policy, RivalObject
from tactile_lab.slam.exploration.prediction import sampled_displacements
from tactile_lab.slam.tracking.contacts.motion import MotionNoise, planar_motion

_SAMPLED_SURFACES = 32


@dataclass(frozen=True)
class Knowledge:
    """The knowledge of a session when a grasp is chosen.

    Attributes:
        known: the shape as estimated.
        world_T_object: expected pose of the object.
        covariance: of that, (x m, y m, yaw rad), shape (3, 3).
        grasp_indices: which grasp each contact of the shape belongs to.
        grasps_left: that the session may still make.
        here: pose of the hand; None if unknown.
        rivals: the object as it is if an alternative to the estimate is right.
    """

    known: KnownShape
    world_T_object: Pose2
    covariance: Array
    grasp_indices: NDArray[np.intp]
    grasps_left: int | None = None
    here: GraspFrame | None = None
    rivals: tuple[RivalObject, ...] = ()


@dataclass(frozen=True)
class Choice:
    """One decision of a policy, with its candidates.

    Attributes:
        number: of the grasp, from 1.
        offered: the candidates.
        decision: the policy's.
        vetoed: candidates that a person has vetoed, in order.
    """

    number: int
    offered: Offer
    decision: Decision
    vetoed: tuple[int, ...] = ()

    @property
    def plan(self) -> GraspPlan | None:
        """The plan, with its reason; None if the policy does not grasp."""
        if self.decision.chosen is None:
            return None
        plan = self.offered.usable[self.decision.chosen].plan
        return replace(plan, reason=f"{self.decision.policy}: {self.decision.reason}")

    @property
    def is_over(self) -> bool:
        """Whether the policy has nothing more to gain."""
        return self.decision.outcome == "stop"

    @property
    def reason(self) -> str:
        """The reason of the decision."""
        return self.decision.reason

    @property
    def failure(self) -> str:
        """What is wrong with the policy itself; empty while its answers are valid."""
        return self.decision.failure

    def without_chosen(self) -> Choice:
        """The next best decision after a person has vetoed the chosen candidate."""
        assert self.decision.chosen is not None
        vetoed = (*self.vetoed, self.decision.chosen)
        scores = [-np.inf if i in vetoed else score for i, score in enumerate(self.decision.scores)]
        best = int(np.argmax(scores)) if scores else 0
        if not scores or not np.isfinite(scores[best]):
            reason = f"all {len(vetoed)} candidates that could be used were vetoed"
            decision = replace(self.decision, outcome="nothing", chosen=None, reason=reason, promised_gain=None)
        else:
            reason = f"the best that is left after {len(vetoed)} vetoed by the operator"
            decision = replace(self.decision, chosen=best, reason=reason, promised_gain=None)
        return replace(self, decision=decision, vetoed=vetoed)

    def as_plain(self) -> dict[str, Any]:
        """Everything as plain data, for the record; scores that are not finite become None."""
        decision = self.decision
        return {
            "number": self.number,
            "policy": decision.policy,
            "outcome": decision.outcome,
            "chosen": decision.chosen,
            "reason": decision.reason,
            "promised_gain": decision.promised_gain,
            "vetoed": list(self.vetoed),
            "ruled_out": dict(self.offered.ruled_out),
            "candidates": [
                _plain(candidate, score) for candidate, score in zip(self.offered.usable, decision.scores, strict=True)
            ],
        }

    def sentence(self) -> str:
        """The decision in one line."""
        counted = f"{len(self.offered.usable)} candidates"
        if self.offered.ruled_out:
            counted += f" ({self.offered.obstacles})"
        return f"grasp {self.number}, {self.decision.policy}: {self.decision.reason}; {counted}"


def _plain(candidate: HandCandidate, score: float) -> dict[str, Any]:
    plan = candidate.plan
    return {
        "x_m": plan.frame.x_m,
        "y_m": plan.frame.y_m,
        "yaw_rad": plan.frame.yaw_rad,
        "closing": plan.closing,
        "height_m": plan.height_m,
        "tap": plan.tap,
        "time_s": candidate.candidate.time_s,
        "pushes": candidate.candidate.pushes,
        "score": score if np.isfinite(score) else None,
    }


class PolicyChooser:
    """Chooses grasps and re-orientations by a policy.

    Args:
        policy: see there.
        limits: of the hand.
        noise: slip of a carried object.
        rng: the policy's random numbers.
    """

    def __init__(self, policy: Policy, limits: HandLimits, noise: MotionNoise, rng: np.random.Generator) -> None:
        self.policy, self._limits, self._noise, self._rng = policy, limits, noise, rng
        self._turns = RegraspPlanner(policy, limits, noise)
        self._expected: PredictedContacts | None = None
        self._missed_m: list[Array] = []
        self._met_m: list[Array] = []

    def on_heights(self, plan: PlanSettings) -> None:
        """At which heights the object can be touched, as it was felt."""
        self._limits = replace(self._limits, plan=plan)
        self._turns = replace(self._turns, limits=self._limits)

    def choose(self, number: int, knowledge: Knowledge, has_room: HasRoom = anywhere) -> Choice:
        """The next grasp among all candidates."""
        offered = offer(self._limits, knowledge.known, knowledge.world_T_object, knowledge.here, has_room)
        belief = self._belief(knowledge)
        decision = ask(self.policy, [one.candidate for one in offered.usable], belief, self._rng)
        if decision.outcome == "nothing" and not offered.usable and not decision.failure:
            decision = replace(decision, reason=f"{decision.reason} ({offered.obstacles})")
        return Choice(number, offered, decision)

    def on_decision(self, choice: Choice, knowledge: Knowledge) -> None:
        """Note the executed grasp and its expected contacts."""
        self._expected = None
        if choice.decision.chosen is not None:
            candidate = choice.offered.usable[choice.decision.chosen].candidate
            self._expected = predict_contacts(candidate, _as_modelled_object(knowledge, knowledge.world_T_object))

    def on_grasp(self, grasp: Grasp) -> None:
        """Note the fingers that met nothing where contacts were expected."""
        expected, self._expected = self._expected, None
        self._met_m = []
        if expected is None:
            return
        met = {(contact.finger, contact.probed) for contact in grasp.contacts}
        seen: set[str] = set()
        for finger, point_m in zip(expected.fingers, expected.points_object_m, strict=True):
            (self._met_m if (finger, finger in seen) in met else self._missed_m).append(point_m)
            seen.add(finger)

    def on_unplaced_grasp(self) -> None:
        """Note that the last grasp was not registered: its expected places are as unknown as before."""
        self._missed_m += self._met_m

    def begin_anew(self) -> None:
        """The object has fallen over: nothing that is known of it holds any more."""
        self._expected, self._missed_m, self._met_m = None, [], []

    @property
    def may_leave(self) -> bool:
        """Whether the object stays in place unless there is a reason to turn it."""
        return self._turns.may_leave

    def turn(
        self, frame: GraspFrame, knowledge: Knowledge, grasp: Grasp, otherwise: float, has_room: HasRoom = anywhere
    ) -> float | None:
        """How to turn the object in hand, radians; None to leave it in place.

        Args:
            frame: of the hand.
            knowledge: from before this grasp, with the pose as certain as after it.
            grasp: this one.
            otherwise: the turn if all are equal, radians.
            has_room: further obstacles of a plan while the object is left in place.
        """
        belief = with_contacts(self._belief(knowledge), grasp)
        return self._turns.choose(frame, knowledge.known, belief, otherwise, self._rng, has_room)

    def _belief(self, knowledge: Knowledge) -> Belief:
        known, field = knowledge.known, knowledge.known.field
        moves = np.empty((0, 0))
        if known.surface is not None:
            moves = sampled_displacements(field, known.surface, _SAMPLED_SURFACES, self._rng)
        return Belief(
            field=field,
            surface=known.surface,
            contacts_m=field.contacts_m,
            normals=field.normals,
            grasp_indices=knowledge.grasp_indices.astype(np.int64),
            world_T_object=knowledge.world_T_object,
            pose_covariance=knowledge.covariance,
            displacements_m=moves,
            missed_m=np.array(self._missed_m).reshape(-1, known.dimension),
            origin_height_m=known.origin_height_m,
            grasps_left=knowledge.grasps_left,
            rivals=knowledge.rivals,
        )

    def spread(self, covariance: Array, carried: HandMotion) -> Array:
        """Covariance of the pose now, from that at the last grasp: a carry that was felt costs less than another."""
        if carried.is_rest:
            return covariance
        noise = self._noise.after(planar_motion(carried.world), carried.sigma)
        return covariance + np.diag(noise.sigmas**2)


def _as_modelled_object(knowledge: Knowledge, pose: Pose2) -> ModelledObject:
    known = knowledge.known
    return ModelledObject(known.field, known.dimension, pose, known.origin_height_m)
