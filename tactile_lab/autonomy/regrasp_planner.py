"""Decides how a grasped object is turned in hand, or whether it is left in place.

A carried object slips, which makes its pose less certain, and carrying takes time. The gain are sides that the arm
could not reach. A policy that weighs information about the pose against that about the shape decides by both; the
others only choose among the turns.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from gtsam import Pose2

from drivers.core.contacts import Array, Grasp
from sessions.motion.grasp_frame import GraspFrame
from tactile_lab.autonomy.hand_candidates import HandLimits, offer
from tactile_lab.autonomy.heuristic_planner import HasRoom, anywhere
from tactile_lab.autonomy.variance_planner import KnownShape
from tactile_lab.slam.exploration.candidates import Candidate
from tactile_lab.slam.exploration.expected_information import pose_nats
from tactile_lab.slam.exploration.information_policy import InformationPolicy
from tactile_lab.slam.exploration.policy import Belief, Policy
from tactile_lab.slam.exploration.surface_policies import expected_contacts, variances_at
from tactile_lab.slam.tracking.contacts.contact_set import planar_rotation
from tactile_lab.slam.tracking.contacts.motion import MotionNoise

_TURNS = 3
"""Number of re-orientations to choose from, in each direction."""

_YAWS = 7
"""Number of candidates around the object that represent all grasps after a turn."""


@dataclass(frozen=True)
class RegraspPlanner:
    """Chooses how an object is turned.

    Attributes:
        policy: that chooses the grasps.
        limits: of the hand.
        noise: slip of a carried object.
    """

    policy: Policy
    limits: HandLimits
    noise: MotionNoise

    @property
    def may_leave(self) -> bool:
        """Whether leaving the object is weighed against carrying it."""
        return isinstance(self.policy, InformationPolicy)

    def choose(
        self,
        frame: GraspFrame,
        known: KnownShape,
        belief: Belief,
        otherwise: float,
        rng: np.random.Generator,
        has_room: HasRoom,
    ) -> float | None:
        """The turn, radians; None to leave the object.

        Args:
            frame: of the hand that holds it.
            known: its shape.
            belief: about the held object.
            otherwise: the turn if all are equal.
            rng: of sampled worlds.
            has_room: further obstacles of a plan while the object is left in place.
        """
        turns = self._turns(frame.yaw_rad)
        if self.policy.name == "random" or not turns or belief.surface is None:
            return otherwise
        if isinstance(self.policy, InformationPolicy):
            return self._most_informative(self.policy, turns, frame, known, belief, rng, has_room)
        rewards = [_best_variance(*self._after(turn, frame, known, belief)) for turn in turns]
        return turns[int(np.argmax(rewards))] if max(rewards) > min(rewards) else otherwise

    def _most_informative(
        self,
        policy: InformationPolicy,
        turns: Sequence[float],
        frame: GraspFrame,
        known: KnownShape,
        belief: Belief,
        rng: np.random.Generator,
        has_room: HasRoom,
    ) -> float | None:
        """The turn with the most information per second afterwards, if more than without; in equal worlds."""
        chance = int(rng.integers(2**62))
        strayed = belief.pose_covariance + np.diag(self.noise.sigmas**2)
        lost = pose_nats(strayed, policy.settings) - pose_nats(belief.pose_covariance, policy.settings)
        rates = []
        for turn in turns:
            candidates, turned = self._after(turn, frame, known, replace(belief, pose_covariance=strayed))
            rates.append(policy.best_rate(candidates, turned, np.random.default_rng(chance), lost, self._seconds(turn)))
        left = policy.best_rate(*self._after(0.0, frame, known, belief, has_room), np.random.default_rng(chance))
        return turns[int(np.argmax(rates))] if max(rates) > left else None

    def _seconds(self, turn_rad: float) -> float:
        """Duration of carrying."""
        return abs(turn_rad) / self.limits.cycle.carry_turn_rad_s + self.limits.cycle.rest_s

    def _turns(self, yaw_rad: float) -> list[float]:
        """Turns that keep the hand in its window."""
        low, high = self.limits.plan.yaw_window_rad
        sizes = np.linspace(*self.limits.plan.turn_rad, _TURNS)
        both = [float(sign * size) for size in sizes for sign in (1.0, -1.0)]
        return [turn for turn in both if low <= yaw_rad + turn <= high]

    def _after(
        self, turn_rad: float, frame: GraspFrame, known: KnownShape, belief: Belief, has_room: HasRoom = anywhere
    ) -> tuple[list[Candidate], Belief]:
        """A few grasps after a turn of the object about the hand's vertical axis, and the belief."""
        about = Pose2(frame.x_m, frame.y_m, 0.0)
        pose = about * Pose2(0.0, 0.0, turn_rad) * about.inverse() * belief.world_T_object
        few = self.limits.exploration.model_copy(update={"yaws": _YAWS, "shifts_m": (0.0,)})
        here = GraspFrame(frame.x_m, frame.y_m, frame.yaw_rad + turn_rad)
        offered = offer(replace(self.limits, exploration=few), known, pose, here, has_room)
        return [one.candidate for one in offered.usable], replace(belief, world_T_object=pose)


def with_contacts(belief: Belief, grasp: Grasp) -> Belief:
    """The belief with a grasp's contacts at their estimated places on the object; the field is unchanged."""
    if not grasp.contacts:
        return belief
    pose, points_m, normals = belief.world_T_object, grasp.points_world_m.copy(), grasp.normals_world.copy()
    turn = planar_rotation(float(pose.theta()))
    points_m[:, :2] = (points_m[:, :2] - [pose.x(), pose.y()]) @ turn
    points_m[:, 2] -= belief.origin_height_m
    normals[:, :2] = normals[:, :2] @ turn
    indices = np.full(len(points_m), belief.grasp_indices.max(initial=-1) + 1)
    return replace(
        belief,
        contacts_m=np.vstack([belief.contacts_m, points_m[:, : belief.dimension]]),
        normals=np.vstack([belief.normals, normals[:, : belief.dimension]]),
        grasp_indices=np.concatenate([belief.grasp_indices, indices]),
    )


def _best_variance(candidates: Sequence[Candidate], belief: Belief) -> float:
    """Largest reward (equation 4.20) of the candidates."""
    if not candidates or belief.surface is None:
        return 0.0
    found: list[Array] = expected_contacts(candidates, belief, belief.surface)
    return float(max(own.sum() for own in variances_at(belief, found)))
