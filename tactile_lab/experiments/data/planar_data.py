"""Simulated grasps of known outlines moving on a table: contacts with noise, motion with slip, and the truth.

Five fingers close along straight lines from around the palm; each touches the object's outline where its line
first meets it. The hand re-centres from its own last contacts, never from an estimate, so every method sees
the same data for one shape, noise and seed. Noise as in :mod:`tactile_lab.experiments.data.sensing`.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from gtsam import Pose2, Pose3

from drivers.core.contacts import FINGERS, ApproachPath, Array, Contact, Grasp
from drivers.core.errors import ConfigurationError
from drivers.core.poses import spatial
from tactile_lab.evaluation.shape import horizontal_outline
from tactile_lab.experiments.data.outlines import OUTLINES_m, first_crossing, random_boundary_points
from tactile_lab.experiments.data.sensing import (
    IN_PLANE,
    SimulatedGrasps,
    SLIP_SIGMA_m,
    SLIP_SIGMA_rad,
    line_to_contact,
    measured_contact,
    planar_pose,
)
from tactile_lab.experiments.data.solids import solid
from tactile_lab.slam.tracking.contacts.motion import vector_pose

_FAN_rad = np.deg2rad([-75.0, -25.0, 25.0, 75.0, 180.0])
_AIM_m = np.array([[-0.006, -0.006], [0.0, -0.004], [0.0, 0.004], [-0.006, 0.006], [0.0, 0.0]])
_REACH_m = 0.120
_PALM_HEIGHT_m = 0.15


@dataclass(frozen=True)
class PlanarGrasps(SimulatedGrasps):
    """A session in the plane.

    Attributes:
        outline_m: true outline in body coordinates, shape (n, 2), counter-clockwise.
    """

    outline_m: Array


def outline(shape: str) -> Array:
    """The outline named ``shape``, shape (n, 2), metres.

    Raises:
        ConfigurationError: there is no such shape.
    """
    if shape not in OUTLINES_m:
        hint = f"Available shapes: {', '.join(OUTLINES_m)}"
        raise ConfigurationError(f"there is no planar shape {shape!r}", where="shape", hint=hint)
    return OUTLINES_m[shape]


def simulate(
    shape: str, seed: int, *, motion_scale: float = 1.0, count: int = 16, outlier_share: float = 0.0
) -> PlanarGrasps:
    """Grasps of an outline that slips between them.

    Args:
        shape: one of :data:`~tactile_lab.experiments.data.outlines.OUTLINES_m`.
        seed: for all random numbers, together with the motion scale.
        motion_scale: slip relative to 10 mm per axis and 20 degrees.
        count: number of grasps.
        outlier_share: share of outliers among the contacts.

    Raises:
        ConfigurationError: there is no such shape.
    """
    return simulate_outline(shape, outline(shape), seed, motion_scale, count, outlier_share)


def simulate_section(shape: str, seed: int, *, height_share: float, motion_scale: float, count: int) -> PlanarGrasps:
    """Grasps of a solid's outer outline at a share of its height, the middle of its extent at the origin.

    Raises:
        ConfigurationError: there is no such solid, or its mesh is not on this machine.
    """
    body = solid(shape)
    outline_m = horizontal_outline(body.mesh, body.foot_m + height_share * body.height_m)
    middle_m = (outline_m.min(axis=0) + outline_m.max(axis=0)) / 2
    return simulate_outline(shape, outline_m - middle_m, seed, motion_scale, count)


def simulate_outline(
    shape: str, outline_m: Array, seed: int, motion_scale: float, count: int, outlier_share: float = 0.0
) -> PlanarGrasps:
    """As :func:`simulate`, of a given outline, shape (n, 2), counter-clockwise."""
    rng = np.random.default_rng([seed, 20261, round(1000 * motion_scale)])
    world_T_body = planar_pose(rng.normal(0.0, 0.05, 2), rng.uniform(-np.pi, np.pi))
    palm = world_T_body.compose(planar_pose(rng.normal(0.0, 0.006, 2), -world_T_body.theta() + rng.normal(0, 0.09)))
    grasps: list[Grasp] = []
    truth: list[Pose3] = []
    hand_motion, body_T_frame = Pose2(), Pose2()
    for index in range(count):
        if index:
            hand_motion, world_T_body, palm = _reorient(grasps[-1], world_T_body, body_T_frame, motion_scale, rng)
        contacts, lines = _close(outline_m, world_T_body, palm, rng, outlier_share)
        pose = spatial(palm, _PALM_HEIGHT_m)
        grasps.append(Grasp(index, index * 10**9, contacts, pose, spatial(hand_motion), lines))
        truth.append(spatial(world_T_body))
        if index == 0 and contacts:
            body_T_frame = world_T_body.between(planar_pose(grasps[0].points_world_m.mean(axis=0)))
    return PlanarGrasps(shape, tuple(grasps), tuple(truth), outline_m)


def random_contacts(shape: str, count: int, seed: int) -> PlanarGrasps:
    """Contacts spread at random over an outline that does not move, for studies of the shape alone.

    They come as grasps of five contacts (the last may have fewer), without approach paths.

    Raises:
        ConfigurationError: there is no such shape.
    """
    outline_m = outline(shape)
    rng = np.random.default_rng([seed, 40961])
    points, normals = (np.pad(rows, ((0, 0), (0, 1))) for rows in random_boundary_points(outline_m, count, rng))
    contacts = [
        measured_contact(FINGERS[i % 5], points[i], normals[i], Pose3(), rng, axes=IN_PLANE) for i in range(count)
    ]
    fives = [tuple(contacts[first : first + 5]) for first in range(0, count, 5)]
    grasps = tuple(Grasp(i, i * 10**9, five, spatial(Pose2(), _PALM_HEIGHT_m)) for i, five in enumerate(fives))
    return PlanarGrasps(shape, grasps, (Pose3(),) * len(grasps), outline_m)


def _reorient(
    last: Grasp, world_T_body: Pose2, body_T_frame: Pose2, scale: float, rng: np.random.Generator
) -> tuple[Pose2, Pose2, Pose2]:
    """Turn the hand by 5 to 25 degrees about the grasp's middle and shift it by some millimetres; the object slips.

    The slip turns the object about the middle of the first contacts, the origin of the frame that is tracked.
    """
    points = last.points_world_m[:, :2]
    palm_m = np.array([last.world_T_palm.x(), last.world_T_palm.y()])
    middle = (points.min(axis=0) + points.max(axis=0)) / 2 if len(points) else palm_m
    shift = rng.normal(0.0, 0.005, 2)
    turn = Pose2(0, 0, float(np.deg2rad(rng.uniform(5.0, 25.0))))
    hand_motion = planar_pose(middle + shift).compose(turn).compose(planar_pose(-middle))
    slip = vector_pose(scale * np.array([SLIP_SIGMA_m, SLIP_SIGMA_m, SLIP_SIGMA_rad]) * rng.normal(size=3))
    moved = hand_motion.compose(world_T_body).compose(body_T_frame).compose(slip).compose(body_T_frame.inverse())
    palm = planar_pose(middle + shift + rng.normal(0.0, 0.008, 2), rng.normal(0.0, np.deg2rad(5.0)))
    return hand_motion, moved, palm


def _closing_rays(palm: Pose2, rng: np.random.Generator) -> tuple[Array, Array]:
    """Start points and unit directions of the fingers' paths in the world, each of shape (5, 2)."""
    angles = _FAN_rad + rng.normal(0.0, np.deg2rad(10.0), 5)
    starts = _REACH_m * np.column_stack([np.cos(angles), np.sin(angles)])
    ways = _AIM_m + rng.normal(0.0, 0.012, (5, 2)) - starts
    matrix = palm.matrix()
    turned = ways / np.linalg.norm(ways, axis=1, keepdims=True) @ matrix[:2, :2].T
    return starts @ matrix[:2, :2].T + matrix[:2, 2], turned


def _close(
    outline_m: Array, world_T_body: Pose2, palm: Pose2, rng: np.random.Generator, outlier_share: float
) -> tuple[tuple[Contact, ...], tuple[ApproachPath, ...]]:
    """The contacts of one closing, and the paths of all five fingers; those that meet nothing cross the palm's
    middle.
    """
    starts, ways = _closing_rays(palm, rng)
    matrix = world_T_body.matrix()
    contacts: list[Contact] = []
    lines: list[ApproachPath] = []
    for finger, start, way in zip(FINGERS, starts, ways, strict=True):
        start_world = np.append(start, 0.0)
        hit = first_crossing(outline_m, (start - matrix[:2, 2]) @ matrix[:2, :2], way @ matrix[:2, :2], 2 * _REACH_m)
        if hit is None:
            lines.append(ApproachPath(finger, start_world, np.append(start + 2 * _REACH_m * way, 0.0), touched=False))
            continue
        point, normal = (np.append(value, 0.0) for value in hit)
        pose = spatial(world_T_body)
        contacts.append(measured_contact(finger, point, normal, pose, rng, axes=IN_PLANE, outlier_share=outlier_share))
        lines.append(line_to_contact(start_world, contacts[-1]))
    return tuple(contacts), tuple(lines)
