"""The rig's two ArUco markers.

A marker's frame: x to the right and y up on the print, z out of it; corners in OpenCV's order, clockwise from the top
left. Markers on the underside of the table are seen from below: their z points down.
"""

from __future__ import annotations

from typing import Literal

import numpy as np
from pydantic import Field, field_validator

from drivers.core.configuration import StrictModel
from drivers.core.contacts import Array
from drivers.core.fingertip import RigidTransform

_DOWN = RigidTransform(translation_m=(0.0, 0.0, 0.0), rpy_rad=(float(np.pi), 0.0, 0.0))

_SQUARES, _COUNTS = ("4X4", "5X5", "6X6", "7X7"), (50, 100, 250, 1000)
_FAMILIES = {"APRILTAG_16H5": 30, "APRILTAG_25H9": 35, "APRILTAG_36H10": 2320, "APRILTAG_36H11": 587}
MARKER_COUNTS = {
    **{f"DICT_{square}_{count}": count for square in _SQUARES for count in _COUNTS},
    "DICT_ARUCO_ORIGINAL": 1024,
    **{f"DICT_{name}": count for family, count in _FAMILIES.items() for name in (family, family.replace("H", "h"))},
    "DICT_ARUCO_MIP_36H12": 250,
    "DICT_ARUCO_MIP_36h12": 250,
}
"""How many markers each of OpenCV's dictionaries has, in the order of their numbers, those of one number by name."""
DICTIONARIES = tuple(MARKER_COUNTS)
"""Their names; packets give the place in it."""


class MarkerSettings(StrictModel):
    """The two markers of the rig.

    Attributes:
        dictionary: OpenCV's name of the dictionary.
        world_id, world_side_m: the marker fixed to the table, and the intended side of its black square.
        object_id, object_side_m: the same for the marker under the object.
        print_scale: measured length of the print's check bar divided by its nominal length.
        world_T_worldmarker: its pose in the world; z down.
        object_T_objectmarker: pose of the object's marker in the object's frame; z down while the object stands on the
            table.
        corner_sigma_px: error of a detected corner, per axis.
        glass_thickness_m, glass_index: the table's glass plate between camera and markers.
        table_sigma_m, table_sigma_rad: error that even a sharp picture leaves, because markers are glued on by hand.
        freedom: ``planar``: the object is assumed to stand on the table; ``spatial``: it may have any pose, and
            pictures that allow two poses are refused.
        ambiguous_sigmas: required confidence in the choice between a single marker's two poses, in standard deviations
            of the corners' noise.
        moved_px: distance from its mean at which the world marker counts as moved.
        world_marker_fixed: the world marker cannot move (it is part of the table). If it seems to move, the camera has
            moved, and a new mean is started. Otherwise the ground truth ends there, since it is unknown which of the
            two was bumped.
        largest_blur_px: wider edges mean that the picture is not sharp, or that something moved.
        largest_misfit_m: a larger misfit of the object's square on the table means that the object is lifted or tilted.
    """

    dictionary: str = "DICT_4X4_50"
    world_id: int = Field(default=0, ge=0)
    world_side_m: float = Field(default=0.050, gt=0.0)
    object_id: int = Field(default=7, ge=0)
    object_side_m: float = Field(default=0.035, gt=0.0)
    print_scale: float = Field(default=1.0, ge=0.995, le=1.005)
    world_T_worldmarker: RigidTransform = _DOWN
    object_T_objectmarker: RigidTransform = _DOWN
    corner_sigma_px: float = Field(default=0.1, gt=0.0)
    glass_thickness_m: float = Field(default=0.0, ge=0.0)
    glass_index: float = Field(default=1.5, ge=1.0)
    table_sigma_m: float = Field(default=0.0003, ge=0.0)
    table_sigma_rad: float = Field(default=0.001, ge=0.0)
    freedom: Literal["planar", "spatial"] = "planar"
    ambiguous_sigmas: float = Field(default=5.0, gt=0.0)
    moved_px: float = Field(default=1.0, gt=0.0)
    world_marker_fixed: bool = False
    largest_blur_px: float = Field(default=1.6, gt=0.0)
    largest_misfit_m: float = Field(default=0.001, gt=0.0)

    @field_validator("dictionary")
    @classmethod
    def _known(cls, value: str) -> str:
        return known_dictionary(value)

    @property
    def world_corners_m(self) -> Array:
        """The world marker's corners in its own frame, true size, shape (4, 3)."""
        return marker_corners(self.world_side_m * self.print_scale)

    @property
    def object_corners_m(self) -> Array:
        """The object marker's corners in its own frame, true size, shape (4, 3)."""
        return marker_corners(self.object_side_m * self.print_scale)


def known_dictionary(name: str) -> str:
    """The name, if OpenCV has a dictionary of this name. Raises ValueError otherwise."""
    if name not in DICTIONARIES:
        raise ValueError(f"{name!r} is not an OpenCV dictionary")
    return name


def marker_corners(side_m: float) -> Array:
    """Corners in the marker's frame, shape (4, 3), metres."""
    return side_m / 2 * np.array([[-1.0, 1, 0], [1, 1, 0], [1, -1, 0], [-1, -1, 0]])
