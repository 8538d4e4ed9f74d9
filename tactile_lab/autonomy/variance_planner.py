"""Chooses the next grasp by the reward of equation 4.20 over candidate grasps.

Candidates stand around the estimated object: every yaw of the arm's window, a few shifts across the hand, every
closing. A candidate's contacts are predicted on the estimated surface along the approach paths; the candidate with the
most uncertain predicted contacts wins, among those that have room for the open hand, have enough expected contacts, and
determine the object's pose (eq. 3.18): a grasp that cannot be registered adds nothing.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from gtsam import Pose2
from pydantic import Field, field_validator

from drivers.core.configuration import StrictModel
from drivers.core.contacts import Array
from drivers.core.errors import ShapeError
from drivers.core.observability import planar_observability
from drivers.shadow.closing.closing import LEANING, Closing
from sessions.motion.grasp_frame import GraspFrame
from sessions.motion.grasp_plan import ContactHeight, GraspPlan
from tactile_lab.slam.doubt.known_part import LARGEST_SIGMA_m, known_part
from tactile_lab.slam.exploration.candidates import Candidate, ClosingRays, ModelledObject, outward, ring_of_candidates
from tactile_lab.slam.exploration.expected_information import InformationSettings
from tactile_lab.slam.exploration.policies import POLICIES
from tactile_lab.slam.exploration.policy import Surface
from tactile_lab.slam.exploration.rewards import RatedCandidate, explored_share, rate
from tactile_lab.slam.shape.fields.gpis import Gpis
from tactile_lab.slam.shape.surfaces.surface import Contour, SurfaceMesh, extract_contour, extract_mesh
from tactile_lab.slam.tracking.contacts.contact_set import ContactSet, LEAST_SIGMA_rad


class ExplorationSettings(StrictModel):
    """The candidates, and their selection.

    Attributes:
        yaws: number of yaws, spread evenly over the arm's window.
        shifts_m: offsets of the grasp frame across the hand.
        least_contacts: candidates with fewer expected contacts lose against all that have as many.
        least_observability: smallest eigenvalue of (3.18) that the predicted contacts should have; ignored if no
            candidate reaches it (the yaw of a round object is unobservable).
        policy: name of the policy that chooses among all feasible grasps (:mod:`tactile_lab.slam.exploration`);
            None for the reward of equation 4.20 alone, as above, every object being carried.
        information: settings of the policy ``information``, whether it is chosen here or on the command line.
        side_closings: closings with the hand leaning to one side that policies may also choose if a surface is wanted.
        side_heights_m: of the lowest fingertip there: from lower down it would lift the object.
        caution: additional clearance of the open fingertips in standard deviations of the estimated surface, each at
            most the clearance; for policies.
        clearance_m: distance from the estimated surface that the open fingertips' centres keep.
        contour_resolution_m, mesh_resolution_m: of the surface on which the explored share is measured.
    """

    yaws: int = Field(default=12, ge=1)
    shifts_m: tuple[float, ...] = Field(default=(-0.036, -0.024, -0.012, 0.0, 0.012, 0.024, 0.036), min_length=1)
    least_contacts: int = Field(default=4, ge=0)
    least_observability: float = Field(default=0.15, ge=0.0)
    policy: str | None = "information"
    information: InformationSettings = InformationSettings()
    side_closings: tuple[str, ...] = tuple(LEANING)
    side_heights_m: tuple[ContactHeight, ...] = (0.026, 0.034)
    caution: float = Field(default=0.5, ge=0.0)
    clearance_m: float = Field(default=0.012, ge=0.0)
    contour_resolution_m: float = Field(default=0.002, gt=0.0)
    mesh_resolution_m: float = Field(default=0.006, gt=0.0)

    @field_validator("policy")
    @classmethod
    def _is_known(cls, name: str | None) -> str | None:
        return None if name is None else POLICIES.known(name)

    @field_validator("side_closings")
    @classmethod
    def _are_known(cls, names: tuple[str, ...]) -> tuple[str, ...]:
        if unknown := sorted(set(names) - set(LEANING)):
            raise ValueError(f"unknown closings {unknown}; choose from {', '.join(LEANING)}")
        return names


@dataclass(frozen=True)
class KnownShape:
    """The object's shape as estimated now, object frame.

    Attributes:
        field: the implicit surface.
        dimension: 2 or 3.
        origin_height_m: height of the object frame's origin over the table.
        centre_m: middle of the shape's extent, x, y.
        explored: share of the surface that is known, 0..1.
        surface: the measured surface; None if the contacts enclose nothing yet.
        top_height_m: its highest point above the table; None if unknown.
        extracted: that surface as an outline or mesh; None without one.
    """

    field: Gpis
    dimension: int
    origin_height_m: float
    centre_m: Array
    explored: float
    surface: Surface | None = None
    top_height_m: float | None = None
    extracted: Contour | SurfaceMesh | None = None


def known_shape(
    field: Gpis, dimension: int, origin_height_m: float, settings: ExplorationSettings, mesh: SurfaceMesh | None = None
) -> KnownShape:
    """Measure the estimated surface.

    If the contacts enclose nothing yet, the object frame's origin is used as the centre and nothing is explored.

    Args:
        field: of the contacts.
        dimension: 2 or 3.
        origin_height_m: height of the object frame's origin over the table.
        settings: resolutions.
        mesh: the surface of the most probable model, in space; without it the field's own is measured. The explored
            share always follows the field, see :func:`_as_far_as_felt`.
    """
    try:
        extracted = (
            extract_surface(field, dimension, settings)
            if mesh is None
            else _as_far_as_felt(mesh, field, -origin_height_m)
        )
    except ShapeError:
        return KnownShape(field, dimension, origin_height_m, np.zeros(2), 0.0)
    surface = Surface.of(extracted)
    centre_m = (surface.points_m[:, :2].min(axis=0) + surface.points_m[:, :2].max(axis=0)) / 2
    top_m = None if dimension == 2 else float(surface.points_m[:, 2].max()) + origin_height_m
    share = explored_share(extracted)
    return KnownShape(field, dimension, origin_height_m, centre_m, share, surface, top_m, extracted)


def extract_surface(field: Gpis, dimension: int, settings: ExplorationSettings) -> Contour | SurfaceMesh:
    """The field's outline or surface. Raises ShapeError: the contacts enclose nothing."""
    if dimension == 2:
        return extract_contour(field, resolution_m=settings.contour_resolution_m)
    return extract_mesh(field, resolution_m=settings.mesh_resolution_m)


