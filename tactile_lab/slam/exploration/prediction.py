"""Predicts where candidates would touch, over sampled surfaces, poses and errors of execution.

No ground truth is used. One sample is one possible world: a surface drawn around the estimated one, a pose of the
object drawn from the particles, and an error of the hand's own placement. All candidates are tested in the same worlds,
so that their differences are not random.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from pydantic import Field
from scipy.spatial import cKDTree

from drivers.core.configuration import StrictModel
from drivers.core.contacts import Array
from tactile_lab.slam.exploration.candidates import Candidate, ClosingRays
from tactile_lab.slam.exploration.policy import Belief, Surface
from tactile_lab.slam.shape.fields.gpis import Gpis
from tactile_lab.slam.tracking.contacts.motion import compose, inverse, pose_vector

_MOST_VERTICES = 160
_LARGEST_MOVE_m = 0.015


class ExecutionNoise(StrictModel):
    """Standard deviations of how a grasp is executed against how it was planned.

    Attributes:
        palm_m, palm_rad: of the palm's place per axis, and its heading.
        finger_m: of each finger's path, sideways.
    """

    palm_m: float = Field(default=0.003, ge=0)
    palm_rad: float = Field(default=float(np.deg2rad(3.0)), ge=0)
    finger_m: float = Field(default=0.002, ge=0)


@dataclass(frozen=True)
class PossibleWorlds:
    """Sampled possible worlds.

    Attributes:
        surface: the estimated one.
        corners_m: its sampled vertices, shape (s, n, d).
        world_T_object: sampled poses, rows, shape (s, 3).
        palm_errors: rows, in the grasp frame, shape (s, 3).
        finger_errors_m: sideways, in the grasp frame, shape (s, fingers, 2).
    """

    surface: Surface
    corners_m: Array
    world_T_object: Array
    palm_errors: Array
    finger_errors_m: Array


@dataclass(frozen=True)
class ExpectedTouches:
    """Contacts of every candidate in every world, object frame.

    Attributes:
        vertices: nearest vertex of the estimated surface, -1 for a finger that meets nothing, shape (c, s, fingers).
        points_m: places on the sampled surface, NaN for none, shape (c, s, fingers, d).
    """

    vertices: NDArray[np.int64]
    points_m: Array

    @property
    def touching(self) -> NDArray[np.bool_]:
        """Shape (c, s, fingers)."""
        return np.asarray(self.vertices >= 0)


def sampled_displacements(gpis: Gpis, surface: Surface, count: int, rng: np.random.Generator) -> Array:
    """Surfaces drawn from the process's posterior: how far each vertex moves outwards, shape (count, n), metres.

    To first order the surface moves by minus the change of the field over its slope. The joint posterior (4.9) is drawn
    at up to 160 vertices, and the others follow the nearest of them; moves are limited to 15 mm.
    """
    chosen = np.linspace(0, len(surface.points_m) - 1, min(len(surface.points_m), _MOST_VERTICES)).astype(int)
    covariance = gpis.joint_covariance(surface.points_m[chosen])
    scale = surface.sigma_m[chosen] / np.sqrt(np.maximum(np.diag(covariance), 1e-18))
    values, vectors = np.linalg.eigh(covariance)
    fields = rng.normal(size=(count, len(chosen))) * np.sqrt(np.maximum(values, 0.0)) @ vectors.T
    between = np.arange(len(surface.points_m))
    if surface.points_m.shape[1] == 3:
        apart = np.linalg.norm(surface.points_m[:, None] - surface.points_m[chosen][None], axis=-1)
        moves = (fields * scale)[:, apart.argmin(axis=1)]
    else:
        moves = np.array([np.interp(between, chosen, row) for row in fields * scale])
    return np.asarray(np.clip(moves, -_LARGEST_MOVE_m, _LARGEST_MOVE_m))


def possible_worlds(
    belief: Belief, surface: Surface, fingers: int, count: int, noise: ExecutionNoise, rng: np.random.Generator
) -> PossibleWorlds:
    """Draw worlds from a belief that has a surface."""
    moves = np.zeros((count, len(surface.points_m)))
    if len(belief.displacements_m):
        moves = belief.displacements_m[rng.integers(len(belief.displacements_m), size=count)]
    palm = rng.normal(size=(count, 3)) * [noise.palm_m, noise.palm_m, noise.palm_rad]
    return PossibleWorlds(
        surface=surface,
        corners_m=surface.points_m + moves[..., None] * surface.normals,
        world_T_object=sampled_poses(belief, count, rng),
        palm_errors=palm,
        finger_errors_m=noise.finger_m * rng.normal(size=(count, fingers, 2)),
    )


def sampled_poses(belief: Belief, count: int, rng: np.random.Generator) -> Array:
    """Rows (x m, y m, yaw rad) from the particles, or from the Gaussian about the pose where there are none."""
    if len(belief.particles):
        places = np.searchsorted(np.cumsum(belief.weights), rng.random(count) * belief.weights.sum())
        return np.asarray(belief.particles[np.minimum(places, len(belief.particles) - 1)])
    values, vectors = np.linalg.eigh(belief.pose_covariance)
    spread = rng.normal(size=(count, 3)) * np.sqrt(np.maximum(values, 0.0)) @ vectors.T
    return np.asarray(pose_vector(belief.world_T_object) + spread)


def most_fingers(candidates: Sequence[Candidate]) -> int:
    """Largest number of fingers that a candidate closes."""
    return max(len(candidate.rays.fingers) for candidate in candidates)


def expected_touches(candidates: Sequence[Candidate], belief: Belief, worlds: PossibleWorlds) -> ExpectedTouches:
    """Cast the fingers' paths of all candidates in all worlds; candidates with fewer fingers touch with fewer.

    A fingertip's centre comes to rest on the surface moved outward by its radius, which all candidates share, and
    touches the place that this part of it was moved from.
    """
    from tactile_lab.slam.exploration.first_hits import first_hits  # here: compiled loops load slowly

    fingers = worlds.finger_errors_m.shape[1]
    padded = [_pad(candidate.rays, fingers) for candidate in candidates]
    starts, ways, longest = (np.array(parts) for parts in zip(*padded, strict=True))
    frames = np.array([pose_vector(candidate.world_T_grasp) for candidate in candidates])
    starts, ways, longest = *_in_worlds(frames, starts, ways, belief, worlds), longest.ravel()
    outward_m = candidates[0].rays.radius_m * worlds.surface.normals
    around_m = worlds.corners_m + outward_m
    distances = first_hits(around_m, worlds.surface.cells, starts, ways, longest)
    touching = np.isfinite(distances)
    points = starts + np.where(touching, distances, np.nan)[..., None] * ways
    vertices = np.full(distances.shape, -1, dtype=np.int64)
    vertices[touching] = _nearest(around_m, points, touching)
    points[touching] -= outward_m[vertices[touching]]
    shape = (len(distances), len(candidates), fingers)
    return ExpectedTouches(
        vertices.reshape(shape).transpose(1, 0, 2), points.reshape(*shape, belief.dimension).transpose(1, 0, 2, 3)
    )


def _pad(rays: ClosingRays, fingers: int) -> tuple[Array, Array, Array]:
    """Starts, directions and lengths for this many fingers; missing fingers have paths of length zero."""
    absent = fingers - len(rays.fingers)
    if absent == 0:
        return rays.starts_m, rays.directions, rays.lengths_m
    ways = np.vstack([rays.directions, np.tile([1.0, 0.0, 0.0], (absent, 1))])
    return np.pad(rays.starts_m, ((0, absent), (0, 0))), ways, np.pad(rays.lengths_m, (0, absent))


def _nearest(corners_m: Array, points: Array, touching: NDArray[np.bool_]) -> NDArray[np.int64]:
    """Index of the vertex, in its own world, nearest to each touch."""
    worldwise = zip(corners_m, points, touching, strict=True)
    return np.concatenate([cKDTree(corners).query(own[met])[1] for corners, own, met in worldwise]).astype(np.int64)


def _in_worlds(
    frames: Array, starts_m: Array, directions: Array, belief: Belief, worlds: PossibleWorlds
) -> tuple[Array, Array]:
    """Starts and unit directions in the object frame of every world, each of shape (s, c fingers, d).

    Args:
        frames: grasp frames in the world, rows, shape (c, 3).
        starts_m, directions: in their grasp frames, shape (c, fingers, 3).
        belief, worlds: as they are.
    """
    rows = compose(inverse(worlds.world_T_object)[:, None], frames[None])
    rows = compose(rows, worlds.palm_errors[:, None])
    cosine, sine = np.cos(rows[..., 2]), np.sin(rows[..., 2])
    turns = np.stack([np.stack([cosine, sine], axis=-1), np.stack([-sine, cosine], axis=-1)], axis=-2)
    starts, ways = (np.repeat(rays[None], len(rows), axis=0) for rays in (starts_m, directions))
    starts[..., :2] = (starts[..., :2] + worlds.finger_errors_m[:, None]) @ turns + rows[..., None, :2]
    ways[..., :2] = ways[..., :2] @ turns
    starts[..., 2] -= belief.origin_height_m
    flat = (len(rows), -1, belief.dimension)
    starts, ways = (rays[..., : belief.dimension].reshape(flat) for rays in (starts, ways))
    return starts, ways / np.maximum(np.linalg.norm(ways, axis=-1, keepdims=True), 1e-9)


def nominal_world(belief: Belief, surface: Surface, fingers: int) -> PossibleWorlds:
    """The single world in which everything is as estimated and executed as planned."""
    return PossibleWorlds(
        surface,
        surface.points_m[None],
        pose_vector(belief.world_T_object)[None],
        np.zeros((1, 3)),
        np.zeros((1, fingers, 2)),
    )
