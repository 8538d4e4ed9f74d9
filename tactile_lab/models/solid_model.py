"""The estimated shape as a rigid body: surface, convex parts, mass properties, friction, uncertainty.

The model's frame is the object frame lowered to the table: z up, z = 0 where the object stands, x and y as in
``trajectory.csv``. Lengths are metres, masses kilograms.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import trimesh

from drivers.core.contacts import Array
from drivers.core.errors import SessionDataError, given_by_a_person
from sessions.perception.weighing.value import Value
from tactile_lab.evaluation.files.mesh_io import read_estimated_mesh
from tactile_lab.evaluation.files.properties_file import MeasuredBody
from tactile_lab.evaluation.files.tables import RERUN
from tactile_lab.evaluation.inertia import EvenBody
from tactile_lab.models.convex_parts import convex_parts

ASSUMED_DENSITY_kg_m3 = 600.0
"""Between a filled carton and wood; an unknown object's mass is this times its estimated volume."""

ASSUMED_FRICTION = 0.5
KNOWN_m = 0.005
"""Surface with a larger standard deviation is a guess between contacts."""

_FOOT_m = 0.0008
"""Corners of convex parts this close to the foot stand on it: the decomposition leaves them a little above."""


@dataclass(frozen=True)
class Uncertainty:
    """Standard deviation of the surface along its normal.

    Attributes:
        median_m, p95_m, largest_m: over the surface's vertices.
        guessed_share: share of the vertices that are a guess between contacts, see :data:`KNOWN_m`.
    """

    median_m: float
    p95_m: float
    largest_m: float
    guessed_share: float

    @classmethod
    def of(cls, sigma_m: Array) -> Uncertainty:
        """Of the vertices' standard deviations, shape (n,), metres."""
        median, p95, largest = np.quantile(sigma_m, [0.5, 0.95, 1.0])
        return cls(float(median), float(p95), float(largest), float(np.mean(sigma_m > KNOWN_m)))


@dataclass(frozen=True)
class SolidModel:
    """A rigid body in the model's frame.

    Attributes:
        name: of letters, digits, hyphens and underscores.
        surface: closed, faces outward, metres.
        sigma_m: standard deviation of the surface at each of its vertices, shape (n,).
        parts: convex hulls whose union approximates the surface, for collisions.
        mass_kg: total.
        mass_is_assumed: whether nobody stated or measured it.
        friction: Coulomb's, against anything.
        lowered_m: height of the object frame's origin over the model's.
        measured_centre_m: x and y of the centre of mass, shape (2,); None if the object was not weighed.
        mass_sigma_kg, centre_sigma_m: standard deviations of what was measured; 0 for what is stated or assumed.
    """

    name: str
    surface: trimesh.Trimesh
    sigma_m: Array
    parts: tuple[trimesh.Trimesh, ...]
    mass_kg: float
    mass_is_assumed: bool
    friction: float
    lowered_m: float
    measured_centre_m: Array | None = None
    mass_sigma_kg: float = 0.0
    centre_sigma_m: float = 0.0

    @property
    def body(self) -> EvenBody:
        """The surface, evenly filled."""
        mass = Value(self.mass_kg, self.mass_sigma_kg)
        return EvenBody(self.surface, self.sigma_m, mass, self.measured_centre_m, self.centre_sigma_m)

    @property
    def centre_m(self) -> Array:
        """Centre of mass, shape (3,): as measured in x and y, otherwise of the evenly filled surface."""
        return self.body.centre_m

    @property
    def inertia_kg_m2(self) -> Array:
        """Inertia of the evenly filled surface about the centre of mass, along the model's axes, shape (3, 3)."""
        return self.body.inertia_kg_m2

    @property
    def uncertainty(self) -> Uncertainty:
        """Of the surface."""
        return Uncertainty.of(self.sigma_m)

    def as_json(self) -> dict[str, Any]:
        """What ``model.json`` says of the model."""
        found = self.uncertainty
        return {
            "name": self.name,
            "unit": "metre",
            "volume_m3": float(self.surface.volume),
            "extents_m": self.surface.extents.tolist(),
            "mass_kg": self.mass_kg,
            "mass_is_assumed": self.mass_is_assumed,
            "centre_of_mass_m": self.centre_m.tolist(),
            "inertia_kg_m2": self.inertia_kg_m2.tolist(),
            "principal_inertia": self.body.principal().as_json(),
            "friction": self.friction,
            "convex_parts": len(self.parts),
            "surface_sigma_m": {"median": found.median_m, "p95": found.p95_m, "largest": found.largest_m},
            "guessed_share": found.guessed_share,
            "object_frame_height_m": self.lowered_m,
        }


def make_model(
    mesh_file: Path,
    name: str,
    mass_kg: float | None = None,
    friction: float | None = None,
    measured: MeasuredBody | None = None,
) -> SolidModel:
    """The model of an estimated surface.

    Args:
        mesh_file: ``mesh.ply`` of a session's results, with ``sigma_m`` at each vertex.
        name: of the model.
        mass_kg: of the object; None takes what was measured, or else assumes :data:`ASSUMED_DENSITY_kg_m3`.
        friction: Coulomb's; None takes the table's as it was measured, or else assumes :data:`ASSUMED_FRICTION`.
        measured: what the session measured of the object.

    Raises:
        SessionDataError: there is no such file.
        ConfigurationError: it holds no closed surface with its standard deviation.
    """
    surface, sigma_m = _read_surface(mesh_file)
    lowered_m = -float(surface.vertices[:, 2].min())
    surface.apply_translation([0.0, 0.0, lowered_m])
    known = measured or MeasuredBody()
    stated = known.mass_kg if mass_kg is None else Value(mass_kg, 0.0)
    mass = stated or Value(ASSUMED_DENSITY_kg_m3 * float(surface.volume), 0.0)
    usual = ASSUMED_FRICTION if known.table_friction is None else known.table_friction.value
    return SolidModel(
        name=name,
        surface=surface,
        sigma_m=sigma_m,
        parts=tuple(_standing_hull(corners) for corners in convex_parts(surface)),
        mass_kg=mass.value,
        mass_is_assumed=stated is None,
        friction=usual if friction is None else friction,
        lowered_m=lowered_m,
        measured_centre_m=known.centre_m,
        mass_sigma_kg=mass.sigma,
        centre_sigma_m=known.centre_sigma_m,
    )


def _read_surface(path: Path) -> tuple[trimesh.Trimesh, Array]:
    if not path.is_file():
        estimated = (path.parent / "trajectory.csv").is_file()
        hint = "Too few contacts enclose nothing: touch the object more often" if estimated else RERUN
        raise SessionDataError("there is no estimated surface", where=str(path), hint=hint)
    with given_by_a_person():
        found = read_estimated_mesh(path)
    return found.mesh, found.sigma_m


def _standing_hull(corners: Array) -> trimesh.Trimesh:
    """The convex hull of a part, with its foot flat on the table."""
    standing = corners.copy()
    standing[standing[:, 2] < _FOOT_m, 2] = 0.0
    hull: trimesh.Trimesh = trimesh.convex.convex_hull(standing)
    return hull