def _as_far_as_felt(mesh: SurfaceMesh, field: Gpis, floor_m: float) -> SurfaceMesh:
    """A model's surface with the field's standard deviations, no small ones where it was not touched.

    The model infers a whole face from a few contacts, with a small sigma if the model is right. Exploration must find
    out whether it is: so knowledge is measured by the field, whose certainty decreases with the distance from contacts.
    The field's values are distances, so their standard deviation is the surface's. Where no contact supports the
    surface (:mod:`tactile_lab.slam.doubt.known_part`) it is not known, whatever the field says.
    """
    sigma_m = field.sigma_inflation * np.sqrt(field.variance(mesh.vertices))
    seen = field.observations
    count = len(field.contacts_m)
    sigmas = seen.value_sigma_m[:count], np.full(count, LEAST_SIGMA_rad)
    part = known_part(mesh, ContactSet(field.contacts_m, field.normals, *sigmas), floor_m)
    return replace(mesh, sigma_m=np.where(part.known, sigma_m, np.maximum(sigma_m, LARGEST_SIGMA_m)))


def closing_rays(table: Closing) -> ClosingRays:
    """The usable parts of a closing's paths as rays in the grasp frame."""
    paths = [table.path(finger) for finger in table.fingers]
    return ClosingRays(
        fingers=table.fingers,
        starts_m=np.array([path.centre_m(path.valid[0]) for path in paths]),
        directions=np.array([path.direction for path in paths]),
        lengths_m=np.array([path.length_m * (path.valid[1] - path.valid[0]) for path in paths]),
        radius_m=table.radius_m,
    )


