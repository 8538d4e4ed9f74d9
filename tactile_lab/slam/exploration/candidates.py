"""Candidate grasps and where their fingers are expected to touch (thesis section 4.5.2)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from gtsam import Pose2

from drivers.core.contacts import Array
from tactile_lab.slam.shape.fields.field_grid import Field
from tactile_lab.slam.tracking.contacts.contact_set import planar_rotation

_STEP_m = 0.001


@dataclass(frozen=True)
class ClosingRays:
    """Straight approximations of the paths of the fingertips' centres in the grasp frame.

    Attributes:
        fingers: name of each ray's finger.
        starts_m: shape (n, 3), grasp frame: x along the fingers, z up, z = 0 the table.
        directions: unit vectors, shape (n, 3).
        lengths_m: how far each finger closes, shape (n,).
        radius_m: of the fingertips, taken as balls; 0 for points. A ball that meets a face at an angle touches it
            beside its path.
    """

    fingers: tuple[str, ...]
    starts_m: Array
    directions: Array
    lengths_m: Array
    radius_m: float = 0.0


@dataclass(frozen=True)
class Candidate:
    """A possible next grasp.

    Attributes:
        world_T_grasp: grasp frame on the table.
        closing: name of the closing ("pinch", "radial").
        rays: its closing rays in the grasp frame.
        time_s: time to move there from the hand's present position, to close, and to open again.
        pushes: a part of the hand without sensors is expected to meet the object, and may push it.
    """

    world_T_grasp: Pose2
    closing: str
    rays: ClosingRays
    time_s: float = 1.0
    pushes: bool = False


@dataclass(frozen=True)
class PredictedContacts:
    """Where the fingertips of a candidate first meet the modelled surface.

    Attributes:
        fingers: those expected to touch.
        points_object_m: shape (m, d), object frame.
        variances_m2: variance of the field there, shape (m,).
    """

    fingers: tuple[str, ...]
    points_object_m: Array
    variances_m2: Array


@dataclass(frozen=True)
class ModelledObject:
    """The object as it is known now.

    Attributes:
        field: surface field in the object frame.
        dimension: 2 (contour) or 3.
        world_T_object: planar pose.
        origin_height_m: height of the object frame's origin over the table.
    """

    field: Field
    dimension: int
    world_T_object: Pose2
    origin_height_m: float


def ring_of_candidates(
    centre_world_m: Array, yaws_rad: Array, shifts_m: Array, closings: dict[str, ClosingRays]
) -> tuple[Candidate, ...]:
    """Grasps around a point on the table: every yaw, shift across the fingers and closing.

    Args:
        centre_world_m: shape (2,), usually the middle of the modelled object.
        yaws_rad: directions of the fingers in the world.
        shifts_m: offsets of the grasp frame along its own y axis.
        closings: rays of each closing by name.
    """
    found = []
    for yaw in yaws_rad:
        across = planar_rotation(float(yaw)) @ np.array([0.0, 1.0])
        for shift in shifts_m:
            x, y = centre_world_m + shift * across
            frame = Pose2(float(x), float(y), float(yaw))
            found += [Candidate(frame, name, rays) for name, rays in closings.items()]
    return tuple(found)


def predict_contacts(candidate: Candidate, known: ModelledObject) -> PredictedContacts:
    """Where the field first falls to the fingertips' radius along each closing ray; other rays are left out.

    Close to the surface the field is the distance from it.
    """
    starts, directions = _in_object_frame(candidate, known)
    rays = candidate.rays
    steps = np.arange(0.0, float(rays.lengths_m.max()) + _STEP_m, _STEP_m)
    samples = starts[:, None] + steps[:, None] * directions[:, None]
    asked = steps <= rays.lengths_m[:, None]
    values = np.full(asked.shape, np.inf)
    values[asked] = known.field.predict(samples[asked]).mean_m - rays.radius_m
    crossing = (values[:, :-1] > 0) & (values[:, 1:] <= 0)
    touching = np.flatnonzero(crossing.any(axis=1))
    before = crossing[touching].argmax(axis=1)
    outside, inside = values[touching, before], values[touching, before + 1]
    distances = steps[before] + _STEP_m * outside / (outside - inside)
    centres = starts[touching] + distances[:, None] * directions[touching]
    points = centres - rays.radius_m * outward(known.field, centres)
    variances = known.field.predict(points, variance=True).variance_m2 if len(points) else np.empty(0)
    assert variances is not None
    return PredictedContacts(tuple(rays.fingers[index] for index in touching), points, variances)


def outward(field: Field, points_m: Array) -> Array:
    """Unit vectors along the field's gradient at points of shape (n, d); the same shape."""
    if len(points_m) == 0:
        return points_m
    slopes = field.predict(points_m, gradient=True).gradient
    assert slopes is not None
    return np.asarray(slopes / np.maximum(np.linalg.norm(slopes, axis=1, keepdims=True), 1e-9))


def _in_object_frame(candidate: Candidate, known: ModelledObject) -> tuple[Array, Array]:
    """Starts and unit directions of the rays, shape (n, d), projected for a contour."""
    object_T_grasp = known.world_T_object.between(candidate.world_T_grasp).matrix()
    starts, directions = candidate.rays.starts_m.copy(), candidate.rays.directions.copy()
    starts[:, :2] = starts[:, :2] @ object_T_grasp[:2, :2].T + object_T_grasp[:2, 2]
    directions[:, :2] = directions[:, :2] @ object_T_grasp[:2, :2].T
    starts[:, 2] -= known.origin_height_m
    directions = directions[:, : known.dimension]
    lengths = np.maximum(np.linalg.norm(directions, axis=1, keepdims=True), 1e-9)
    return starts[:, : known.dimension], directions / lengths
