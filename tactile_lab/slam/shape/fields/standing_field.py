"""A smooth field that stands on a table, and may end in a flat top.

A field alone rounds untouched parts: walls curve inward below the lowest contacts, and the rim of a flat top is blunt.
Here walls continue to the table if the lowest contacts are on vertical walls: the field is also fitted to mirror images
of these below the table, slightly inward, and cut at the table. A level top is treated likewise if one height explains
its contacts better than the field does. If the walls are vertical over the whole height and contacts show that their
upper edge is round, as that of a tin or a carton, the edge at the foot is assumed to have the same radius. A field
that would still end above the table is continued to it (:mod:`floating`).
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from drivers.core.contacts import Array
from drivers.core.errors import ShapeError
from tactile_lab.slam.shape.fields.floating import UPRIGHT_SINE, standing
from tactile_lab.slam.shape.fields.gpis import Gpis
from tactile_lab.slam.shape.solids.planes import WeightedContacts
from tactile_lab.slam.shape.solids.polyhedron import contacts_of
from tactile_lab.slam.shape.surfaces.surface import Contour, Indices, SurfaceMesh, extract_mesh

_LEVEL_COSINE = np.cos(np.deg2rad(20.0))
_MIRRORED_SHARE = 0.35
"""Share of the object's height from which walls are mirrored at an end."""
_LEAST_UPRIGHT_SHARE = 0.8
"""Walls are mirrored only if this share of the contacts near the end is on vertical walls: not below a sphere."""
_INSET_SLOPE, _LARGEST_INSET_m = 0.2, 0.006
"""Mirror images are moved inward by this share of their distance from the end: edges at the foot are often rounded, and
walls not touched near it should end between a sharp and a rounded edge.
"""
_ROUND_SHARE, _LEAST_ROUND_CONTACTS = 0.15, 4
"""A round edge at the top needs this many contacts within this share of the height, with normals between horizontal and
vertical; noise alone tilts hardly any contact this far.
"""
_UPRIGHT_DOWN_SHARE = 0.9
"""Share of the contacts below the edge that must be on vertical walls."""
_LARGEST_RETREAT = 0.10
"""Largest distance of an edge inside the walls below it, as a share of the height; a neck lies farther inside."""
_EDGE_TILTS_rad = np.deg2rad([20.0, 50.0])
_VAGUENESS = 2.0
"""An edge at the foot is represented by two rows of points: the downward tilts of their normals, and the factor on
their standard deviations.
"""
_LEAST_TOP_CONTACTS = 3
_KERNEL_STEPS = 10
_SAME_HEIGHT_SIGMAS = 4.0


@dataclass(frozen=True)
class StandingField:
    """A field with flat ends; implements FittedShape. Made by :meth:`fit`.

    Attributes:
        field: fitted to the contacts and their mirror images.
        floor_m: height of the table.
        ceiling_m: height of the flat top, None if it has none.
        log_evidence: log evidence of all contacts, without mirror images.
        mirrored: ends at which walls were mirrored, each with the distance of the nearest contact on a wall.
        name: "standing gpis".
    """

    field: Gpis
    floor_m: float
    ceiling_m: float | None
    log_evidence: float
    mirrored: tuple[tuple[float, float], ...]
    name: str = "standing gpis"

    @classmethod
    def fit(cls, gpis: Gpis, floor_m: float) -> StandingField:
        """Let a field stand on the table; its kernel changes only if a level top is removed from its contacts.

        Args:
            gpis: a field fitted in space.
            floor_m: height of the table in the field's frame.

        Raises:
            ShapeError: the contacts are in the plane, or all below the table.
        """
        contacts = contacts_of(gpis)
        if contacts.points_m[:, 2].max() <= floor_m:
            raise ShapeError("all contacts lie below the table", hint="Check the units and the contacts' heights")
        evidence, ceiling_m, rest = gpis.log_marginal_likelihood(), None, np.arange(len(contacts))
        top = _top(contacts)
        if _LEAST_TOP_CONTACTS <= len(top) < len(contacts):
            without = np.setdiff1d(rest, top)
            level_m = float(np.average(contacts.points_m[top, 2], weights=contacts.point_weights[top]))
            walls = _fit(gpis, contacts, without, []).optimise(max_iterations=_KERNEL_STEPS)
            ended = walls.log_marginal_likelihood() + _level(contacts, top, level_m)
            if ended > evidence:
                evidence, ceiling_m, rest, gpis = ended, level_m, without, walls
        ends = [floor_m] if ceiling_m is None else [floor_m, ceiling_m]
        field = standing(_fit(gpis, contacts, rest, ends), floor_m)
        return cls(field, floor_m, ceiling_m, float(evidence), _gaps(contacts, rest, ends))

    def contour(self, resolution_m: float = 0.001) -> Contour:
        """Raises ShapeError: a solid has no outline."""
        raise ShapeError("contacts in space have a surface, not an outline", hint="Ask for the mesh")

    def mesh(self, resolution_m: float = 0.003, floor_m: float | None = None) -> SurfaceMesh:
        """The surface; it ends at the table for which it was fitted, even if the height is not given again.

        Raises:
            ShapeError: the field has no inside near the contacts.
        """
        floor_m = self.floor_m if floor_m is None else floor_m
        mesh = extract_mesh(self.field, resolution_m=resolution_m, floor_m=floor_m, ceiling_m=self.ceiling_m)
        return replace(mesh, sigma_m=np.hypot(mesh.sigma_m, self._doubt_m(mesh)))

    def _doubt_m(self, mesh: SurfaceMesh) -> Array:
        """Uncertainty of walls between an end and the contacts next to it, where the edge may be sharp or rounded."""
        doubt = np.zeros(len(mesh.vertices))
        for end_m, gap_m in self.mirrored:
            away = np.abs(mesh.vertices[:, 2] - end_m) / max(gap_m, 1e-6)
            largest = min(_INSET_SLOPE * gap_m, _LARGEST_INSET_m)
            doubt = np.maximum(doubt, largest * np.clip(1 - away, 0.0, 1.0))
        return np.where(np.abs(mesh.normals[:, 2]) < _LEVEL_COSINE, doubt, 0.0)


