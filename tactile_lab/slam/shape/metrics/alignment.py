"""Best rigid alignment of an estimated shape to the true one, for errors without the pose."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import permutations, product

import numpy as np
from gtsam import Pose2, Pose3, Rot2, Rot3
from scipy.linalg import expm
from scipy.spatial import cKDTree

from drivers.core.contacts import Array
from tactile_lab.slam.shape.surfaces.sampling import TriangleMesh, sample_mesh_with_normals, sample_polygon

_CONTOUR_SAMPLES, _MESH_SAMPLES = 800, 4000
_COARSE_SAMPLES = 300
_COARSE_STEPS, _FINE_STEPS = 12, 30
_FINALISTS = 3
_PLANAR_STARTS = 8
_SETTLED_m = 1e-7
_WEAKEST_DIRECTION = 1e-4
"""Motions that the data determine less than this, relative to the best determined one, are ignored (a sphere's
rotations).
"""


def align_contours(estimated_m: Array, truth_m: Array) -> Pose2:
    """``truth_T_estimated`` that fits one closed polygon of shape (n, 2) best to another.

    Least squares over nearest points in both directions (iterated closest points, finally along the normals), from the
    given pose and from eight rotations about the centres; deterministic.
    """
    source, target = (_polygon_surface(outline) for outline in (estimated_m, truth_m))
    rigid = _best(source, target, turns=list(_planar_turns(2)), upright=False)
    return Pose2(Rot2(float(np.arctan2(rigid.rotation[1, 0], rigid.rotation[0, 0]))), rigid.translation)


def align_meshes(estimated: TriangleMesh, truth: TriangleMesh, *, upright: bool) -> Pose3:
    """``truth_T_estimated`` that fits one mesh best to another, as :func:`align_contours` does.

    Args:
        estimated: the mesh to move.
        truth: the mesh that stays.
        upright: True rotates only about the vertical axis, as on a table; False rotates freely, starting from the 24
            assignments of the principal axes.
    """
    source, target = (_mesh_surface(mesh) for mesh in (estimated, truth))
    turns = list(_planar_turns(3)) if upright else list(_spatial_turns(source.points, target.points))
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


@dataclass(frozen=True)
class _Surface:
    """Evenly sampled points, shape (n, d), and the surface's normals there."""

    points: Array
    normals: Array


def _best(source: _Surface, target: _Surface, *, turns: list[Array], upright: bool) -> _Rigid:
    """Short runs from all initial poses with few points, then long runs of the best; the first of equal results
    wins.
    """
    dimension = source.points.shape[1]
    middles = source.points.mean(axis=0), target.points.mean(axis=0)
    starts = [_Rigid(np.eye(dimension), np.zeros(dimension))]
    starts += [_Rigid(turn, middles[1] - turn @ middles[0]) for turn in turns]
    coarse = _ClosestPoints(_thin(source), _thin(target), upright)
    rough = sorted((coarse.run(start, _COARSE_STEPS) for start in starts), key=coarse.misfit)
    fine = _ClosestPoints(source, target, upright)
    return min((fine.run_along_normals(start, _FINE_STEPS) for start in rough[:_FINALISTS]), key=fine.misfit)


