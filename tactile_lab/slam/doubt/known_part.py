"""Which part of an outline or surface was touched, and which is only a guess.

A closed shape says nothing about how much of it was felt: contacts in one corner of a box give a small closed body. A
point of the shape counts as known if a contact that the estimate uses lies near, on a side that faces the same way, and
if its standard deviation is small. The part of a standing object that rests on the table is known from the table, and
the inside of a wall from its outside: fingers were beside it, and the rim tells how thick it is.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TypeAlias, TypeVar

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array
from scipy.spatial import cKDTree
from scipy.spatial.distance import cdist

from drivers.core.contacts import Array
from tactile_lab.slam.doubt.status import LEAST_GRASPS
from tactile_lab.slam.doubt.unfelt_top import unfelt_top
from tactile_lab.slam.shape.selection.unexplained import are_inside
from tactile_lab.slam.shape.surfaces.sampling import distances_to_mesh
from tactile_lab.slam.shape.surfaces.surface import Contour, LEVEL_SIGMA_m, SurfaceMesh
from tactile_lab.slam.tracking.contacts.contact_set import ContactSet

Mask: TypeAlias = NDArray[np.bool_]
_Shape = TypeVar("_Shape", bound=Contour | SurfaceMesh)

REACH_m = 0.025
"""A contact tells about a shape up to here, where the model goes on by symmetry, along sides or between contacts: a
spout, a handle or a corner is hardly wider than the places left between. Forty contacts all over a solid of 60 to 100
mm know nine tenths of it.
"""

_HAND_SIZED_m = 0.150
"""Longest side of what that was measured on; features of larger objects are larger."""

LARGEST_GUESS_m = 0.040
"""No guess is more uncertain than this."""

_CONTRADICTED_m, _DEEP_m = 0.010, 0.005
"""A finger went through so deep inside the model: so far around the nearest place of its surface that is not known."""

_REACH_ALONE_m = 0.010
"""The same of one grasp or two, whose contacts hardly confirm each other: a corner may be between any two of them."""

LARGEST_ANGLE_rad = float(np.deg2rad(60.0))
"""Between a contact's normal and the surface's: contacts of one face tell nothing of the faces beside it."""

LARGEST_SIGMA_m = 0.005
"""Where the shape is less certain than this it is only interpolated between contacts."""

_BLOCK = 100
"""Number of contacts that are compared with all of a surface at once."""

_FACING_m = 0.02
"""What normals count beside places: the outside of a wall is what is nearest and faces the other way."""

_DOWN = -0.95


@dataclass(frozen=True)
class KnownPart:
    """The touched part of a shape.

    Attributes:
        near: of each point of the outline or vertex of the surface, whether it was touched nearby, shape (n,).
        known: whether it is certain besides, shape (n,).
        share: of the outline's length or the surface's area, 0 to 1.
        distances_m: from each point to the nearest contact on a side that faces the same way, at most
            :data:`LARGEST_GUESS_m`, shape (n,).
        unfelt: where a surface has a top in place of which there may be an opening, shape (n,).
    """

    near: Mask
    known: Mask
    share: float
    distances_m: Array
    unfelt: Mask


def known_part(
    shape: Contour | SurfaceMesh,
    contacts: ContactSet,
    floor_m: float | None = None,
    free_m: Array | None = None,
    *,
    reach_m: float = REACH_m,
) -> KnownPart:
    """The part of an outline or surface that contacts support.

    Args:
        shape: object frame.
        contacts: those that the estimate uses, object frame, of the shape's dimension.
        floor_m: height of the table under a standing object, object frame, on which a top may be open; None for an
            object held free.
        free_m: places that a finger went through, object frame, shape (q, d); a surface that encloses them is not known
            there.
        reach_m: how far from a contact the shape is known.
    """
    sides = _outline(shape) if isinstance(shape, Contour) else _surface(shape)
    distances_m, nowhere = _nearest_alike(sides, contacts), np.zeros(len(sides.points_m), dtype=bool)
    near, unfelt, foot = distances_m < reach_m, nowhere, nowhere
    if isinstance(shape, SurfaceMesh):
        near = _lined(shape, near) & ~_contradicted(shape, free_m)
        if floor_m is not None:
            unfelt = unfelt_top(shape, contacts.points_m, contacts.normals, near)
            foot = (sides.points_m[:, 2] < floor_m + LEVEL_SIGMA_m) & (sides.normals[:, 2] < _DOWN)
    near, distances_m = near & ~unfelt, np.where(unfelt, LARGEST_GUESS_m, distances_m)
    known, near = (near & (shape.sigma_m <= LARGEST_SIGMA_m)) | foot, near | foot
    share = float(sides.sizes @ known / max(float(sides.sizes.sum()), 1e-12))
    return KnownPart(near, known, min(share, 1.0), distances_m, unfelt)


def reach_for(contacts: ContactSet, grasps: int) -> float:
    """How far from a contact a shape is known, in metres.

    Args:
        contacts: those that the estimate uses; a guess beyond them makes an object no larger.
        grasps: number of them that it is made of.
    """
    if grasps < LEAST_GRASPS:
        return _REACH_ALONE_m
    longest_m = float(np.ptp(contacts.points_m, axis=0).max())
    return min(REACH_m * max(1.0, longest_m / _HAND_SIZED_m), LARGEST_GUESS_m)


def with_guesses_told(shape: _Shape, part: KnownPart) -> _Shape:
    """The shape with its known part, its standard deviation where nothing near was touched no less than the distance to
    the nearest contact.

    A model's own standard deviation there holds only if the object is what the model expects. Near contacts it stands,
    also where it is large: what may be hidden at a sharp corner is less than the way to the next contact.
    """
    guessed = np.maximum(part.distances_m, LARGEST_SIGMA_m)
    sigma_m = np.where(part.near, shape.sigma_m, np.maximum(shape.sigma_m, guessed))
    return replace(shape, sigma_m=sigma_m, known=part.known)


@dataclass(frozen=True)
class _Sides:
    """Points of a shape with the flat pieces that meet there: at a sharp corner none of these faces as the point does.

    Attributes:
        points_m: shape (n, d).
        normals: outward, at the points, shape (n, d).
        sizes: length or area that belongs to each point, shape (n,).
        piece_normals: outward, shape (m, d).
        meet: which pieces meet at which point, shape (n, m), sparse.
    """

    points_m: Array
    normals: Array
    sizes: Array
    piece_normals: Array
    meet: csr_array


def _outline(contour: Contour) -> _Sides:
    count = len(contour.points_m)
    edges = np.roll(contour.points_m, -1, axis=0) - contour.points_m
    lengths = np.linalg.norm(edges, axis=1)
    outward = np.column_stack([edges[:, 1], -edges[:, 0]]) / np.maximum(lengths, 1e-12)[:, None]
    each = np.arange(count)
    meet = _meeting(np.concatenate([each, each]), np.concatenate([each, each - 1]) % count, (count, count))
    return _Sides(contour.points_m, contour.normals, (lengths + np.roll(lengths, 1)) / 2, outward, meet)


def _surface(mesh: SurfaceMesh) -> _Sides:
    corners, count = mesh.vertices[mesh.faces], len(mesh.vertices)
    across = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    doubled = np.linalg.norm(across, axis=1)
    sizes = np.bincount(mesh.faces.ravel(), weights=np.repeat(doubled / 6, 3), minlength=count)
    pieces = np.repeat(np.arange(len(mesh.faces)), 3)
    meet = _meeting(mesh.faces.ravel(), pieces, (count, len(mesh.faces)))
    outward = across / np.maximum(doubled, 1e-12)[:, None]
    return _Sides(mesh.vertices, mesh.normals, np.asarray(sizes, dtype=float), outward, meet)


def _meeting(points: NDArray[np.intp], pieces: NDArray[np.intp], shape: tuple[int, int]) -> csr_array:
    return csr_array((np.ones(len(points), dtype=np.float32), (points, pieces)), shape=shape)


def _lined(mesh: SurfaceMesh, near: Mask) -> Mask:
    """What was touched, shape (n,), with the inside of walls whose outside was."""
    if mesh.lining is None or not mesh.lining.any():
        return near
    facing = _FACING_m * mesh.normals
    others = np.hstack([mesh.vertices, facing])[~mesh.lining]
    across = cKDTree(others).query(np.hstack([mesh.vertices, -facing])[mesh.lining])[1]
    lined = near.copy()
    lined[mesh.lining] |= near[~mesh.lining][across]
    return lined


def _contradicted(mesh: SurfaceMesh, free_m: Array | None) -> Mask:
    """Vertices near places that a finger went through, and that are inside all the same."""
    if free_m is None or not len(free_m):
        return np.zeros(len(mesh.vertices), dtype=bool)
    deep_m = free_m[are_inside(free_m, mesh)]
    deep_m = deep_m[distances_to_mesh(deep_m, mesh) > _DEEP_m] if len(deep_m) else deep_m
    if not len(deep_m):
        return np.zeros(len(mesh.vertices), dtype=bool)
    nearest = np.unique(cKDTree(mesh.vertices).query(deep_m)[1])
    return np.asarray(cKDTree(mesh.vertices[nearest]).query(mesh.vertices)[0] < _CONTRADICTED_m)


def _nearest_alike(sides: _Sides, contacts: ContactSet) -> Array:
    """Distance of each point to the nearest contact on a side that faces the same way, at most
    :data:`LARGEST_GUESS_m`.
    """
    nearest, least = np.full(len(sides.points_m), LARGEST_GUESS_m), np.cos(LARGEST_ANGLE_rad)
    for first in range(0, len(contacts), _BLOCK):
        block = slice(first, first + _BLOCK)
        facing = contacts.normals[block].T
        alike = (sides.meet @ (sides.piece_normals @ facing >= least).astype(np.float32)) > 0
        alike |= sides.normals @ facing >= least
        gaps = np.where(alike, cdist(sides.points_m, contacts.points_m[block]), np.inf)
        nearest = np.minimum(nearest, gaps.min(axis=1))
    return np.asarray(nearest)
