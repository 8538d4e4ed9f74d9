"""Objects that are explored grasp by grasp: one that is fixed, and one that every grasp pushes aside."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Protocol

import numpy as np
from gtsam import Pose2, Pose3

from drivers.core.contacts import Array, Grasp
from drivers.core.poses import planar, spatial
from tactile_lab.evaluation.registration import registration_rms_mm
from tactile_lab.experiments.coverage_criteria import ExploredMap
from tactile_lab.experiments.data.planar_hand import PlanarHand, slip
from tactile_lab.experiments.data.sensing import SLIP_SIGMA_m, SLIP_SIGMA_rad
from tactile_lab.slam.exploration.policy import Belief
from tactile_lab.slam.exploration.prediction import sampled_displacements
from tactile_lab.slam.slam_settings import SlamSettings
from tactile_lab.slam.tactile_slam import TactileSlam
from tactile_lab.slam.tracking.contacts.motion import MotionNoise, compose, pose_vector, sample_motion

_SAMPLED_SURFACES, _PARTICLES = 16, 500
_SLIP = np.array([SLIP_SIGMA_m, SLIP_SIGMA_m, SLIP_SIGMA_rad])


class ExploredObject(Protocol):
    """The object of an exploration, and what is known of it."""

    def grasp(self, palm: Array) -> None:
        """Grasp with the palm at a pose relative to the object's estimated pose, as pose vector (x m, y m, yaw rad)."""

    @property
    def world_T_body(self) -> Pose2:
        """Estimated pose of the object."""

    def map(self) -> ExploredMap | None:
        """The field through all contacts at their present estimates; None before there are any."""

    def in_map_frame(self, points_body_m: Array) -> Array:
        """The true outline, aligned to the map by the best fit of all contacts; shape (n, 2). For evaluation only."""

    def belief(self, known: ExploredMap, rng: np.random.Generator) -> Belief:
        """The belief that a policy may use."""

    def registration_mm(self) -> float | None:
        """Registration error of the trajectory; None if the pose is known."""


@dataclass
class FixedObject:
    """Its pose is known and never changes; body, object and world frames are the same.

    Attributes:
        hand: executes grasps on it.
        grasps: all so far.
    """

    hand: PlanarHand
    grasps: list[Grasp] = field(default_factory=list)

    @property
    def world_T_body(self) -> Pose2:
        return Pose2()

    def grasp(self, palm: Array) -> None:
        self.grasps.append(self.hand.grasp(len(self.grasps), Pose2(*palm), Pose2()))

    def map(self) -> ExploredMap | None:
        points, normals, _ = _all_contacts(self.grasps)
        return ExploredMap.of(points, normals) if len(points) else None

    def in_map_frame(self, points_body_m: Array) -> Array:
        return points_body_m

    def belief(self, known: ExploredMap, rng: np.random.Generator) -> Belief:
        points, normals, indices = _all_contacts(self.grasps)
        return Belief(
            known.field, known.surface, points, normals, indices, Pose2(), displacements_m=_samples(known, rng)
        )

    def registration_mm(self) -> float | None:
        return None


