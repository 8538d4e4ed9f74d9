"""Best rigid alignment of an estimated shape to the true one, for errors that leave the pose aside."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import permutations, product

import numpy as np
from gtsam import Pose2, Pose3, Rot2, Rot3
from scipy.spatial import cKDTree

from tactile_lab.geometry.contacts import Array
from tactile_lab.shape.sampling import TriangleMesh, sample_mesh, sample_polygon

_CONTOUR_SAMPLES, _MESH_SAMPLES = 800, 4000
_COARSE_SAMPLES = 300
_COARSE_STEPS, _FINE_STEPS = 10, 100
_FINALISTS = 3
_PLANAR_STARTS = 8
_SETTLED_m = 1e-7


def align_contours(estimated_m: Array, truth_m: Array) -> Pose2:
    """``truth_T_estimated`` that lays one closed polygon of shape (n, 2) best onto another.

    Least squares over nearest points in both directions (iterated closest points), from the given pose and
    from eight turns about the middles; repeatable.
    """
    samples = [_sampled_polygon(outline, _CONTOUR_SAMPLES) for outline in (estimated_m, truth_m)]
    rigid = _best(*samples, turns=list(_planar_turns(2)), upright=False)
    return Pose2(Rot2(float(np.arctan2(rigid.rotation[1, 0], rigid.rotation[0, 0]))), rigid.translation)


def align_meshes(estimated: TriangleMesh, truth: TriangleMesh, *, upright: bool) -> Pose3:
    """``truth_T_estimated`` that lays one mesh best onto another, as :func:`align_contours`.

    Args:
        estimated: the mesh to move.
        truth: the mesh that stays.
        upright: True turns about the vertical axis only, as on a table; False turns freely, starting from
            the 24 ways in which the principal axes can be laid onto each other.
    """
    source, target = (sample_mesh(mesh, _MESH_SAMPLES) for mesh in (estimated, truth))
    turns = list(_planar_turns(3)) if upright else list(_spatial_turns(source, target))
    rigid = _best(source, target, turns=turns, upright=upright)
    return Pose3(Rot3(rigid.rotation), rigid.translation)


@dataclass(frozen=True)
class _Rigid:
    """``rotation @ source + translation``."""

    rotation: Array
    translation: Array

    def forward(self, points_m: Array) -> Array:
        return np.asarray(points_m @ self.rotation.T + self.translation)

    def backward(self, points_m: Array) -> Array:
        return np.asarray((points_m - self.translation) @ self.rotation)


def _best(source: Array, target: Array, *, turns: list[Array], upright: bool) -> _Rigid:
    """Short runs from all starts on few points, long runs of the most promising; the first of equals wins."""
    dimension = source.shape[1]
    middles = source.mean(axis=0), target.mean(axis=0)
    starts = [_Rigid(np.eye(dimension), np.zeros(dimension))]
    starts += [_Rigid(turn, middles[1] - turn @ middles[0]) for turn in turns]
    coarse = _ClosestPoints(_thinned(source), _thinned(target), upright)
    candidates = sorted((coarse.run(start, _COARSE_STEPS) for start in starts), key=lambda found: found[0])
    fine = _ClosestPoints(source, target, upright)
    return min((fine.run(start, _FINE_STEPS) for _, start in candidates[:_FINALISTS]), key=lambda found: found[0])[1]


class _ClosestPoints:
    """Iterated closest points between two sets, in both directions."""

    def __init__(self, source: Array, target: Array, upright: bool) -> None:
        self._source, self._target, self._upright = source, target, upright
        self._source_tree, self._target_tree = cKDTree(source), cKDTree(target)

    def run(self, pose: _Rigid, steps: int) -> tuple[float, _Rigid]:
        """Mean squared distance (rounded, so that equal fits compare equal) and pose after so many steps."""
        for _ in range(steps):
            sources, targets = self._pairs(pose)
            moved = _fit_rigid(sources, targets, upright=self._upright)
            change_m = np.abs(moved.forward(sources) - pose.forward(sources)).max()
            pose = moved
            if change_m < _SETTLED_m:
                break
        sources, targets = self._pairs(pose)
        return round(float(np.mean((pose.forward(sources) - targets) ** 2)), 12), pose

    def _pairs(self, pose: _Rigid) -> tuple[Array, Array]:
        _, nearest_target = self._target_tree.query(pose.forward(self._source))
        _, nearest_source = self._source_tree.query(pose.backward(self._target))
        sources = np.vstack([self._source, self._source[nearest_source]])
        return sources, np.vstack([self._target[nearest_target], self._target])


def _fit_rigid(source: Array, target: Array, *, upright: bool) -> _Rigid:
    """Least squares rigid motion between paired points (Kabsch); upright keeps the vertical axis."""
    middle_source, middle_target = source.mean(axis=0), target.mean(axis=0)
    turning = 2 if upright else source.shape[1]
    spread = (source - middle_source)[:, :turning].T @ (target - middle_target)[:, :turning]
    left, _, right = np.linalg.svd(spread)
    signs = np.ones(turning)
    signs[-1] = np.sign(np.linalg.det(left) * np.linalg.det(right))
    rotation = np.eye(source.shape[1])
    rotation[:turning, :turning] = (right.T * signs) @ left.T
    return _Rigid(rotation, middle_target - rotation @ middle_source)


def _planar_turns(dimension: int) -> Iterator[Array]:
    for angle in np.arange(_PLANAR_STARTS) * (2 * np.pi / _PLANAR_STARTS):
        turn = np.eye(dimension)
        turn[:2, :2] = [[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]]
        yield turn


def _spatial_turns(source: Array, target: Array) -> Iterator[Array]:
    """Rotations that lay the principal axes of one set onto those of the other, in all 24 ways."""
    axes_source, axes_target = (
        np.linalg.svd(points - points.mean(axis=0), full_matrices=False)[2] for points in (source, target)
    )
    for order, signs in product(permutations(range(3)), product((1.0, -1.0), repeat=3)):
        turn = axes_target.T @ (np.array(signs)[:, None] * np.eye(3)[list(order)]) @ axes_source
        if np.linalg.det(turn) > 0:
            yield turn


def _sampled_polygon(outline_m: Array, count: int) -> Array:
    length_m = np.linalg.norm(np.roll(outline_m, -1, axis=0) - outline_m, axis=1).sum()
    return sample_polygon(outline_m, float(length_m) / count)


def _thinned(points: Array) -> Array:
    return points[:: max(1, len(points) // _COARSE_SAMPLES)]
