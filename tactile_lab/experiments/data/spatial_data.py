"""Simulated grasps of solids: standing on a table and turned about the vertical, or moved freely in space.

On the table the five fingers come from the sides, tilted downward by up to 30 degrees, towards one of three heights in
turn (a fifth, a half and four fifths of the object's); in most grasps one of them presses from above instead. Everyday
things are tall and are grasped over their whole height: the middles of grasps are spread evenly over it, with the
fingers within a hand's breadth of the middle. In free motion the palm comes from a new side every time. A finger that
meets nothing tries up to five other paths. The hand re-centres from its own last contacts, never from an estimate, so
every method sees the same data for one solid, motion, noise and seed. Noise as in
:mod:`tactile_lab.experiments.data.sensing`.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal, TypeAlias

import numpy as np
import trimesh
from gtsam import Pose2, Pose3, Rot3

from drivers.core.contacts import FINGERS, ApproachPath, Array, Contact, Grasp
from drivers.core.poses import planar, rotate, spatial, transform_points
from tactile_lab.experiments.data.sensing import (
    SimulatedGrasps,
    SLIP_SIGMA_m,
    SLIP_SIGMA_rad,
    line_to_contact,
    measured_contact,
    planar_pose,
)
from tactile_lab.experiments.data.solids import Solid, solid
from tactile_lab.slam.shape.surfaces.sampling import sample_mesh_with_normals

Motion: TypeAlias = Literal["table", "free"]
Heights: TypeAlias = Literal["three", "all"]

_FAN_rad = np.deg2rad([-75.0, -25.0, 25.0, 75.0, 180.0])
_FAN_SIGMA_rad = float(np.deg2rad(12.0))
_REACH_m = 0.150
_LEVELS = (0.2, 0.5, 0.8)
_LEVEL_SIGMA_m = 0.003
_EDGE_m = 0.004
_HALF_BREADTH_m = 0.033
_GOLDEN = (np.sqrt(5) - 1) / 2
"""The fractional parts of its multiples fill an interval ever more evenly (golden ratio)."""
_TOP_SHARE = 0.7
_TRIES = 6
_TABLE_CLEARANCE_m = 0.002
_FREE_LEVELS_m = np.array([-0.018, -0.008, 0.008, 0.018, 0.0])


@dataclass(frozen=True)
class SpatialGrasps(SimulatedGrasps):
    """A session in space.

    Attributes:
        mesh: true surface in body coordinates.
    """

    mesh: trimesh.Trimesh


@dataclass(frozen=True)
class _Rays:
    """Start points and unit directions of the fingers' paths, each of shape (5, 3)."""

    starts: Array
    ways: Array


def simulate(
    shape: str,
    seed: int,
    *,
    motion: Motion = "table",
    motion_scale: float = 1.0,
    count: int = 24,
    outlier_share: float = 0.0,
    heights: Heights = "three",
) -> SpatialGrasps:
    """Grasps of a solid that slips between them.

    Args:
        shape: name of a solid, see :func:`tactile_lab.experiments.data.solids.solid`.
        seed: for all random numbers, together with the motion and its scale.
        motion: "table": slip of 10 mm along x and y and 20 degrees about the vertical at scale 1; "free": the same
            along and about all three axes.
        motion_scale: slip relative to that.
        count: number of grasps.
        outlier_share: share of outliers among the contacts.
        heights: on the table, "three" levels in turn, or "all" of the solid's height.

    Raises:
        ConfigurationError: there is no such solid, or its mesh is not on this machine.
    """
    rng = np.random.default_rng([seed, 31607, round(1000 * motion_scale), ("table", "free").index(motion)])
    on_table = _OnTable if heights == "three" else MovedAtAllHeights
    moved = (on_table if motion == "table" else _InSpace)(solid(shape), motion_scale, rng)
    return gather(shape, moved, count, outlier_share)