def _top(contacts: WeightedContacts) -> Indices:
    """Indices of the contacts on the highest level that several share, with nothing touched above it."""
    heights, sigma = contacts.points_m[:, 2], contacts.point_weights**-0.5
    level = np.flatnonzero(contacts.normals[:, 2] > _LEVEL_COSINE)
    if len(level) == 0:
        return level.astype(np.int64)
    reach = _SAME_HEIGHT_SIGMAS * float(np.median(sigma))
    crowds = [level[np.abs(heights[level] - heights[k]) < reach] for k in level]
    crowd = max(crowds, key=lambda members: (len(members), float(heights[members].mean())))
    is_highest = heights.max() < heights[crowd].mean() + 2 * reach
    return np.asarray(crowd if is_highest else level[:0], dtype=np.int64)


def _level(contacts: WeightedContacts, top: Indices, level_m: float) -> float:
    """Log likelihood of a level top, with the BIC penalty for its height."""
    weights, turns = contacts.point_weights[top], contacts.normal_weights[top]
    away = contacts.normals[top] - [0.0, 0.0, 1.0]
    misfit = np.sum(weights * (contacts.points_m[top, 2] - level_m) ** 2) + np.sum(turns[:, None] * away**2)
    scale = 0.5 * np.log(weights).sum() + 1.5 * np.log(turns).sum() - 2 * len(top) * np.log(2 * np.pi)
    return float(scale - 0.5 * misfit - 0.5 * np.log(len(contacts)))


def _walls_near(contacts: WeightedContacts, rest: Indices, end_m: float, ends_m: list[float]) -> Indices:
    """Contacts on the walls that meet an end; none if the contacts near it are not mostly on vertical walls."""
    reach_m = _MIRRORED_SHARE * float(np.ptp(np.append(contacts.points_m[:, 2], ends_m)))
    up = np.abs(contacts.normals[rest, 2])
    near = (np.abs(contacts.points_m[rest, 2] - end_m) < reach_m) & (up < _LEVEL_COSINE)
    walls = near & (up < UPRIGHT_SINE)
    return rest[walls] if walls.sum() >= _LEAST_UPRIGHT_SHARE * near.sum() else rest[:0]


def _gaps(contacts: WeightedContacts, rest: Indices, ends_m: list[float]) -> tuple[tuple[float, float], ...]:
    """The ends with walls, and the distance of the nearest contact on these walls."""
    walls = [(end_m, _walls_near(contacts, rest, end_m, ends_m)) for end_m in ends_m]
    gaps = [(end_m, np.abs(contacts.points_m[members, 2] - end_m)) for end_m, members in walls]
    return tuple((end_m, float(away.min())) for end_m, away in gaps if len(away))


