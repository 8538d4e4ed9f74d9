"""Simulated grasps of known objects moving on a table: contacts with noise, motion with slip, and the truth.

Five fingers close along straight lines from around the palm; each touches the object's outline where its line
first meets it. The hand re-centres from its own last contacts, never from an estimate, so every method sees
the same data for one shape, noise and seed. Default noise: contacts 1 mm and 5 degrees (thesis section 3.4),
motion 10 mm per axis and 20 degrees a re-orientation at scale 1 (the thesis's 100 %).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from gtsam import Pose2, Pose3

from tactile_lab.geometry.contacts import FINGERS, Array, Contact, Grasp
from tactile_lab.geometry.poses import spatial

POINT_SIGMA_m = 0.001
NORMAL_SIGMA_rad = float(np.deg2rad(5.0))
MOTION_SIGMAS = np.array([0.010, 0.010, np.deg2rad(20.0)])

_FAN_rad = np.deg2rad([-75.0, -25.0, 25.0, 75.0, 180.0])
_AIM_m = np.array([[-0.006, -0.006], [0.0, -0.004], [0.0, 0.004], [-0.006, 0.006], [0.0, 0.0]])
_REACH_m = 0.120


def _ellipse(a_m: float, b_m: float, count: int = 240) -> Array:
    angles = np.linspace(0, 2 * np.pi, count, endpoint=False)
    return np.column_stack([a_m * np.cos(angles), b_m * np.sin(angles)])


OUTLINES_m: dict[str, Array] = {
    "rectangle": np.array([[-50, -30], [50, -30], [50, 30], [-50, 30]]) / 1000,
    "triangle": np.array([[-50, -26.7], [50, -26.7], [0, 53.3]]) / 1000,
    "ellipse": _ellipse(0.050, 0.030),
    "L": np.array([[-40, -32], [60, -32], [60, 8], [0, 8], [0, 48], [-40, 48]]) / 1000,
    "hexagon": np.array([[-50, -20], [-10, -38], [45, -25], [50, 10], [10, 38], [-38, 28]]) / 1000,
}
"""Outlines in object coordinates, counter-clockwise."""

SECTIONS: dict[str, Callable[[float], Array | None]] = {
    "box": lambda height_m: np.array([[-60, -30], [60, -30], [60, 30], [-60, 30]]) / 1000,
    "sphere": lambda height_m: _circle_of_sphere(0.035, height_m),
}
"""Horizontal sections of 3-D objects at a height over the table."""

SPHERE_RADIUS_m = 0.035


def _circle_of_sphere(radius_m: float, height_m: float) -> Array:
    return _ellipse(*(2 * [np.sqrt(radius_m**2 - (height_m - radius_m) ** 2)]))


@dataclass(frozen=True)
class SimulatedGrasps:
    """A session's grasps and the truth.

    Attributes:
        grasps: what the program may see.
        world_T_body: true pose of the object at each grasp.
        outline_m: true outline in body coordinates (of the lowest section in 3-D), shape (n, 2).
    """

    grasps: tuple[Grasp, ...]
    world_T_body: tuple[Pose3, ...]
    outline_m: Array


def simulate(
    shape: str,
    seed: int,
    *,
    motion_scale: float = 1.0,
    count: int = 16,
    heights_m: tuple[float, ...] = (0.0,),
    outlier_share: float = 0.0,
) -> SimulatedGrasps:
    """Grasps of an outline (2-D) or of a solid in turn at the given heights (3-D)."""
    rng = np.random.default_rng([seed, 20261, round(1000 * motion_scale)])
    section = SECTIONS.get(shape, lambda height_m: OUTLINES_m[shape])
    world_T_body = Pose2(*rng.normal(0.0, 0.05, 2), rng.uniform(-np.pi, np.pi))
    palm = world_T_body.compose(Pose2(*rng.normal(0.0, 0.006, 2), -world_T_body.theta() + rng.normal(0, 0.09)))
    grasps: list[Grasp] = []
    truth: list[Pose3] = []
    hand_motion, body_T_frame = Pose2(), Pose2()
    for index in range(count):
        if index:
            hand_motion, world_T_body, palm = _reorient(grasps[-1], world_T_body, body_T_frame, motion_scale, rng)
        height = heights_m[index % len(heights_m)]
        outline = section(height)
        contacts = _close(outline, height, world_T_body, palm, shape, rng, outlier_share)
        grasps.append(Grasp(index, index * 10**9, contacts, _palm_pose(palm), spatial(hand_motion)))
        truth.append(spatial(world_T_body))
        if index == 0 and contacts:
            body_T_frame = world_T_body.between(Pose2(*grasps[0].points_world_m[:, :2].mean(axis=0), 0))
    return SimulatedGrasps(tuple(grasps), tuple(truth), section(heights_m[0]))


def _reorient(
    last: Grasp, world_T_body: Pose2, body_T_frame: Pose2, scale: float, rng: np.random.Generator
) -> tuple[Pose2, Pose2, Pose2]:
    """The hand turns by 5 to 25 degrees about the grasp's middle and shifts by some millimetres; the object slips.

    The slip turns the object about the middle of the first contacts, the origin of the frame that is tracked.
    """
    points = last.points_world_m[:, :2]
    palm_m = np.array([last.world_T_palm.x(), last.world_T_palm.y()])
    middle = (points.min(axis=0) + points.max(axis=0)) / 2 if len(points) else palm_m
    shift = rng.normal(0.0, 0.005, 2)
    turn = Pose2(0, 0, float(np.deg2rad(rng.uniform(5.0, 25.0))))
    hand_motion = Pose2(*(middle + shift), 0).compose(turn).compose(Pose2(*-middle, 0))
    slip = Pose2(*(scale * MOTION_SIGMAS * rng.normal(size=3)))
    moved = hand_motion.compose(world_T_body).compose(body_T_frame).compose(slip).compose(body_T_frame.inverse())
    palm = Pose2(*(middle + shift + rng.normal(0.0, 0.008, 2)), rng.normal(0.0, np.deg2rad(5.0)))
    return hand_motion, moved, palm


def _palm_pose(palm: Pose2) -> Pose3:
    return spatial(palm, 0.15)


def _close(
    outline_m: Array,
    height_m: float,
    world_T_body: Pose2,
    palm: Pose2,
    shape: str,
    rng: np.random.Generator,
    outlier_share: float,
) -> tuple[Contact, ...]:
    angles = _FAN_rad + rng.normal(0.0, np.deg2rad(10.0), 5)
    starts = _REACH_m * np.column_stack([np.cos(angles), np.sin(angles)])
    ways = _AIM_m + rng.normal(0.0, 0.012, (5, 2)) - starts
    body_T_palm = world_T_body.between(palm).matrix()
    starts = starts @ body_T_palm[:2, :2].T + body_T_palm[:2, 2]
    ways = ways / np.linalg.norm(ways, axis=1, keepdims=True) @ body_T_palm[:2, :2].T
    contacts = []
    for finger, start, way in zip(FINGERS, starts, ways, strict=True):
        hit = first_crossing(outline_m, start, way)
        if hit is None:
            continue
        point, normal = _in_space(*hit, height_m, shape)
        contacts.append(_measured(finger, point, normal, world_T_body, rng, outlier_share))
    return tuple(contacts)


def first_crossing(outline_m: Array, start: Array, way: Array) -> tuple[Array, Array] | None:
    """Where a ray first meets a closed outline, and the outward normal there (outline counter-clockwise)."""
    edges = np.roll(outline_m, -1, axis=0) - outline_m
    gap = outline_m - start
    with np.errstate(divide="ignore", invalid="ignore"):
        across = way[0] * edges[:, 1] - way[1] * edges[:, 0]
        along_ray = (gap[:, 0] * edges[:, 1] - gap[:, 1] * edges[:, 0]) / across
        along_edge = (gap[:, 0] * way[1] - gap[:, 1] * way[0]) / across
    valid = (along_ray > 0) & (along_ray < 2 * _REACH_m) & (along_edge >= 0) & (along_edge <= 1)
    if not valid.any():
        return None
    edge = int(np.where(valid, along_ray, np.inf).argmin())
    normal = np.array([edges[edge, 1], -edges[edge, 0]])
    return start + along_ray[edge] * way, normal / np.linalg.norm(normal)


def _in_space(point: Array, normal: Array, height_m: float, shape: str) -> tuple[Array, Array]:
    if shape == "sphere":
        outward = np.array([*point, height_m - SPHERE_RADIUS_m])
        return np.array([*point, height_m]), outward / np.linalg.norm(outward)
    return np.array([*point, height_m]), np.array([*normal, 0.0])


def _measured(
    finger: str, point: Array, normal: Array, world_T_body: Pose2, rng: np.random.Generator, outlier_share: float
) -> Contact:
    """A contact in the world with the sensors' noise; normals in the plane stay there if they lie in it."""
    pose = spatial(world_T_body).matrix()
    planar = np.array([1.0, 1.0, 0.0 if abs(normal[2]) < 1e-12 and point[2] == 0 else 1.0])
    point = pose[:3, :3] @ point + pose[:3, 3] + planar * rng.normal(0.0, POINT_SIGMA_m, 3)
    normal = pose[:3, :3] @ normal
    if rng.random() < outlier_share:
        point, normal = point + planar * rng.normal(0.0, 0.010, 3), planar * rng.normal(size=3)
    noisy = normal + planar * np.tan(NORMAL_SIGMA_rad) * rng.normal(size=3)
    return Contact(
        finger, point, noisy / np.linalg.norm(noisy), np.eye(3) * POINT_SIGMA_m**2, NORMAL_SIGMA_rad, force_N=0.7
    )