def gather(shape: str, moved: MovedSolid, count: int, outlier_share: float = 0.0) -> SpatialGrasps:
    """The grasps of a session, one after the other; the object's frame is born at the first one's contacts."""
    grasps: list[Grasp] = []
    truth: list[Pose3] = []
    hand_motion = Pose3()
    for index in range(count):
        if index:
            hand_motion = moved.reorient(grasps[-1])
        contacts, lines = moved.close(index, outlier_share)
        grasps.append(Grasp(index, index * 10**9, contacts, moved.world_T_palm, hand_motion, lines))
        truth.append(moved.world_T_body)
        if index == 0 and contacts:
            moved.bear_frame(grasps[0].points_world_m.mean(axis=0))
    return SpatialGrasps(shape, tuple(grasps), tuple(truth), moved.solid.mesh)


def random_contacts(shape: str, count: int, seed: int, *, foot: bool = False) -> SpatialGrasps:
    """Contacts spread at random over a fixed solid that stands on a table.

    They come as grasps of five contacts (the last may have fewer), without approach paths.

    Args:
        shape: name of a solid.
        count: number of contacts.
        seed: for all random numbers.
        foot: whether to touch the underside and the part just above the table too, as if there were no table.

    Raises:
        ConfigurationError: there is no such solid, or its mesh is not on this machine.
    """
    body = solid(shape)
    rng = np.random.default_rng([seed, 40963])
    points, normals = sample_mesh_with_normals(body.mesh, 8 * count, seed=int(rng.integers(1 << 31)))
    reachable = np.flatnonzero(foot | (normals[:, 2] > -0.7) & (points[:, 2] > body.foot_m + _EDGE_m))
    chosen = rng.choice(reachable, count, replace=False)
    pose = Pose3(Rot3(), np.array([0.0, 0.0, -body.foot_m]))
    contacts = [measured_contact(FINGERS[i % 5], points[j], normals[j], pose, rng) for i, j in enumerate(chosen)]
    fives = [tuple(contacts[first : first + 5]) for first in range(0, count, 5)]
    grasps = tuple(Grasp(i, i * 10**9, five, spatial(Pose2(), _REACH_m)) for i, five in enumerate(fives))
    return SpatialGrasps(shape, grasps, (pose,) * len(grasps), body.mesh)


