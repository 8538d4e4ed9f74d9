"""Observations for a forearm-to-world calibration: touches of known geometry, views of a marker on the hand."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TypeAlias

import numpy as np
from gtsam import Pose3

from drivers.core.contacts import Array
from drivers.shadow.model.hand_form import RIGHT_HAND, HandForm


@dataclass(frozen=True, eq=False)
class HandPose:
    """Measured joints of positioner and hand.

    Attributes:
        base_q: axes of the positioner, shape (6,), metres and radians.
        joints_rad: joint angles of the hand, shape (24,).
        form: which hand it is.
    """

    base_q: Array
    joints_rad: Array
    form: HandForm = RIGHT_HAND


@dataclass(frozen=True, eq=False)
class Plane:
    """A face of known place: of the table, or of a calibration block.

    Attributes:
        name: for people.
        point_world_m: a point of it, shape (3,).
        normal_world: unit normal out of the body, shape (3,).
        sigma_m: how well its place along the normal is known, one standard deviation.
    """

    name: str
    point_world_m: Array
    normal_world: Array
    sigma_m: float = 0.0

    def directions(self) -> Array:
        """Directions that a touch determines, shape (1, 3)."""
        return np.asarray(self.normal_world)[None]


@dataclass(frozen=True, eq=False)
class Spot:
    """A known point, small enough that a touch determines all three coordinates."""

    name: str
    point_world_m: Array
    sigma_m: float = 0.0

    def directions(self) -> Array:
        """Directions that a touch determines, shape (3, 3)."""
        return np.eye(3)


Target: TypeAlias = Plane | Spot


@dataclass(frozen=True, eq=False)
class Touch:
    """A fingertip on a known target.

    Attributes:
        finger: which one.
        pose: of the hand, mean over the press.
        point_distal_m: contact point in the finger's distal frame, shape (3,).
        normal_distal: unit normal out of what is touched, shape (3,).
        point_covariance_m2: covariance of the point, shape (3, 3), distal frame.
        target: what is touched.
        force_N: of the press; 0 where it is not known.
    """

    finger: str
    pose: HandPose
    point_distal_m: Array
    normal_distal: Array
    point_covariance_m2: Array
    target: Target
    force_N: float = 0.0


@dataclass(frozen=True, eq=False)
class View:
    """A picture of the marker or board on the hand.

    Attributes:
        pose: of the hand at the picture.
        board_m, board_px: corners of the board that are seen, in its own frame, shape (n, 3), and in the picture,
            pixels, shape (n, 2).
        world_px: corners of the world marker, shape (4, 2); None where it is hidden.
    """

    pose: HandPose
    board_m: Array
    board_px: Array
    world_px: Array | None = None


@dataclass(frozen=True, eq=False)
class PosePair:
    """The hand in the mount's frame with the target in the camera's, as other programs record them."""

    mount_T_hand: Pose3
    camera_T_target: Pose3
