"""Which part of an outline or surface was touched, and which is only a guess.

A closed shape says nothing about how much of it was felt: contacts in one corner of a box give a small closed body. A
point of the shape counts as known if a contact that the estimate uses lies near, on a side that faces the same way, and
if its standard deviation is small. The part of a standing object that rests on the table is known from the table.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TypeAlias, TypeVar

import numpy as np
from numpy.typing import NDArray

from drivers.core.contacts import Array
from tactile_lab.slam.shape.surfaces.surface import Contour, LEVEL_SIGMA_m, SurfaceMesh
from tactile_lab.slam.tracking.contacts.contact_set import ContactSet

Mask: TypeAlias = NDArray[np.bool_]
_Shape = TypeVar("_Shape", bound=Contour | SurfaceMesh)

REACH_m = 0.040
"""A contact tells about the surface up to here. Thirty contacts all over a hand-sized object know all of it."""

LARGEST_ANGLE_rad = float(np.deg2rad(60.0))
"""Between a contact's normal and the surface's: contacts of one face tell nothing of the faces beside it."""

LARGEST_SIGMA_m = 0.005
"""Where the shape is less certain than this it is only interpolated between contacts."""

_BLOCK = 2000
"""Number of points of a surface that are compared with all contacts at once."""

_DOWN = -0.95


@dataclass(frozen=True)
class KnownPart:
    """The touched part of a shape.

    Attributes:
        known: of each point of the outline or vertex of the surface, whether it was touched nearby, shape (n,).
        share: of the outline's length or the surface's area, 0 to 1.
        distances_m: from each point to the nearest contact on a side that faces the same way, at most
            :data:`REACH_m`, shape (n,).
    """

    known: Mask
    share: float
    distances_m: Array


def known_part(shape: Contour | SurfaceMesh, contacts: ContactSet, floor_m: float | None = None) -> KnownPart:
    """The part of an outline or surface that contacts support.

    Args:
        shape: object frame.
        contacts: those that the estimate uses, object frame, of the shape's dimension.
        floor_m: height of the table under a standing object, object frame; None for an object held free.
    """
    points, normals, sizes = _outline(shape) if isinstance(shape, Contour) else _surface(shape)
    distances = _nearest_alike(points, normals, contacts)
    known = (distances < REACH_m) & (shape.sigma_m <= LARGEST_SIGMA_m)
    if floor_m is not None and isinstance(shape, SurfaceMesh):
        known |= (points[:, 2] < floor_m + LEVEL_SIGMA_m) & (normals[:, 2] < _DOWN)
    share = float(sizes @ known / max(float(sizes.sum()), 1e-12))
    return KnownPart(known, min(share, 1.0), distances)


def with_guesses_told(shape: _Shape, part: KnownPart) -> _Shape:
    """The shape with its known part, its standard deviation elsewhere no less than the distance to the nearest contact.

    A model's own standard deviation there holds only if the object is what the model expects.
    """
    guessed = np.maximum(part.distances_m, LARGEST_SIGMA_m)
    sigma_m = np.where(part.known, shape.sigma_m, np.maximum(shape.sigma_m, guessed))
    return replace(shape, sigma_m=sigma_m, known=part.known)


def _outline(contour: Contour) -> tuple[Array, Array, Array]:
    """Points of an outline, their outward normals, and the length that belongs to each."""
    lengths = np.linalg.norm(np.roll(contour.points_m, -1, axis=0) - contour.points_m, axis=1)
    return contour.points_m, contour.normals, (lengths + np.roll(lengths, 1)) / 2


def _surface(mesh: SurfaceMesh) -> tuple[Array, Array, Array]:
    """Vertices of a surface, their outward normals, and the area that belongs to each."""
    corners = mesh.vertices[mesh.faces]
    areas = np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1) / 6
    sizes = np.bincount(mesh.faces.ravel(), weights=np.repeat(areas, 3), minlength=len(mesh.vertices))
    return mesh.vertices, mesh.normals, np.asarray(sizes, dtype=float)


def _nearest_alike(points: Array, normals: Array, contacts: ContactSet) -> Array:
    """Distance of each point to the nearest contact with a similar normal, at most :data:`REACH_m`."""
    nearest = np.full(len(points), REACH_m)
    if len(contacts) == 0:
        return nearest
    for first in range(0, len(points), _BLOCK):
        block = slice(first, first + _BLOCK)
        gaps = np.linalg.norm(points[block, None] - contacts.points_m[None], axis=2)
        gaps[normals[block] @ contacts.normals.T < np.cos(LARGEST_ANGLE_rad)] = np.inf
        nearest[block] = np.minimum(nearest[block], gaps.min(axis=1))
    return nearest
