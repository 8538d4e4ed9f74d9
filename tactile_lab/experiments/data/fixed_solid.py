"""Grasps that are chosen from candidates around a solid that stays where it stands (thesis section 4.5.1).

Each candidate is a palm above the table with a heading and a shift across it. Four fingers close from the sides at one
of three heights, the middle one presses on the top. The hand executes them as imprecisely as in the plane
(:mod:`tactile_lab.experiments.data.planar_hand`), and contacts have the sensors' noise.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from itertools import product

import numpy as np
import trimesh
from gtsam import Pose2, Pose3, Rot3

from drivers.core.contacts import FINGERS, Array, Contact
from drivers.core.poses import rotate, spatial, transform_points
from tactile_lab.experiments.data.planar_hand import PALM_SIGMAS, FAN_SIGMA_rad
from tactile_lab.experiments.data.sensing import measured_contact
from tactile_lab.experiments.data.solids import Solid
from tactile_lab.slam.exploration.candidates import Candidate, ClosingRays

_LEVELS = (0.2, 0.5, 0.8)
_HEADINGS, _SHIFTS_m = 12, (-0.015, 0.0, 0.015)
_FAN_rad = np.deg2rad([-60.0, 0.0, 25.0, 60.0, 180.0])
_PRESSING = FINGERS.index("MF")
_REACH_m = 0.120
_AIM_SIGMA_m = 0.002
_FOREFRONT_m = 0.015
"""The pressing finger comes down this far in front of the palm's middle."""


@dataclass
class FixedSolid:
    """A solid on the table, and all contacts with it; object frame and world are the same.

    Attributes:
        solid: it.
        rng: random numbers of execution and measurement.
        contacts: of each grasp.
    """

    solid: Solid
    rng: np.random.Generator
    contacts: list[tuple[Contact, ...]] = field(default_factory=list)

    @property
    def world_T_body(self) -> Pose3:
        """Where it stands."""
        return Pose3(Rot3(), np.array([0.0, 0.0, -self.solid.foot_m]))

    @property
    def true_mesh(self) -> trimesh.Trimesh:
        """Its surface where it stands."""
        placed = self.solid.mesh.copy()
        placed.apply_transform(self.world_T_body.matrix())
        return placed

    def candidates(self) -> tuple[Candidate, ...]:
        """Palms around it: every heading, shift and height."""
        height_m = self.solid.height_m
        headings = 2 * np.pi * np.arange(_HEADINGS) / _HEADINGS
        return tuple(
            Candidate(_palm(float(heading), shift_m), f"at {share:.0%}", _rays(share * height_m, height_m))
            for heading, shift_m, share in product(headings, _SHIFTS_m, _LEVELS)
        )

    def grasp(self, candidate: Candidate) -> None:
        """Execute a candidate."""
        reached = candidate.world_T_grasp.compose(Pose2(*(PALM_SIGMAS * self.rng.normal(size=3))))
        starts, ways = self._strayed(candidate.rays)
        world_T_palm, body_T_world = spatial(reached), self.world_T_body.inverse()
        starts = transform_points(body_T_world * world_T_palm, starts)
        ways = rotate(body_T_world * world_T_palm, ways)
        hits = self.solid.touch(starts, ways, 2 * _REACH_m)
        self.contacts.append(
            tuple(
                measured_contact(finger, *hit, self.world_T_body, self.rng)
                for finger, hit in zip(FINGERS, hits, strict=True)
                if hit is not None
            )
        )

    def _strayed(self, rays: ClosingRays) -> tuple[Array, Array]:
        """The true paths of the fingers beside the planned ones, in the grasp frame."""
        turns = [Rot3.Yaw(float(angle)) for angle in self.rng.normal(0.0, FAN_SIGMA_rad, len(rays.fingers))]
        beside_m = self.rng.normal(0.0, _AIM_SIGMA_m, rays.starts_m.shape)
        ways = np.array([turn.rotate(way) for turn, way in zip(turns, rays.directions, strict=True)])
        return rays.starts_m + beside_m, ways

    @property
    def points_m(self) -> Array:
        """Of all contacts, shape (n, 3)."""
        return np.array([contact.point_world_m for grasp in self.contacts for contact in grasp]).reshape(-1, 3)

    @property
    def normals(self) -> Array:
        """Outward normals of all contacts, shape (n, 3)."""
        return np.array([contact.normal_world for grasp in self.contacts for contact in grasp]).reshape(-1, 3)

    @property
    def grasp_indices(self) -> np.ndarray[tuple[int], np.dtype[np.int64]]:
        """Which grasp each contact belongs to, shape (n,)."""
        return np.repeat(np.arange(len(self.contacts)), [len(grasp) for grasp in self.contacts]).astype(np.int64)


def _palm(heading_rad: float, shift_m: float) -> Pose2:
    x_m, y_m = -shift_m * np.sin(heading_rad), shift_m * np.cos(heading_rad)
    return Pose2(float(x_m), float(y_m), heading_rad)


def _rays(level_m: float, height_m: float) -> ClosingRays:
    """Fingers close level towards the middle; one comes down from above."""
    ways = -np.column_stack([np.cos(_FAN_rad), np.sin(_FAN_rad), np.zeros(5)])
    starts = -_REACH_m * ways + [0.0, 0.0, level_m]
    starts[_PRESSING], ways[_PRESSING] = [_FOREFRONT_m, 0.0, height_m + _REACH_m / 2], [0.0, 0.0, -1.0]
    return ClosingRays(FINGERS, starts, ways, np.full(5, 2 * _REACH_m))