class _ClosestPoints:
    """Iterated closest points between two surfaces, in both directions."""

    def __init__(self, source: _Surface, target: _Surface, upright: bool) -> None:
        self._source, self._target, self._upright = source, target, upright
        self._source_tree, self._target_tree = cKDTree(source.points), cKDTree(target.points)

    def run(self, pose: _Rigid, steps: int) -> _Rigid:
        """Least squares of the pairs' distances: converges slowly, but from far away."""
        for _ in range(steps):
            sources, targets, _ = self._pairs(pose)
            pose = _fit_rigid(sources, targets, upright=self._upright)
        return pose

    def run_along_normals(self, pose: _Rigid, steps: int) -> _Rigid:
        """Least squares of the pairs' distances along the normals, by Gauss-Newton: fast near the solution."""
        start = pose
        for _ in range(steps):
            sources, targets, normals = self._pairs(pose)
            change = _fit_along_normals(pose.forward(sources), targets, normals, upright=self._upright)
            pose = _Rigid(change.rotation @ pose.rotation, change.forward(pose.translation[None])[0])
            if np.abs(change.forward(targets) - targets).max() < _SETTLED_m:
                break
        return min(pose, start, key=self.misfit)

    def misfit(self, pose: _Rigid) -> float:
        """Mean squared distance of the pairs, rounded so that equal fits compare equal."""
        sources, targets, _ = self._pairs(pose)
        return round(float(np.mean((pose.forward(sources) - targets) ** 2)), 12)

    def _pairs(self, pose: _Rigid) -> tuple[Array, Array, Array]:
        """Source points, target points and normals in the target's frame."""
        source, target = self._source, self._target
        _, nearest_target = self._target_tree.query(pose.forward(source.points))
        _, nearest_source = self._source_tree.query(pose.backward(target.points))
        sources = np.vstack([source.points, source.points[nearest_source]])
        targets = np.vstack([target.points[nearest_target], target.points])
        normals = np.vstack([target.normals[nearest_target], source.normals[nearest_source] @ pose.rotation.T])
        return sources, targets, normals


def _fit_along_normals(moved: Array, targets: Array, normals: Array, *, upright: bool) -> _Rigid:
    """The small motion of ``moved`` that minimizes its distances to the targets' tangents."""
    middle = moved.mean(axis=0)
    generators = _generators(moved.shape[1], upright)
    turning = [np.sum(normals * ((moved - middle) @ generator.T), axis=1) for generator in generators]
    columns = np.column_stack([*turning, normals])
    offsets = np.sum(normals * (targets - moved), axis=1)
    motion = np.linalg.lstsq(columns, offsets, rcond=_WEAKEST_DIRECTION)[0]
    skew = np.einsum("k,kij->ij", motion[: len(generators)], generators)
    rotation = expm(skew)
    return _Rigid(rotation, middle + motion[len(generators) :] - rotation @ middle)


def _generators(dimension: int, upright: bool) -> Array:
    """Skew matrices of the allowed rotations, shape (k, d, d); that about the vertical first."""
    planes = [(1, 0)] if upright or dimension == 2 else [(1, 0), (2, 1), (0, 2)]
    generators = np.zeros((len(planes), dimension, dimension))
    for generator, (i, j) in zip(generators, planes, strict=True):
        generator[i, j], generator[j, i] = 1.0, -1.0
    return generators


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
    """The 24 rotations that align the principal axes of one set with those of the other."""
    axes_source, axes_target = (
        np.linalg.svd(points - points.mean(axis=0), full_matrices=False)[2] for points in (source, target)
    )
    for order, signs in product(permutations(range(3)), product((1.0, -1.0), repeat=3)):
        turn = axes_target.T @ (np.array(signs)[:, None] * np.eye(3)[list(order)]) @ axes_source
        if np.linalg.det(turn) > 0:
            yield turn


def _polygon_surface(outline_m: Array) -> _Surface:
    length_m = float(np.linalg.norm(np.roll(outline_m, -1, axis=0) - outline_m, axis=1).sum())
    points = sample_polygon(outline_m, length_m / _CONTOUR_SAMPLES)
    along = np.roll(points, -1, axis=0) - np.roll(points, 1, axis=0)
    across = np.column_stack([along[:, 1], -along[:, 0]])
    return _Surface(points, across / np.maximum(np.linalg.norm(across, axis=1, keepdims=True), 1e-12))


def _mesh_surface(mesh: TriangleMesh) -> _Surface:
    return _Surface(*sample_mesh_with_normals(mesh, _MESH_SAMPLES))


def _thin(surface: _Surface) -> _Surface:
    step = max(1, len(surface.points) // _COARSE_SAMPLES)
    return _Surface(surface.points[::step], surface.normals[::step])
