"""The object's shape as an estimation has it now: the most probable model of the contacts at their present poses."""

from __future__ import annotations

from tactile_lab.errors import ShapeError
from tactile_lab.shape.gpis import Gpis
from tactile_lab.shape.models import ShapeName, fit_shape
from tactile_lab.shape.surface import Contour, SurfaceMesh
from tactile_lab.tracking.contact_map import ContactMap
from tactile_lab.tracking.pose_doubt import with_pose_doubt
from tactile_lab.tracking.trackers import TrackingSettings


def present_shape(
    field: Gpis,
    contact_map: ContactMap,
    settings: TrackingSettings,
    model: ShapeName,
    origin_height_m: float,
    resolution_m: float,
) -> Contour | SurfaceMesh | None:
    """The outline (dimension 2) or the surface of the contacts, object frame, with its standard deviation.

    Args:
        field: of the contacts.
        contact_map: the contacts at their poses.
        settings: of the estimation; an object that moves on the table stands on it. Of method "joint" the surface's
            sigma includes what the poses leave open.
        model: of the shape.
        origin_height_m: height of the object frame's origin over the table.
        resolution_m: of the outline or surface.

    Returns:
        None where the contacts enclose nothing: the trajectory is still a result.
    """
    stands = settings.dimension == 3 and settings.freedom == "table"
    floor_m = -origin_height_m if stands else None
    try:
        shape = fit_shape(model, field, contact_map.free_points_m, floor_m)
        if settings.dimension == 2:
            return shape.contour(resolution_m)
        mesh = shape.mesh(resolution_m, floor_m)
        return with_pose_doubt(mesh, shape, contact_map, settings.motion) if settings.method == "joint" else mesh
    except ShapeError:
        return None
