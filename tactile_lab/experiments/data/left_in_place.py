"""Grasps of outlines and things that nothing carries: they stay where they are, but for closings that push them."""

from __future__ import annotations

import numpy as np
from gtsam import Pose2, Pose3, Rot3

from drivers.core.contacts import Array, Grasp
from drivers.core.poses import spatial
from tactile_lab.experiments.data.planar_data import PlanarGrasps, outline
from tactile_lab.experiments.data.planar_hand import PlanarHand, slip
from tactile_lab.experiments.data.sensing import planar_pose
from tactile_lab.experiments.data.solids import Solid, solid
from tactile_lab.experiments.data.spatial_data import MovedAtAllHeights, SpatialGrasps, gather

CREEP = np.array([3e-4, 3e-4, np.deg2rad(0.3)])
PUSH = np.array([0.006, 0.006, np.deg2rad(10.0)])
PUSH_OF_THING = np.array([0.003, 0.003, np.deg2rad(3.0)])
"""Standard deviations of their motion along x and y, metres, and about the vertical: usually, when an outline is
pushed, and when a thing is, which is heavier.
"""
PUSHED_EVERY = 4


def simulate(shape: str, seed: int, *, count: int = 12) -> PlanarGrasps:
    """Grasps from all sides, each around the middle of the contacts before; the hand says that it carried nothing.

    Args:
        shape: one of :data:`~tactile_lab.experiments.data.outlines.OUTLINES_m`.
        seed: for all random numbers.
        count: number of grasps; the closing of every fourth pushes the object.

    Raises:
        ConfigurationError: there is no such shape.
    """
    outline_m = outline(shape)
    rng = np.random.default_rng([seed, 40993])
    hand = PlanarHand(outline_m, rng)
    world_T_body = planar_pose(rng.normal(0.0, 0.05, 2), rng.uniform(-np.pi, np.pi))
    middle_m, body_T_frame = world_T_body.translation(), Pose2()
    grasps: list[Grasp] = []
    truth: list[Pose3] = []
    for index in range(count):
        if index:
            sigmas = PUSH if _is_pushed(index) else CREEP
            world_T_body = slip(world_T_body, body_T_frame, sigmas, rng)
        palm = planar_pose(middle_m + rng.normal(0.0, 0.006, 2), rng.uniform(-np.pi, np.pi))
        grasps.append(hand.grasp(index, palm, world_T_body))
        truth.append(spatial(world_T_body))
        if grasps[-1].contacts:
            middle_m = grasps[-1].points_world_m[:, :2].mean(axis=0)
            body_T_frame = body_T_frame if index else world_T_body.between(planar_pose(middle_m))
    return PlanarGrasps(shape, tuple(grasps), tuple(truth), outline_m)


def simulate_thing(shape: str, seed: int, *, count: int = 12) -> SpatialGrasps:
    """Grasps over the whole height of a thing on the table; the hand says that it carried nothing.

    Args:
        shape: name of a solid, see :func:`tactile_lab.experiments.data.solids.solid`.
        seed: for all random numbers.
        count: number of grasps; the closing of every fourth pushes the thing.

    Raises:
        ConfigurationError: there is no such solid, or its mesh is not on this machine.
    """
    return gather(shape, _ThingLeft(solid(shape), np.random.default_rng([seed, 52711])), count)


class _ThingLeft(MovedAtAllHeights):
    """The hand comes from elsewhere each time and carries nothing."""

    def __init__(self, body: Solid, rng: np.random.Generator) -> None:
        super().__init__(body, 1.0, rng)
        self._moved = 0

    def hand_step(self) -> tuple[Array, Rot3]:
        return np.zeros(3), Rot3()

    def slip(self) -> Pose3:
        self._moved += 1
        sigmas = PUSH_OF_THING if _is_pushed(self._moved) else CREEP
        return spatial(Pose2(*(sigmas * self._rng.normal(size=3))))


def _is_pushed(index: int) -> bool:
    """Whether the closing of a grasp pushes the object."""
    return index % PUSHED_EVERY == PUSHED_EVERY - 1
