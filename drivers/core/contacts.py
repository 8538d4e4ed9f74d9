"""A contact is a point with a normal; a grasp is the contacts of one closing."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TypeAlias

import numpy as np
from gtsam import Pose3
from numpy.typing import NDArray

Array: TypeAlias = NDArray[np.float64]

FINGERS = ("FF", "MF", "RF", "LF", "TH")
"""Fingers of the Shadow hand in the palm's own order: first, middle, ring, little finger, thumb."""

LARGEST_GRASP_m = 0.6
"""Largest span of a hand; contacts farther apart must be in wrong units."""

FARTHEST_m = 100.0
"""Coordinates beyond this lose the digits that tell one contact from another: the world's origin is elsewhere."""

LARGEST_SLOPE = 0.5
"""Smallest horizontal part of a normal that is informative about a horizontal contour (60 degrees of slope)."""


@dataclass(frozen=True)
class Contact:
    """One fingertip's touch.

    Attributes:
        finger: one of :data:`FINGERS`.
        point_world_m: contact point, shape (3,), world frame, metres.
        normal_world: unit surface normal, shape (3,), world frame, pointing out of the object.
        point_covariance_m2: covariance of the point, shape (3, 3), world frame, square metres; by default the thesis's
            1 mm per axis (section 3.4).
        normal_sigma_rad: standard deviation of the normal's direction, per axis, radians; by default the thesis's 5
            degrees.
        force_N: magnitude of the contact force.
        probed: touched before the hand closed (a tap on the top, a probe from the side), with the object not moved
            until the grasp.
        shared_covariance_m2: the part of ``point_covariance_m2`` by errors that all touches of this finger share during
            a session (offsets of its joint sensors), shape (3, 3): more touches do not reduce it; None for none.
        shared_by_all: whether these errors are the same for all fingers (their skins, one calibration), and not each
            finger's own: then they make the whole object larger or smaller.
        shared_moves_m: instead of it, where it is known: how one standard deviation of each of these errors moves the
            point, shape (3, k), world frame. A column means the same error in all touches of a finger, with another
            displacement in another posture, so that the errors can be estimated.
    """

    finger: str
    point_world_m: Array
    normal_world: Array
    point_covariance_m2: Array = field(default_factory=lambda: 1e-6 * np.eye(3))
    normal_sigma_rad: float = float(np.deg2rad(5.0))
    force_N: float = 0.0
    probed: bool = False
    shared_covariance_m2: Array | None = None
    shared_moves_m: Array | None = None
    shared_by_all: bool = False


@dataclass(frozen=True)
class ApproachPath:
    """The straight path of one fingertip's contact point while it closed, which is free space.

    Attributes:
        finger: one of :data:`FINGERS`.
        start_world_m: its start, shape (3,), world frame, metres.
        end_world_m: where it touched, or where it stopped without a touch, shape (3,).
        touched: whether it ended at a contact.
    """

    finger: str
    start_world_m: Array
    end_world_m: Array
    touched: bool


@dataclass(frozen=True)
class StepSigma:
    """How well the object's motion between two grasps is known: standard deviations.

    Attributes:
        translation_m: per axis.
        rotation_rad: about each axis.
    """

    translation_m: float
    rotation_rad: float


@dataclass(frozen=True)
class Grasp:
    """The contacts of one closing, and how the hand carried the object since the last one.

    Attributes:
        index: number of the grasp in the session, from 0.
        stamp_ns: time in the middle of the capture, session clock.
        contacts: at most one contact per finger from the closing, followed by those probed before it.
        world_T_palm: the palm's pose at capture; the first one defines the axes of the object frame.
        hand_motion_world: how the hand has moved the object since the previous grasp, so that predicted
            ``world_T_object = hand_motion_world * previous world_T_object`` (eq. 3.8): as the fingertips felt it, or
            as the palm moved; identity in the first grasp, and where the object was left in place.
        approach_paths: the fingers' approach paths, including those of fingers that met nothing; empty if unknown.
        motion_sigma: of that motion; None where only the rig's usual slip is known.
        begins_anew: the object has fallen over since the previous grasp: nothing that was felt before holds any more.
    """

    index: int
    stamp_ns: int
    contacts: tuple[Contact, ...]
    world_T_palm: Pose3 = field(default_factory=Pose3)
    hand_motion_world: Pose3 = field(default_factory=Pose3)
    approach_paths: tuple[ApproachPath, ...] = ()
    motion_sigma: StepSigma | None = None
    begins_anew: bool = False

    @property
    def touching(self) -> frozenset[str]:
        """Fingers that touch the object in this grasp, without those that only probed it."""
        return frozenset(contact.finger for contact in self.contacts if not contact.probed)

    @property
    def has_closed(self) -> bool:
        """Whether fingers closed, as far as is known; in a touch without a grasp no two come from opposite sides."""
        if self.touching or not self.approach_paths:
            return True
        ways = np.array([path.end_world_m - path.start_world_m for path in self.approach_paths])
        return bool((ways @ ways.T).min() < 0)

    @property
    def points_world_m(self) -> Array:
        """Contact points, shape (n, 3), world frame, metres."""
        return np.array([contact.point_world_m for contact in self.contacts]).reshape(-1, 3)

    @property
    def normals_world(self) -> Array:
        """Outward unit normals, shape (n, 3), world frame."""
        return np.array([contact.normal_world for contact in self.contacts]).reshape(-1, 3)
