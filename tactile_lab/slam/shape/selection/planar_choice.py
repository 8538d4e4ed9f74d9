"""Chooses between the smooth field and sharp faces by the evidence of the contacts.

The object's name is not used. The models' evidence is compared (Bayesian information criterion of the faces against the
marginal likelihood of the field), and a sharp shape is only accepted if it contradicts nothing known: its contacts lie
on it, and places where fingertips were are outside.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray
from scipy.special import log_ndtr

from drivers.core.contacts import Array
from drivers.core.errors import ShapeError
from tactile_lab.slam.shape.fields.gpis import Gpis
from tactile_lab.slam.shape.fields.gpis_shape import GpisShape
from tactile_lab.slam.shape.model import FittedShape
from tactile_lab.slam.shape.planar.corners import at_corners
from tactile_lab.slam.shape.planar.outlines import encloses
from tactile_lab.slam.shape.planar.polygon import Polygon
from tactile_lab.slam.shape.planar.regularity import with_right_angles
from tactile_lab.slam.shape.planar.rounded_outline import RoundedOutline
from tactile_lab.slam.shape.planar.segmentation import PlanarContacts, segment
from tactile_lab.slam.shape.selection.spatial_choice import best_spatial_shape
from tactile_lab.slam.shape.surfaces.sampling import distances_to_polygon
from tactile_lab.slam.shape.surfaces.surface import Contour

SharpOutline: TypeAlias = Polygon | RoundedOutline

FINGERTIP_RADIUS_m = 0.006
"""Smallest thickness of a fingertip: the point this far outside of each contact is free."""

_FREE_WEIGHT = 0.5
_ON_OUTLINE_SIGMAS = 5.0
_ON_FACE_SIGMAS, _BEYOND_m = 3.0, 0.010


def best_shape(gpis: Gpis, free_points_m: Array | None = None, floor_m: float | None = None) -> FittedShape:
    """The field itself, or the facet model of its contacts if that is the more probable one.

    For contacts in space see :func:`tactile_lab.slam.shape.selection.spatial_choice.best_spatial_shape`.

    Args:
        gpis: a field with its kernel at a maximum of the marginal likelihood; otherwise the comparison favours faces.
        free_points_m: places known to be outside, shape (q, d), for example on the paths of fingertips; those at each
            contact's own fingertip are always checked.
        floor_m: height of the table that the object stands on; for contacts in space.
    """
    field = GpisShape(gpis)
    if gpis.contacts_m.shape[1] == 3:
        return best_spatial_shape(field, gpis, best_shape, free_points_m, floor_m)
    without = gpis.settings.without
    if field.log_evidence is None or "polygon" in without:
        return field
    try:
        provisional = field.contour()
        sharp = sharp_outlines(gpis, provisional)
    except ShapeError:  # no outline, or no sharp one: the field is the best description
        return field
    free = _free_points(gpis, free_points_m)
    evidence = {one: one.log_evidence + free_evidence(one.contour(), free, gpis) for one in sharp}
    likeliest = max(evidence, key=evidence.__getitem__)
    advantage = evidence[likeliest] - field.log_evidence - free_evidence(provisional, free, gpis)
    likelier = advantage > 0 or "field" in without
    return likeliest if likelier and ("contradictions" in without or _holds_contacts(likeliest)) else field


def sharp_outlines(gpis: Gpis, provisional: Contour) -> list[SharpOutline]:
    """What a planar field's contacts can be but smooth: straight faces, and straight and round sides.

    Raises:
        ShapeError: nothing of that encloses anything.
    """
    without, found = gpis.settings.without, list[SharpOutline]()
    makers: list[Callable[[], SharpOutline]] = [lambda: polygon_of(gpis, provisional)]
    makers += [lambda: rounded_of(gpis, provisional)] if "round sides" not in without else []
    problem = ShapeError("no outline is asked for")
    for maker in makers:
        try:
            found.append(maker())
        except ShapeError as error:
            problem = error
    if not found:
        raise problem
    return found


def rounded_of(gpis: Gpis, provisional: Contour) -> RoundedOutline:
    """The straight and round sides of a planar field's contacts, whatever their evidence. Raises ShapeError."""
    return RoundedOutline.of(_contacts(gpis), provisional.points_m)