class MovedSolid:
    """One solid, its true pose and that of the palm; subclasses draw the different kinds of motion."""

    floor_m: float = -np.inf
    world_T_palm: Pose3
    world_T_body: Pose3

    def __init__(self, body: Solid, scale: float, rng: np.random.Generator) -> None:
        self.solid, self._scale, self._rng = body, scale, rng
        self._body_T_frame = Pose3()

    def bear_frame(self, origin_world_m: Array) -> None:
        """Define the tracked frame here; slips are expressed in it."""
        self._body_T_frame = self.world_T_body.between(Pose3(Rot3(), origin_world_m))

    def close(self, index: int, outlier_share: float) -> tuple[tuple[Contact, ...], tuple[ApproachPath, ...]]:
        """The contacts of one closing, and the paths of all five fingers."""
        rays = self.rays(index, 1.0)
        hits = self._cast(rays)
        for _ in range(_TRIES - 1):
            if all(hit is not None for hit in hits):
                break
            again = self.rays(index, 0.5)
            for finger in (i for i, hit in enumerate(hits) if hit is None):
                rays.starts[finger], rays.ways[finger] = again.starts[finger], again.ways[finger]
            hits = self._cast(rays)
        return self._measure(rays, hits, outlier_share)

    def rays(self, index: int, spread: float) -> _Rays:
        """The fingers' paths in the world; a smaller spread aims them closer to the palm's middle."""
        raise NotImplementedError

    def reorient(self, last: Grasp) -> Pose3:
        """Carry the object, which slips, and approach it from elsewhere; returns the hand's motion."""
        middle = self.world_T_palm.translation()
        if last.contacts:
            middle = (last.points_world_m.min(axis=0) + last.points_world_m.max(axis=0)) / 2
        shift, turn = self.hand_step()
        hand_motion = Pose3(Rot3(), middle + shift) * Pose3(turn, np.zeros(3)) * Pose3(Rot3(), -middle)
        slipped = self._body_T_frame * self.slip() * self._body_T_frame.inverse()
        self.world_T_body = hand_motion * self.world_T_body * slipped
        self.approach(middle + shift)
        return hand_motion

    def hand_step(self) -> tuple[Array, Rot3]:
        """The hand's motion while it holds the object: a shift, and a rotation about the grasp's middle."""
        raise NotImplementedError

    def slip(self) -> Pose3:
        """The object's additional motion, in the tracked frame."""
        raise NotImplementedError

    def approach(self, middle_world_m: Array) -> None:
        """Bring the palm back over the middle of its last contacts."""
        raise NotImplementedError

    def _cast(self, rays: _Rays) -> list[tuple[Array, Array] | None]:
        body_T_world = self.world_T_body.inverse()
        starts, ways = transform_points(body_T_world, rays.starts), rotate(body_T_world, rays.ways)
        return self.solid.touch(starts, ways, 2 * _REACH_m)

    def _measure(
        self, rays: _Rays, hits: list[tuple[Array, Array] | None], outlier_share: float
    ) -> tuple[tuple[Contact, ...], tuple[ApproachPath, ...]]:
        contacts: list[Contact] = []
        lines: list[ApproachPath] = []
        for finger, start, way, hit in zip(FINGERS, rays.starts, rays.ways, hits, strict=True):
            if hit is None:
                lines.append(ApproachPath(finger, start, self._end_of_way(start, way), touched=False))
                continue
            pose, rng = self.world_T_body, self._rng
            contacts.append(measured_contact(finger, hit[0], hit[1], pose, rng, outlier_share=outlier_share))
            lines.append(line_to_contact(start, contacts[-1]))
        return tuple(contacts), tuple(lines)

    def _end_of_way(self, start: Array, way: Array) -> Array:
        """Where a finger that meets nothing stops: at the end of its reach, or just above the table."""
        length = 2 * _REACH_m
        if way[2] < 0 and start[2] + length * way[2] < self.floor_m:
            length = (start[2] - self.floor_m) / -way[2]
        return np.asarray(start + length * way)


class _OnTable(MovedSolid):
    """Poses (x, y, yaw) on the table."""

    floor_m = _TABLE_CLEARANCE_m

    def __init__(self, body: Solid, scale: float, rng: np.random.Generator) -> None:
        super().__init__(body, scale, rng)
        place = rng.normal(0.0, 0.05, 2)
        self.world_T_body = spatial(planar_pose(place, rng.uniform(-np.pi, np.pi)), -body.foot_m)
        palm = place + rng.normal(0.0, 0.006, 2)
        self.world_T_palm = spatial(planar_pose(palm, rng.normal(0.0, 0.1)), _REACH_m)

    def rays(self, index: int, spread: float) -> _Rays:
        rng, height = self._rng, self.solid.height_m
        angles = _FAN_rad + rng.normal(0.0, _FAN_SIGMA_rad, 5)
        tilts = np.deg2rad(rng.uniform(0.0, 30.0, 5))
        heights = np.clip(self.levels_m(index), _EDGE_m, height - _EDGE_m)
        aims = np.column_stack([rng.normal(0.0, 0.014 * spread, (5, 2)), heights])
        if rng.random() < _TOP_SHARE:
            finger = rng.integers(0, 4)
            tilts[finger] = np.deg2rad(rng.uniform(60.0, 85.0))
            aims[finger] = [*rng.uniform(-0.035 * spread, 0.035 * spread, 2), height]
        ways = -_directions(angles, tilts)
        world_T_foot = spatial(planar(self.world_T_palm))
        return _Rays(transform_points(world_T_foot, aims - _REACH_m * ways), rotate(world_T_foot, ways))

    def levels_m(self, index: int) -> Array:
        """Heights that the fingers of a grasp aim at, shape (5,)."""
        return _LEVELS[index % 3] * self.solid.height_m + self._rng.normal(0.0, _LEVEL_SIGMA_m, 5)

    def hand_step(self) -> tuple[Array, Rot3]:
        shift = np.append(self._rng.normal(0.0, 0.005, 2), 0.0)
        return shift, Rot3.Yaw(float(np.deg2rad(self._rng.uniform(5.0, 25.0))))

    def slip(self) -> Pose3:
        x, y, turn = self._scale * self._rng.normal(size=3) * [SLIP_SIGMA_m, SLIP_SIGMA_m, SLIP_SIGMA_rad]
        return spatial(Pose2(x, y, turn))

    def approach(self, middle_world_m: Array) -> None:
        place = middle_world_m[:2] + self._rng.normal(0.0, 0.008, 2)
        self.world_T_palm = spatial(planar_pose(place, self._rng.normal(0.0, 0.1)), _REACH_m)


