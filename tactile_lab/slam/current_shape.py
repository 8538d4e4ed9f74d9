"""The current estimate of the object's shape: the most probable model of the contacts at their present poses."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Self

import numpy as np

from drivers.core.errors import ShapeError
from tactile_lab.slam.shape.fields.gpis import Gpis
from tactile_lab.slam.shape.selection.models import SHAPE_MODELS, ShapeName, fit_shape
from tactile_lab.slam.shape.surfaces.surface import Contour, SurfaceMesh
from tactile_lab.slam.tracking.contacts.contact_map import ContactMap
from tactile_lab.slam.tracking.evidence.fixed_lag import condense
from tactile_lab.slam.tracking.joint.pose_uncertainty import propagate_pose_uncertainty
from tactile_lab.slam.tracking.trackers import TrackingSettings

MOST_CONTACTS = 300
"""Of the field between grasps: a thousand would take 72 MB in the plane, and seconds after every grasp."""


@dataclass(frozen=True)
class PresentShape:
    """The shape that a model fits to the contacts.

    Attributes:
        extracted: the outline (dimension 2) or the surface, object frame, with its standard deviation; None if the
            contacts enclose nothing, or the model fails: the trajectory is still a result.
        warning: why the model failed, with its file; empty if it did not.
    """

    extracted: Contour | SurfaceMesh | None
    warning: str = ""


class CurrentShape:
    """Field and shape of the latest map, computed once. A copy begins without them, as they are large.

    Between grasps, of more than :data:`MOST_CONTACTS` contacts a spread-out selection of the settled ones counts
    (:mod:`tactile_lab.slam.tracking.evidence.fixed_lag`): neither memory nor time grow with the session.

    Args:
        settings: of the estimation.
        model: of the shape.
    """

    def __init__(self, settings: TrackingSettings, model: ShapeName) -> None:
        self._settings, self._model = settings, model
        self._latest: tuple[ContactMap, bool, ContactMap] | None = None
        self._shape: tuple[ContactMap, float, PresentShape] | None = None

    def __deepcopy__(self, memo: dict[int, object]) -> Self:
        return type(self)(self._settings, self._model)

    def contacts(self, contact_map: ContactMap, *, has_ended: bool) -> ContactMap:
        """The contacts that make up the shape.

        Args:
            contact_map: all contacts at their present poses.
            has_ended: no grasp follows; all contacts count.
        """
        if self._latest is None or self._latest[0] is not contact_map or self._latest[1] is not has_ended:
            chosen = contact_map if has_ended else _bounded(contact_map, self._settings.joint.window)
            self._latest = contact_map, has_ended, chosen
        return self._latest[2]

    def extract(
        self, contacts: ContactMap, origin_height_m: float, resolution_m: float
    ) -> Contour | SurfaceMesh | None:
        """See :func:`present_shape`."""
        if self._shape is None or self._shape[0] is not contacts or self._shape[1] != resolution_m:
            given = contacts.fit(), contacts, self._settings, self._model
            self._shape = contacts, resolution_m, present_shape(*given, origin_height_m, resolution_m)
        return self._shape[2].extracted

    @property
    def warnings(self) -> tuple[str, ...]:
        """Of the latest shape."""
        return (self._shape[2].warning,) if self._shape is not None and self._shape[2].warning else ()


def _bounded(contact_map: ContactMap, window: int) -> ContactMap:
    """The map with at most :data:`MOST_CONTACTS` contacts, those of the last grasps among them."""
    count, later = len(contact_map.contacts), contact_map.grasp_indices >= len(contact_map.placed) - window
    return contact_map if count <= MOST_CONTACTS else condense(contact_map, window, MOST_CONTACTS - int(later.sum()))


def present_shape(
    field: Gpis,
    contact_map: ContactMap,
    settings: TrackingSettings,
    model: ShapeName,
    origin_height_m: float,
    resolution_m: float,
) -> PresentShape:
    """The shape of the contacts by one model; never raises for errors of the model.

    Args:
        field: of the contacts.
        contact_map: the contacts at their poses.
        settings: of the estimation; an object that moves on the table stands on it. With method "joint" the surface's
            sigma includes the uncertainty of the poses.
        model: of the shape.
        origin_height_m: height of the object frame's origin over the table.
        resolution_m: of the outline or surface.
    """
    try:
        extracted = _extract(field, contact_map, settings, model, origin_height_m, resolution_m)
    except ShapeError:
        return PresentShape(None)
    except (Exception, SystemExit) as error:
        return PresentShape(None, _warning(model, f"raises {SHAPE_MODELS.explain(model, error)}"))
    problem = _problem(extracted, Contour if settings.dimension == 2 else SurfaceMesh)
    return PresentShape(None, _warning(model, problem)) if problem else PresentShape(extracted)


def _extract(
    field: Gpis,
    contact_map: ContactMap,
    settings: TrackingSettings,
    model: ShapeName,
    origin_height_m: float,
    resolution_m: float,
) -> Contour | SurfaceMesh:
    stands = settings.dimension == 3 and settings.freedom == "table"
    floor_m = -origin_height_m if stands else None
    shape = fit_shape(model, field, contact_map.free_points_m, floor_m)
    uncertain = settings.method == "joint" and "pose uncertainty" not in settings.joint.without
    if settings.dimension == 2:
        contour = shape.contour(resolution_m)
        return propagate_pose_uncertainty(contour, shape, contact_map, settings.motion) if uncertain else contour
    mesh = shape.mesh(resolution_m, floor_m)
    if stands and (top_m := contact_map.top_m) is not None:
        mesh = mesh.below(top_m)
    return propagate_pose_uncertainty(mesh, shape, contact_map, settings.motion) if uncertain else mesh


def _problem(extracted: object, wanted: type[Contour | SurfaceMesh]) -> str:
    """Why an outline or surface is invalid; empty if it is valid."""
    if not isinstance(extracted, wanted):
        return f"returned {type(extracted).__name__} instead of {wanted.__name__}"
    points_m = extracted.points_m if isinstance(extracted, Contour) else extracted.vertices
    if not np.isfinite(points_m).all() or np.isnan(extracted.sigma_m).any():
        return "gives points or standard deviations that are not finite"
    return ""


def _warning(model: str, problem: str) -> str:
    return f"no shape, as the shape model {model} of {SHAPE_MODELS.file(model)} {problem}"
