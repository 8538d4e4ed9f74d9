"""Common to all simulated data sets: the sensors' noise, the object's slip, and the form of a session.

Default noise: contacts 1 mm and 5 degrees; motion 10 mm per axis and 20 degrees per re-orientation at scale 1
(thesis section 3.4; its "100 %").
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TypeVar

import numpy as np
from gtsam import Pose2, Pose3

from drivers.core.contacts import ApproachPath, Array, Contact, Grasp
from drivers.core.poses import rotate, transform_points

POINT_SIGMA_m = 0.001
NORMAL_SIGMA_rad = float(np.deg2rad(5.0))
SLIP_SIGMA_m = 0.010
SLIP_SIGMA_rad = float(np.deg2rad(20.0))
OUTLIER_SIGMA_m = 0.010
_FINGER_SIGMA_m, _OF_FINGERS = 0.0008, 71
"""Of a finger's own error, if it has one: joint sensors with a bias of 0.6 degrees each. And what keeps these errors
apart from the random numbers of the contacts.
"""
FORCE_N = 0.7

IN_PLANE = np.array([1.0, 1.0, 0.0])
IN_SPACE = np.ones(3)


@dataclass(frozen=True)
class SimulatedGrasps:
    """A session's grasps and the truth.

    Attributes:
        shape: name of the object.
        grasps: the data that the program may use.
        world_T_body: true pose of the object at each grasp.
    """

    shape: str
    grasps: tuple[Grasp, ...]
    world_T_body: tuple[Pose3, ...]


_Data = TypeVar("_Data", bound=SimulatedGrasps)


def without_paths(data: _Data) -> _Data:
    """The same session, the fingers' approach paths unknown."""
    return replace(data, grasps=tuple(replace(grasp, approach_paths=()) for grasp in data.grasps))


def by_biased_fingers(data: _Data, seed: int) -> _Data:
    """The same session by a hand whose joint sensors are biased as the simulated rig's are."""
    return with_finger_errors(data, _FINGER_SIGMA_m, np.random.default_rng([seed, _OF_FINGERS]))


def with_finger_errors(data: _Data, sigma_m: float, rng: np.random.Generator) -> _Data:
    """The same session by a hand whose fingers feel surfaces too far out or in, each by one error throughout, as biased
    joint sensors do. The contacts state it.

    Args:
        data: a session.
        sigma_m: standard deviation of each finger's error.
        rng: source of the errors.
    """
    names = sorted({contact.finger for grasp in data.grasps for contact in grasp.contacts})
    errors_m = dict(zip(names, rng.normal(0.0, sigma_m, len(names)), strict=True))
    return replace(data, grasps=tuple(_felt_by(grasp, errors_m, sigma_m) for grasp in data.grasps))


def _felt_by(grasp: Grasp, errors_m: dict[str, float], sigma_m: float) -> Grasp:
    contacts, moved = [], {}
    for contact in grasp.contacts:
        normal = contact.normal_world
        step, moves = errors_m[contact.finger] * normal, sigma_m * normal[:, None]
        moved[contact.finger] = step
        placed = replace(contact, point_world_m=contact.point_world_m + step, shared_moves_m=moves)
        contacts.append(replace(placed, point_covariance_m2=contact.point_covariance_m2 + moves @ moves.T))
    lines = [
        replace(line, start_world_m=line.start_world_m + step, end_world_m=line.end_world_m + step)
        for line in grasp.approach_paths
        for step in [moved.get(line.finger, np.zeros(3))]
    ]
    return replace(grasp, contacts=tuple(contacts), approach_paths=tuple(lines))


def measured_contact(
    finger: str,
    point_body_m: Array,
    normal_body: Array,
    world_T_body: Pose3,
    rng: np.random.Generator,
    *,
    axes: Array = IN_SPACE,
    outlier_share: float = 0.0,
) -> Contact:
    """A contact in the world with the sensors' noise.

    Args:
        finger: name of the finger.
        point_body_m, normal_body: the true contact, each of shape (3,).
        world_T_body: true pose of the object.
        rng: source of the noise; every call draws at least seven numbers.
        axes: which axes of the world are noisy, 1 or 0, shape (3,).
        outlier_share: probability of an outlier: an error of 10 mm per axis, and a random normal.
    """
    point = transform_points(world_T_body, point_body_m[None])[0] + axes * rng.normal(0.0, POINT_SIGMA_m, 3)
    normal = rotate(world_T_body, normal_body[None])[0]
    if rng.random() < outlier_share:
        point, normal = point + axes * rng.normal(0.0, OUTLIER_SIGMA_m, 3), axes * rng.normal(size=3)
        normal /= np.linalg.norm(normal)
    noisy = normal + axes * np.tan(NORMAL_SIGMA_rad) * rng.normal(size=3)
    covariance = np.eye(3) * POINT_SIGMA_m**2
    return Contact(finger, point, noisy / np.linalg.norm(noisy), covariance, NORMAL_SIGMA_rad, FORCE_N)


def line_to_contact(start_world_m: Array, contact: Contact) -> ApproachPath:
    """The path of a finger that touched, up to its measured contact, as known on a rig."""
    return ApproachPath(contact.finger, start_world_m, contact.point_world_m, touched=True)


def planar_pose(place_m: Array, heading_rad: float = 0.0) -> Pose2:
    """A pose in the plane from a position, of which x and y are used, and a heading."""
    return Pose2(float(place_m[0]), float(place_m[1]), heading_rad)