@dataclass
class MovingObject:
    """Every grasp pushes it with the full motion noise; tactile SLAM has to track it.

    Its position is known only at the first grasp. Candidates are defined relative to the object, so the estimated
    object frame (created at the first contacts) has to be related to it once.

    Attributes:
        hand: executes grasps on it.
        slam: tracks it.
    """

    hand: PlanarHand
    slam: TactileSlam
    grasps: list[Grasp] = field(default_factory=list)
    truth: list[Pose3] = field(default_factory=list)
    frame_T_body: Pose2 = field(default_factory=Pose2)
    _true_pose: Pose2 = field(default_factory=Pose2)

    @classmethod
    def track_by(cls, method: str, hand: PlanarHand, seed: int) -> MovingObject:
        """An object that one of the methods of tactile SLAM tracks."""
        return cls(hand, TactileSlam(SlamSettings.model_validate({"method": method, "dimension": 2}), seed))

    @property
    def world_T_body(self) -> Pose2:
        return self._world_T_frame.compose(self.frame_T_body)

    @property
    def _world_T_frame(self) -> Pose2:
        pose = self.slam.world_T_object
        return self._true_pose if pose is None else planar(pose)

    def grasp(self, palm: Array) -> None:
        world_T_palm = self.world_T_body.compose(Pose2(*palm))
        born = self.slam.world_T_object is not None
        if born:
            self._true_pose = slip(self._true_pose, self.frame_T_body.inverse(), _SLIP, self.hand.rng)
        grasp = self.hand.grasp(len(self.grasps), world_T_palm, self._true_pose)
        self.grasps.append(grasp)
        self.truth.append(spatial(self._true_pose))
        self.slam.add_grasp(grasp)
        if not born and self.slam.world_T_object is not None:
            self.frame_T_body = planar(self.slam.world_T_object).between(self._true_pose)

    def map(self) -> ExploredMap | None:
        surface = self.slam.surface
        return None if surface is None else ExploredMap.of(surface.contacts_m, surface.normals)

    def in_map_frame(self, points_body_m: Array) -> Array:
        placed = [(g, p, t) for g, p, t in zip(self.grasps, self.slam.trajectory, self.truth, strict=True) if p]
        estimated = np.concatenate([_place(grasp, planar(pose)) for grasp, pose, _ in placed])
        true = np.concatenate([_place(grasp, planar(pose)) for grasp, _, pose in placed])
        return moved_alike(points_body_m, true, estimated)

    def belief(self, known: ExploredMap, rng: np.random.Generator) -> Belief:
        """Contacts are assigned to grasps in order; those that the tracker rejected are missing."""
        field_ = known.field
        latest = _nearest_rows(field_.contacts_m, _place(self.grasps[-1], self._world_T_frame))
        indices = np.zeros(len(field_.contacts_m), dtype=np.int64)
        indices[latest] = 1
        covariance = self.slam.pose_covariance
        assert covariance is not None
        particles = self._particles(covariance, rng)
        return Belief(
            field_,
            known.surface,
            field_.contacts_m,
            field_.normals,
            indices,
            self._world_T_frame,
            pose_covariance=covariance,
            particles=particles,
            weights=np.full(len(particles), 1.0 / len(particles)),
            displacements_m=_samples(known, rng),
        )

    def registration_mm(self) -> float | None:
        points = [grasp.points_world_m for grasp in self.grasps]
        return registration_rms_mm(points, self.slam.trajectory, self.truth, 2)

    def _particles(self, covariance: Array, rng: np.random.Generator) -> Array:
        """Samples of the present estimate, plus the possible push of the next grasp."""
        values, vectors = np.linalg.eigh(covariance)
        spread = rng.normal(size=(_PARTICLES, 3)) * np.sqrt(np.maximum(values, 0.0)) @ vectors.T
        return sample_motion(pose_vector(self._world_T_frame) + spread, np.zeros(3), MotionNoise(), rng)


def moved_alike(points_m: Array, source_m: Array, target_m: Array) -> Array:
    """Points transformed by the rigid motion that best maps ``source_m`` onto ``target_m``; all of shape (n, 2)."""
    start, goal = source_m.mean(axis=0), target_m.mean(axis=0)
    ahead, aside = source_m - start, target_m - goal
    sine = float(np.sum(ahead[:, 0] * aside[:, 1] - ahead[:, 1] * aside[:, 0]))
    angle = np.arctan2(sine, float(np.sum(ahead * aside)))
    motion = np.array([0.0, 0.0, angle])
    turned = compose(motion, np.pad(points_m - start, ((0, 0), (0, 1))))[:, :2]
    return np.asarray(turned + goal)


def _all_contacts(grasps: list[Grasp]) -> tuple[Array, Array, np.ndarray[tuple[int], np.dtype[np.int64]]]:
    points = np.concatenate([grasp.points_world_m[:, :2] for grasp in grasps])
    normals = np.concatenate([grasp.normals_world[:, :2] for grasp in grasps])
    indices = np.repeat(np.arange(len(grasps)), [len(grasp.contacts) for grasp in grasps])
    return points, normals, indices.astype(np.int64)


def _place(grasp: Grasp, world_T_object: Pose2) -> Array:
    return np.array([world_T_object.transformTo(point[:2]) for point in grasp.points_world_m]).reshape(-1, 2)


def _nearest_rows(rows: Array, points: Array) -> Array:
    return np.asarray(np.linalg.norm(rows[:, None] - points[None], axis=-1).argmin(axis=0))


def _samples(known: ExploredMap, rng: np.random.Generator) -> Array:
    if known.surface is None:
        return np.empty((0, 0))
    return sampled_displacements(known.field, known.surface, _SAMPLED_SURFACES, rng)