def _edge_radius_m(gpis: Gpis, contacts: WeightedContacts, rest: Indices, floor_m: float) -> float:
    """Radius of the upper edge of walls that are vertical down to the table; zero if it is sharp, or if they are not.

    Least squares over the contacts on the edge: one whose normal rises by an angle t lies ``radius (1 - sin t)`` below
    the top.
    """
    heights, up = contacts.points_m[rest, 2], contacts.normals[rest, 2]
    level = contacts.points_m[contacts.normals[:, 2] > _LEVEL_COSINE, 2]
    if len(level) == 0:
        return 0.0
    top_m = float(np.median(level))
    tall_m = top_m - floor_m
    below = top_m - heights > _ROUND_SHARE * tall_m
    edge = ~below & (up > UPRIGHT_SINE) & (up < _LEVEL_COSINE)
    upright = np.abs(up[below]) < UPRIGHT_SINE
    if edge.sum() < _LEAST_ROUND_CONTACTS or upright.sum() < _UPRIGHT_DOWN_SHARE * len(upright):
        return 0.0
    at_half_height = contacts.points_m[rest[edge]] * [1, 1, 0] + [0, 0, (top_m + floor_m) / 2]
    if gpis.mean(at_half_height).min() < -_LARGEST_RETREAT * tall_m:
        return 0.0
    lever = 1 - up[edge]
    return float(np.clip(lever @ (top_m - heights[edge]) / (lever @ lever), 0.0, _ROUND_SHARE * tall_m))


@dataclass(frozen=True)
class _Image:
    """Virtual contacts that continue a wall: their originals, their positions, and the factor on their sigmas."""

    source: Indices
    points_m: Array
    normals: Array
    vagueness: float

    @classmethod
    def mirror(cls, contacts: WeightedContacts, walls: Indices, end_m: float) -> _Image:
        """Mirror contacts on walls at the end, slightly inward."""
        points, normals = contacts.points_m[walls], contacts.normals[walls]
        inset_m = np.minimum(_INSET_SLOPE * np.abs(points[:, 2] - end_m), _LARGEST_INSET_m)
        inward = points - inset_m[:, None] * normals
        return cls(walls, inward * [1, 1, -1] + [0, 0, 2 * end_m], normals * [1, 1, -1], 1.0)

    @classmethod
    def round_foot(cls, contacts: WeightedContacts, walls: Indices, floor_m: float, radius_m: float) -> list[_Image]:
        """Place virtual contacts below those on walls, on a rounded edge at the foot."""
        level = contacts.normals[walls] * [1.0, 1.0, 0.0]
        level /= np.linalg.norm(level, axis=1, keepdims=True)
        feet = contacts.points_m[walls] * [1.0, 1.0, 0.0] + [0.0, 0.0, floor_m]
        images = []
        for tilt in _EDGE_TILTS_rad:
            across, down = np.cos(tilt), np.sin(tilt)
            points = feet - radius_m * (1 - across) * level + [0.0, 0.0, radius_m * (1 - down)]
            images.append(cls(walls, points, across * level - [0.0, 0.0, down], _VAGUENESS))
        return images


def _images(gpis: Gpis, contacts: WeightedContacts, rest: Indices, ends_m: list[float]) -> list[_Image]:
    """Virtual contacts at the ends of walls; the first end is the table."""
    images: list[_Image] = []
    for index, end_m in enumerate(ends_m):
        walls = _walls_near(contacts, rest, end_m, ends_m)
        radius_m = _edge_radius_m(gpis, contacts, rest, end_m) if index == 0 else 0.0
        if radius_m > 0:
            images += _Image.round_foot(contacts, walls, end_m, radius_m)
        else:
            images.append(_Image.mirror(contacts, walls, end_m))
    return images


def _fit(gpis: Gpis, contacts: WeightedContacts, rest: Indices, ends_m: list[float]) -> Gpis:
    """Fit the field of some contacts and of their images at the ends, with the kernel of another field."""
    images = _images(gpis, contacts, rest, ends_m)
    source = np.concatenate([rest, *(image.source for image in images)])
    vagueness = np.concatenate([np.ones(len(rest)), *(np.full(len(one.source), one.vagueness) for one in images)])
    return gpis.refit(
        np.vstack([contacts.points_m[rest], *(image.points_m for image in images)]),
        np.vstack([contacts.normals[rest], *(image.normals for image in images)]),
        vagueness * contacts.point_weights[source] ** -0.5,
        vagueness * contacts.normal_weights[source] ** -0.5,
    )
