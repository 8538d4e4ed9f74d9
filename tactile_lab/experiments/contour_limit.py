"""What grasps can tell of a polygon at all: the Cramér-Rao bound of its sides, at known poses and at estimated ones.

The errors of an estimate that wastes nothing have the inverse of the contacts' information as their covariance. Unknown
are the sides, whose number and neighbours are told, and the object's pose at every grasp but the first, which fixes the
frame. Each contact lies on its side up to the sensors' noise and points along its normal; between grasps the object
slips by the noise of the motion. One error is drawn a run, and its polygon is judged as estimates are. Nothing is
estimated here; what does estimate can only do better by knowing more, for instance which sides tend to be parallel.

Sides may also be *regular*: it is then told which are parallel or at right angles to which.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import approx_fprime

from tactile_lab.experiments import planar_data
from tactile_lab.experiments.cells import Cell
from tactile_lab.experiments.merit import contour_figures
from tactile_lab.experiments.outlines import edge_normals
from tactile_lab.experiments.sensing import (
    IN_PLANE,
    NORMAL_SIGMA_rad,
    POINT_SIGMA_m,
    SLIP_SIGMA_m,
    SLIP_SIGMA_rad,
    planar_pose,
)
from tactile_lab.experiments.summary import REFERENCE_METHOD
from tactile_lab.geometry.contacts import Array
from tactile_lab.geometry.poses import planar
from tactile_lab.shape.sampling import distances_to_sides
from tactile_lab.shape.surface import Contour
from tactile_lab.tracking.motion import MotionNoise, compose, deviation, inverse, planar_motion, pose_row

SIDES = ("free", "regular")
METHODS = (REFERENCE_METHOD, "estimated-pose")
POLYGONS = ("rectangle", "triangle", "L", "hexagon", "trapezoid", "pentagon")

_STEP = 1e-7
_ALIKE_rad = 1e-9
_REACH_m, _REACH_rad = 0.050, 1.0
"""What is known of a side without contacts: it lies within the hand."""


def limit_of_contour(cell: Cell) -> dict[str, Any]:
    """The figures of a polygon with a drawn error. Cell: shape, noise (percent), sides, method, grasps."""
    scale = cell["noise"] / 100
    data = planar_data.simulate(cell["shape"], cell.seed, motion_scale=scale, count=cell["grasps"])
    seen = _Seen.of(data, scale, regular=cell["sides"] == "regular")
    covariance = np.linalg.inv(seen.information(known_poses=cell["method"] == REFERENCE_METHOD))
    rng = np.random.default_rng([cell.seed, 20261])
    sides, _ = seen.at(rng.multivariate_normal(np.zeros(len(covariance)), covariance))
    corners = sides.corners()
    return contour_figures(Contour(corners, np.zeros(len(corners)), is_closed=True), seen.outline_m)


@dataclass(frozen=True)
class _Sides:
    """The sides of a polygon of n corners.

    Attributes:
        angles_rad: of their outward normals, shape (n,).
        distances_m: from the origin, shape (n,).
    """

    angles_rad: Array
    distances_m: Array

    @classmethod
    def of(cls, outline_m: Array) -> _Sides:
        normals = edge_normals(outline_m)
        return cls(np.arctan2(normals[:, 1], normals[:, 0]), np.sum(normals * outline_m, axis=1))

    @property
    def normals(self) -> Array:
        """Shape (n, 2)."""
        return np.column_stack([np.cos(self.angles_rad), np.sin(self.angles_rad)])

    def corners(self) -> Array:
        """Where each side meets the one before it, shape (n, 2)."""
        pairs = np.stack([np.roll(self.normals, 1, axis=0), self.normals], axis=1)
        distances = np.stack([np.roll(self.distances_m, 1), self.distances_m], axis=1)
        return np.asarray(np.linalg.solve(pairs, distances[..., None])[..., 0])

    def turning_together(self) -> Array:
        """1 where a side belongs to a group that is parallel or at right angles, shape (n, number of groups)."""
        away = self.angles_rad[:, None] - self.angles_rad
        alike = np.abs((away + np.pi / 4) % (np.pi / 2) - np.pi / 4) < _ALIKE_rad
        return np.asarray(np.unique(alike, axis=0).T, dtype=float)


@dataclass(frozen=True)
class _Seen:
    """A session's truth in the frame that is tracked, whose origin the object slips about, and what is unknown of it.

    Unknown, and all zero in truth: how far groups of sides are turned and sides are displaced, and for each grasp but
    the first the row (x, y, heading) that its contacts are displaced by.

    Attributes:
        outline_m: shape (n, 2).
        groups: which sides turn together, shape (n, number of groups).
        contacts_m: shape (k, 2).
        grasps, touched: grasp and side of each contact, shape (k,).
        slips: of the object between grasps, rows, shape (number of grasps - 1, 3).
        slip_sigmas: of x, y (m) and heading (rad).
    """

    outline_m: Array
    groups: Array
    contacts_m: Array
    grasps: NDArray[np.int64]
    touched: NDArray[np.int64]
    slips: Array
    slip_sigmas: Array

    @classmethod
    def of(cls, data: planar_data.PlanarGrasps, scale: float, *, regular: bool) -> _Seen:
        """Of a simulated session with slips of ``scale`` times the full motion noise."""
        bodies = [planar(pose) for pose in data.world_T_body]
        body_T_frame = bodies[0].between(planar_pose(data.grasps[0].points_world_m.mean(axis=0)))
        rows = np.array([pose_row(body.compose(body_T_frame)) for body in bodies])
        outline_m = compose(inverse(pose_row(body_T_frame)), np.pad(data.outline_m, ((0, 0), (0, 1))))[:, :2]
        index = np.repeat(np.arange(len(rows)), [len(grasp.contacts) for grasp in data.grasps]).astype(np.int64)
        points = np.concatenate([grasp.points_world_m for grasp in data.grasps]) * IN_PLANE
        contacts_m = compose(inverse(rows[index]), points)[:, :2]
        touched = distances_to_sides(contacts_m, outline_m).argmin(axis=1).astype(np.int64)
        motions = np.array([planar_motion(grasp.hand_motion_world) for grasp in data.grasps[1:]]).reshape(-1, 3)
        slips = compose(inverse(compose(motions, rows[:-1])), rows[1:])
        groups = _Sides.of(outline_m).turning_together() if regular else np.eye(len(outline_m))
        sigmas = MotionNoise(translation_m=scale * SLIP_SIGMA_m, rotation_rad=scale * SLIP_SIGMA_rad).sigmas
        return cls(outline_m, groups, contacts_m, index, touched, slips, sigmas)

    @property
    def shape_size(self) -> int:
        """How many of the unknowns are the sides'."""
        return sum(self.groups.shape)

    def information(self, *, known_poses: bool) -> Array:
        """The information in everything that is seen, about all unknowns or the sides' alone: square."""
        count = self.shape_size + (0 if known_poses else self.slips.size)
        change = approx_fprime(np.zeros(count), self._misfit, _STEP)
        turns, offsets = self.groups.shape[1], len(self.outline_m)
        weak = np.repeat([_REACH_rad**-2, _REACH_m**-2, 0.0], [turns, offsets, count - self.shape_size])
        return np.asarray(change.T @ change + np.diag(weak))

    def at(self, unknowns: Array) -> tuple[_Sides, Array]:
        """Sides, and displacements of all grasps, with these errors; those that are left out are zero."""
        given = np.zeros(self.shape_size + self.slips.size)
        given[: len(unknowns)] = unknowns
        turns, offsets_m, rows = np.split(given, [self.groups.shape[1], self.shape_size])
        true = _Sides.of(self.outline_m)
        sides = _Sides(true.angles_rad + self.groups @ turns, true.distances_m + offsets_m)
        return sides, np.vstack([np.zeros(3), rows.reshape(-1, 3)])

    def _misfit(self, unknowns: Array) -> Array:
        """Of places, of normals and of slips, in standard deviations of their noise."""
        sides, moved = self.at(unknowns)
        placed = compose(moved[self.grasps], np.pad(self.contacts_m, ((0, 0), (0, 1))))
        beside_m = np.sum(sides.normals[self.touched] * placed[:, :2], axis=1) - sides.distances_m[self.touched]
        turned = sides.angles_rad[self.touched] - placed[:, 2]
        slipped = compose(moved[:-1], compose(self.slips, inverse(moved[1:])))
        away = deviation(slipped, self.slips) / self.slip_sigmas
        return np.concatenate([beside_m / POINT_SIGMA_m, turned / np.tan(NORMAL_SIGMA_rad), away.ravel()])
