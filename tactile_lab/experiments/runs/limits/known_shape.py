"""Tracking an object of known shape: how well contacts can determine a trajectory at best.

Known poses give a bound for the shape; a known shape gives a bound for the tracking. A method that has to estimate both
can hardly track an object better than one that knows the shape, the first pose and all noise levels. The posterior over
trajectories is sampled by a particle filter forwards, and by drawing trajectories through its particles backwards. The
result is the trajectory with the smallest expected error. Each of its poses is averaged only with poses that place the
grasp in the same way, because an average over all would lie between two modes.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from gtsam import Pose3, Rot3

from drivers.core.contacts import Array, Grasp
from drivers.core.poses import planar
from tactile_lab.experiments.cells import Cell
from tactile_lab.experiments.data import spatial_data
from tactile_lab.experiments.data.sensing import SLIP_SIGMA_m, SLIP_SIGMA_rad
from tactile_lab.experiments.run_metrics import registration_mm
from tactile_lab.slam.shape.fields.field_grid import FieldGrid
from tactile_lab.slam.shape.solids.solid_field import SolidField
from tactile_lab.slam.shape.surfaces.sampling import TriangleMesh
from tactile_lab.slam.tracking.contacts.contact_set import ContactSet
from tactile_lab.slam.tracking.contacts.free_space import places_on_line
from tactile_lab.slam.tracking.contacts.motion import (
    MotionNoise,
    compose,
    deviation,
    planar_motion,
    pose_vector,
    spatial_pose,
)
from tactile_lab.slam.tracking.contacts.pose_vectors import PLANAR
from tactile_lab.slam.tracking.filter.measurement import CalibratedMeasurement, CalibratedSettings, Known
from tactile_lab.slam.tracking.filter.particle_filter import Belief

PARTICLES = 100_000
_TRAJECTORIES = 200
_GRID_m, _MARGIN_m = 0.0015, 0.020
_SURFACE_SIGMA_m = 0.0003
_INSIDE_m = 0.003
"""A place known to be free lies no deeper in the object than this; allows for noise of poses and contacts."""

_FORBIDDEN_nats = 12.0
_FIRST_SIGMA = np.array([1e-4, 1e-4, 1e-3])
"""The first pose is given, since it only fixes the frame; this small spread makes particles differ."""

_JITTER = np.array([3e-4, 3e-4, 3e-3])
"""Particles drawn twice are separated by a third of the uncertainty that a grasp leaves."""

_NEGLIGIBLE = 1e-7
_ALIKE_m = 0.015
"""Poses that place a grasp's contacts this close together count as the same place on the object."""


def follow_known_shape(cell: Cell) -> dict[str, Any]:
    """The registration error with the shape known. Cell: shape, noise (percent), grasps, particles."""
    scale = cell["noise"] / 100
    data = spatial_data.simulate(cell["shape"], cell.seed, motion_scale=scale, count=cell["grasps"])
    body_T_frame = _frame(data)
    mesh = data.mesh.copy()
    mesh.apply_translation(-body_T_frame.translation())
    rng = np.random.default_rng([cell.seed, 61933])
    noise = MotionNoise(translation_m=scale * SLIP_SIGMA_m, rotation_rad=scale * SLIP_SIGMA_rad)
    height_m = data.world_T_body[0].transformFrom(body_T_frame.translation())[2]
    first = pose_vector(planar(data.world_T_body[0] * body_T_frame))
    follower = _Follower(mesh, height_m, noise, cell["particles"], rng)
    rows = follower.trajectory(data.grasps, first)
    poses = [spatial_pose(row, height_m) * body_T_frame.inverse() for row in rows]
    return {"registration_mm": registration_mm(data, poses, 3), "status": "ok"}


def _frame(data: spatial_data.SpatialGrasps) -> Pose3:
    """The object's frame, at the centre of the first contacts, about which it slips."""
    middle = data.grasps[0].points_world_m.mean(axis=0)
    return Pose3(Rot3(), data.world_T_body[0].transformTo(middle))