def choose_grasp(
    shape: KnownShape,
    world_T_object: Pose2,
    closings: Sequence[str],
    table: Callable[[str], Closing],
    yaw_window_rad: tuple[float, float],
    settings: ExplorationSettings,
    has_room: Callable[[GraspPlan], bool] = lambda plan: True,
) -> GraspPlan | None:
    """The most promising grasp around an object at ``world_T_object``; None if no candidate has room.

    Args:
        shape: as estimated.
        world_T_object: expected pose in the table plane.
        closings: names to choose from.
        table: returns a closing by name at the height of this grasp.
        yaw_window_rad: reach of the arm.
        settings: the candidates.
        has_room: further obstacles of a grasp (such as a place where the hand has just landed).
    """
    known = ModelledObject(shape.field, shape.dimension, world_T_object, shape.origin_height_m)
    rays = {name: closing_rays(table(name)) for name in closings}
    yaws_rad = np.linspace(*yaw_window_rad, settings.yaws)
    centre_world_m = np.asarray(world_T_object.transformFrom(shape.centre_m))
    ring = ring_of_candidates(centre_world_m, yaws_rad, np.array(settings.shifts_m), rays)
    free = [candidate for candidate in ring if has_room(_plan(candidate, table))]
    roomy = [candidate for candidate in free if _is_clear(candidate, known, settings.clearance_m)]
    if not roomy:
        return None
    best = _best(rate(roomy, known), known, settings)
    return replace(_plan(best.candidate, table), reason=_reason(best))


def _best(rated: Sequence[RatedCandidate], known: ModelledObject, settings: ExplorationSettings) -> RatedCandidate:
    """The highest reward among the observable candidates with enough contacts; see the settings."""
    enough = [item for item in rated if len(item.contacts.fingers) >= settings.least_contacts]
    telling = (item for item in enough if _observability(item, known) >= settings.least_observability)
    if best := next(telling, None):
        return best
    return enough[0] if enough else max(rated, key=lambda item: len(item.contacts.fingers))


def _observability(item: RatedCandidate, known: ModelledObject) -> float:
    points_m = item.contacts.points_object_m
    if not len(points_m):
        return 0.0
    return planar_observability(points_m, outward(known.field, points_m)).smallest


def _plan(candidate: Candidate, table: Callable[[str], Closing]) -> GraspPlan:
    pose = candidate.world_T_grasp
    frame = GraspFrame(float(pose.x()), float(pose.y()), float(pose.theta()))
    return GraspPlan(frame, candidate.closing, table(candidate.closing).height_m)


def _reason(best: RatedCandidate) -> str:
    sigma_mm = 1e3 * float(np.sqrt(np.mean(best.contacts.variances_m2))) if best.contacts.fingers else 0.0
    return f"{len(best.contacts.fingers)} contacts expected where the surface is known to {sigma_mm:.1f} mm"


def _is_clear(candidate: Candidate, known: ModelledObject, clearance_m: float) -> bool:
    """Whether the open fingertips are all clear of the estimated surface."""
    starts_world_m = _to_world(candidate, candidate.rays.starts_m[:, :2])
    starts_m = np.array([known.world_T_object.transformTo(point) for point in starts_world_m])
    if known.dimension == 3:
        starts_m = np.column_stack([starts_m, candidate.rays.starts_m[:, 2] - known.origin_height_m])
    return bool(np.all(known.field.predict(starts_m).mean_m > clearance_m))


def _to_world(candidate: Candidate, points_m: Array) -> Array:
    return np.array([candidate.world_T_grasp.transformFrom(point) for point in points_m])
