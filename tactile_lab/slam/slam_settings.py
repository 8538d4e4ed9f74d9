"""The parameters of tactile SLAM: tracking, the pose graph behind it, and the final shape."""

from __future__ import annotations

from pydantic import Field

from tactile_lab.slam.graph.back_end import BackEndSettings
from tactile_lab.slam.shape.selection.models import ShapeName
from tactile_lab.slam.tracking.trackers import TrackingSettings


class SlamSettings(TrackingSettings):
    """All parameters of the method.

    Attributes:
        back_end: the pose graph.
        least_first_contacts: the first grasp with this many contacts defines the object frame; contacts of grasps
            before it count as long as the hand has not carried the object since.
        placement_limit_m: see :mod:`tactile_lab.slam.tactile_slam`.
        shape_model: of the final outline or surface; "auto" is chosen by evidence.
        lost_after: successive untracked grasps after which the object counts as lost.
        contour_resolution_m, mesh_resolution_m: of the final shape.
        largest_sigma_m: also write the part of the shape with a standard deviation below this; None: do not.
    """

    back_end: BackEndSettings = BackEndSettings()
    least_first_contacts: int = Field(default=3, ge=1)
    placement_limit_m: float = Field(default=0.010, gt=0)
    lost_after: int = Field(default=4, ge=1)
    shape_model: ShapeName = "auto"
    contour_resolution_m: float = Field(default=0.001, gt=0)
    mesh_resolution_m: float = Field(default=0.003, gt=0)
    largest_sigma_m: float | None = Field(default=None, gt=0)