@dataclass
class _Follower:
    """Samples trajectories of an object with a known surface.

    Attributes:
        mesh: its surface, object frame.
        height_m: of the frame's origin over the table.
        noise: of the motion.
        particles: their number.
        rng: draws particles and trajectories.
    """

    mesh: TriangleMesh
    height_m: float
    noise: MotionNoise
    particles: int
    rng: np.random.Generator

    def __post_init__(self) -> None:
        vertices = np.asarray(self.mesh.vertices)
        low, high = vertices.min(axis=0) - _MARGIN_m, vertices.max(axis=0) + _MARGIN_m
        field = SolidField(self.mesh, _SURFACE_SIGMA_m)
        self._grid = FieldGrid.tabulate(field, low, high, _GRID_m, gradient=True, variance=True)
        self._measurement = CalibratedMeasurement(CalibratedSettings())

    def trajectory(self, grasps: tuple[Grasp, ...], first: Array) -> Array:
        """The trajectory with the smallest expected error, shape (k, 3).

        Args:
            grasps: in order.
            first: pose at the first of them, as a pose vector.
        """
        beliefs = self._filter(grasps, first)
        motions = [planar_motion(grasp.hand_motion_world) for grasp in grasps]
        samples = self._draw(beliefs, motions)
        contacts = [grasp.points_world_m for grasp in grasps]
        placed = [_place(samples[:, i], points) for i, points in enumerate(contacts)]
        apart = _apart(np.concatenate(placed, axis=1))
        middle = int(np.argmin(apart.mean(axis=1)))
        return np.array([_average(samples[:, i], middle, points) for i, points in enumerate(placed)])

    def _filter(self, grasps: tuple[Grasp, ...], first: Array) -> list[Belief]:
        """The particles after each grasp."""
        spread = self.rng.normal(size=(self.particles, 3)) * _FIRST_SIGMA
        belief = Belief(first + spread, np.full(self.particles, 1.0 / self.particles))
        beliefs = [belief]
        for grasp in grasps[1:]:
            drawn = belief.resample(self.rng)
            jittered = Belief(drawn.rows + self.rng.normal(size=drawn.rows.shape) * _JITTER, drawn.weights)
            predicted = jittered.predict(planar_motion(grasp.hand_motion_world), self.noise, self.rng)
            belief = predicted.weight(self._log_likelihood(predicted.rows, grasp)) or predicted
            beliefs.append(belief)
        return beliefs

    def _log_likelihood(self, rows: Array, grasp: Grasp) -> Array:
        """Log likelihood of the contacts, and of the free space that fingers passed."""
        contacts = ContactSet.of_grasp(grasp, 3, self.height_m)
        found = np.zeros(len(rows))
        if len(contacts):
            found = found + self._measurement.log_likelihood(rows, contacts, Known(self._grid, contacts))
        free = np.vstack([np.empty((0, 3)), *map(places_on_line, grasp.approach_paths)]) - [0.0, 0.0, self.height_m]
        for place in free:
            points, _ = PLANAR.to_object(rows[:, None], place[None], place[None])
            inside = self._grid.predict(points[:, 0]).mean_m < -_INSIDE_m
            found -= np.where(inside, _FORBIDDEN_nats, 0.0)
        return found

    def _draw(self, beliefs: list[Belief], motions: list[Array]) -> Array:
        """Trajectories drawn from the last grasp to the first, shape (s, k, 3)."""
        chosen = self.rng.choice(self.particles, _TRAJECTORIES, p=beliefs[-1].weights)
        rows = [beliefs[-1].rows[chosen]]
        for belief, motion in zip(beliefs[-2::-1], motions[:0:-1], strict=True):
            likely = np.flatnonzero(belief.weights > _NEGLIGIBLE * belief.weights.max())
            here, weights = belief.rows[likely], belief.weights[likely]
            moved = compose(motion, here)
            rows.append(np.array([here[self._before(row, moved, weights)] for row in rows[-1]]))
        return np.stack(rows[::-1], axis=1)

    def _before(self, row: Array, moved: Array, weights: Array) -> int:
        """Draw one of the previous particles by the probability that it led to a pose."""
        away = deviation(moved, row) / self.noise.sigmas
        likely = weights * np.exp(-0.5 * np.sum(away**2, axis=1)) + np.finfo(float).tiny
        return int(np.searchsorted(np.cumsum(likely), self.rng.random() * likely.sum()))


def _average(rows: Array, middle: int, placed_m: Array) -> Array:
    """The mean of those poses, shape (s, 3), that place a grasp's contacts, shape (s, n, 3), like a given one of
    them.
    """
    away_m = np.linalg.norm(placed_m - placed_m[middle], axis=2).max(axis=1, initial=0.0)
    alike = rows[away_m <= _ALIKE_m]
    return np.asarray(rows[middle] + deviation(alike, rows[middle]).mean(axis=0))


def _apart(placed_m: Array) -> Array:
    """RMS distance of the contacts between each pair of trajectories, shape (s, n, 3) to (s, s)."""
    flat = placed_m.reshape(len(placed_m), -1)
    squared = np.sum(flat**2, axis=1)
    return np.asarray(np.sqrt(np.maximum(squared[:, None] + squared - 2 * flat @ flat.T, 0.0) / placed_m.shape[1]))


def _place(rows: Array, points_world_m: Array) -> Array:
    """A grasp's contacts at each of several poses, shape (s, n, 3)."""
    return PLANAR.to_object(rows[:, None], points_world_m, points_world_m)[0]