class MovedAtAllHeights(_OnTable):
    """The same, with grasps over the whole height."""

    def levels_m(self, index: int) -> Array:
        """The heights span the width of a hand, or the height of a lower solid."""
        height = self.solid.height_m
        breadth = min(_HALF_BREADTH_m, height / 2)
        middle = breadth + ((index + 1) * _GOLDEN % 1.0) * (height - 2 * breadth)
        return np.asarray(middle + self._rng.uniform(-breadth, breadth, 5))


class _InSpace(MovedSolid):
    """Poses with all six degrees of freedom."""

    def __init__(self, body: Solid, scale: float, rng: np.random.Generator) -> None:
        super().__init__(body, scale, rng)
        middle = rng.normal(0.0, 0.05, 3)
        self.world_T_body = Pose3(_any_rotation(rng), middle) * Pose3(Rot3(), -body.mesh.bounds.mean(axis=0))
        self.world_T_palm = Pose3(_any_rotation(rng), middle + rng.normal(0.0, 0.006, 3))

    def rays(self, index: int, spread: float) -> _Rays:
        rng = self._rng
        angles = _FAN_rad + rng.normal(0.0, _FAN_SIGMA_rad, 5)
        heights = spread * (rng.permutation(_FREE_LEVELS_m) + rng.normal(0.0, 0.008, 5))
        ways = -_directions(angles, rng.normal(0.0, np.deg2rad(20.0), 5))
        aims = np.column_stack([rng.normal(0.0, 0.012 * spread, (5, 2)), heights])
        return _Rays(transform_points(self.world_T_palm, aims - _REACH_m * ways), rotate(self.world_T_palm, ways))

    def hand_step(self) -> tuple[Array, Rot3]:
        angle = np.deg2rad(self._rng.uniform(5.0, 25.0))
        return self._rng.normal(0.0, 0.005, 3), Rot3.Expmap(angle * _unit(self._rng.normal(size=3)))

    def slip(self) -> Pose3:
        turn, way = self._scale * self._rng.normal(size=(2, 3))
        return Pose3(Rot3.Expmap(SLIP_SIGMA_rad * turn), SLIP_SIGMA_m * way)

    def approach(self, middle_world_m: Array) -> None:
        turn = Rot3.Expmap(np.deg2rad(self._rng.uniform(20.0, 60.0)) * _unit(self._rng.normal(size=3)))
        place = middle_world_m + self._rng.normal(0.0, 0.008, 3)
        self.world_T_palm = Pose3(turn * self.world_T_palm.rotation(), place)


def _directions(angles_rad: Array, tilts_rad: Array) -> Array:
    """Unit vectors at angles about z and tilts above the horizontal, shape (n, 3)."""
    level = np.cos(tilts_rad)
    return np.column_stack([np.cos(angles_rad) * level, np.sin(angles_rad) * level, np.sin(tilts_rad)])


def _any_rotation(rng: np.random.Generator) -> Rot3:
    """A rotation drawn uniformly from all rotations (by a uniform unit quaternion)."""
    w, x, y, z = _unit(rng.normal(size=4))
    return Rot3.Quaternion(w, x, y, z)


def _unit(vector: Array) -> Array:
    return np.asarray(vector / np.linalg.norm(vector))