def polygon_of(gpis: Gpis, provisional: Contour) -> Polygon:
    """The facet model of a planar field's contacts, whatever its evidence. Raises ShapeError if there is none."""
    return outline_of(gpis, provisional)[0]


def outline_of(gpis: Gpis, provisional: Contour) -> tuple[Polygon, NDArray[np.bool_]]:
    """As :func:`polygon_of`; also returns which of the field's contacts lie at its corners, shape (n,). Raises
    ShapeError.
    """
    contacts = _contacts(gpis)
    faces = segment(contacts, provisional.points_m)
    leaning = at_corners(contacts, faces)
    if "corners" in gpis.settings.without:
        leaning = np.zeros_like(leaning)
    regular = "right angles" not in gpis.settings.without
    cornered = _corner(contacts, leaning, provisional, regular=regular) if leaning.any() else None
    try:
        plain = Polygon.of(contacts, with_right_angles(contacts, faces) if regular else faces, provisional)
    except ShapeError:  # corners taken for faces may enclose nothing
        if cornered is None:
            raise
        return cornered, leaning
    if cornered is not None and cornered.log_evidence > plain.log_evidence:
        return cornered, leaning
    return plain, np.zeros_like(leaning)


def _contacts(gpis: Gpis) -> PlanarContacts:
    seen = gpis.observations
    return PlanarContacts.of(gpis.contacts_m, gpis.normals, seen.value_sigma_m, seen.gradient_sigma)


def _corner(
    contacts: PlanarContacts, leaning: NDArray[np.bool_], provisional: Contour, *, regular: bool
) -> Polygon | None:
    """The polygon of the other contacts, with these at its corners; None if the others enclose nothing."""
    on_faces = contacts.select(~leaning)
    try:
        faces = segment(on_faces, provisional.points_m)
        faces = with_right_angles(on_faces, faces) if regular else faces
        return Polygon.of(on_faces, faces, provisional, contacts.select(leaning))
    except ShapeError:
        return None


def _free_points(gpis: Gpis, free_points_m: Array | None) -> Array:
    at_contacts = gpis.contacts_m + FINGERTIP_RADIUS_m * gpis.normals
    return at_contacts if free_points_m is None else np.vstack([at_contacts, free_points_m])


def free_evidence(contour: Contour, free_points_m: Array, gpis: Gpis) -> float:
    """Logarithm of the probability that places known to be free are outside of an outline.

    The error of a place is that of a contact, plus the outline's own sigma. Neighbouring places are nearly redundant,
    hence a weight below one.
    """
    if len(free_points_m) == 0:
        return 0.0
    nearest = np.linalg.norm(free_points_m[:, None] - contour.points_m[None], axis=2).argmin(axis=1)
    outward = distances_to_polygon(free_points_m, contour.points_m)
    outward = np.where(encloses(contour.points_m, free_points_m), -outward, outward)
    sigma = np.hypot(contour.sigma_m[nearest], gpis.observations.value_sigma_m.mean())
    return float(_FREE_WEIGHT * log_ndtr(outward / sigma).sum())


def _holds_contacts(outline: SharpOutline) -> bool:
    """Whether all contacts but a few lie on the outline itself, not only on the lines of its sides, and none far along
    a line.

    An outlier may lie anywhere. But a contact that continues a side, in position and direction, far beyond its end
    shows that the object extends there: untouched sides are missing.
    """
    contacts = outline.contacts
    away_m = distances_to_polygon(contacts.points_m, outline.outline_m)
    across_m, turned_rad = outline.misfits
    continues = (across_m < _ON_FACE_SIGMAS * contacts.point_sigma_m) & (
        turned_rad < _ON_FACE_SIGMAS * contacts.normal_sigma_rad
    )
    astray = np.mean(away_m > _ON_OUTLINE_SIGMAS * contacts.point_sigma_m)
    return bool(astray <= 0.05 and not np.any(continues & (away_m > _BEYOND_m)))
