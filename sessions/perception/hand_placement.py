"""The hand in the world, from the newest joints of hand and positioner."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from gtsam import Pose3

from drivers.core.contacts import FINGERS, Array
from drivers.core.errors import DeviceError
from drivers.shadow.model.hand_form import RIGHT_HAND, HandForm
from drivers.shadow.model.kinematics import forearm_T_palm_matrix
from sessions.perception.contact_world import HandGeometry


class HandPlacement:
    """Keeps the newest joints, and computes the hand's geometry once when requested.

    Args:
        mount_T_forearm: the positioner's kinematics, from its joint vector (6,).
        world_T_mount: the forearm-to-world calibration.
        form: of the hand.
    """

    def __init__(
        self, mount_T_forearm: Callable[[Array], Pose3], world_T_mount: Pose3, form: HandForm = RIGHT_HAND
    ) -> None:
        self._mount_T_forearm, self._world_T_mount, self._form = mount_T_forearm, world_T_mount, form
        self._joints_rad: Array | None = None
        self._base_q: Array | None = None
        self._forearm: Array | None = None
        self._geometry: HandGeometry | None = None

    @property
    def ready(self) -> bool:
        """Whether the hand and the positioner have both sent samples."""
        return self._joints_rad is not None and self._base_q is not None

    def take_joints(self, joints_rad: Array) -> Array:
        """Newest joint angles, shape (24,), radians, as an array."""
        self._joints_rad, self._geometry = np.asarray(joints_rad, dtype=float), None
        return self._joints_rad

    def take_base(self, base_q: Array) -> Array:
        """Newest positioner joints, shape (6,), metres and radians, as an array."""
        self._base_q, self._forearm, self._geometry = np.asarray(base_q, dtype=float), None, None
        return self._base_q

    def latest(self) -> tuple[Array, Array]:
        """Newest joints of the hand and of the positioner. Raises DeviceError before the first of either."""
        if self._joints_rad is None:
            raise DeviceError("no joint angles have arrived yet", where="hand", hint="Check that the palm answers")
        if self._base_q is None:
            raise DeviceError("no position has arrived yet", where="base", hint="Check that the positioner answers")
        return self._joints_rad, self._base_q

    @property
    def joints_rad(self) -> Array:
        """Newest joint angles, shape (24,), radians. Raises DeviceError before the first."""
        return self.latest()[0]

    @property
    def base_q(self) -> Array:
        """Newest positioner joints, shape (6,), metres and radians. Raises DeviceError before the first."""
        return self.latest()[1]

    @property
    def world_T_forearm(self) -> Array:
        """The forearm by the newest positioner joints, shape (4, 4). Raises DeviceError before the first."""
        if self._forearm is None:
            self._forearm = self._world_T_forearm(self.base_q)
        return self._forearm

    @property
    def world_T_palm(self) -> Pose3:
        """The palm, from the newest joints. Raises DeviceError before the first."""
        return Pose3(self.current().world_T_palm)

    @property
    def palm_world_m(self) -> Array:
        """Origin of the palm, shape (3,), from the newest joints. Raises DeviceError before the first."""
        return np.asarray(self.current().world_T_palm[:3, 3])

    @property
    def world_T_distal(self) -> dict[str, Pose3]:
        """The distal frame of each finger, from the newest joints. Raises DeviceError before the first."""
        frames = self.current().world_T_distal
        return {finger: Pose3(frames[FINGERS.index(finger)]) for finger in self._form.fingers}

    @property
    def world_R_distal(self) -> dict[str, Array]:
        """Orientation of each distal frame, shape (3, 3), by finger. Raises DeviceError before the first."""
        return dict(zip(FINGERS, self.current().world_T_distal[:, :3, :3], strict=True))

    def current(self) -> HandGeometry:
        """Geometry from the newest joints. Raises DeviceError before the first."""
        if self._geometry is None:
            joints_rad, _ = self.latest()
            self._geometry = self._place(joints_rad, self.world_T_forearm)
        return self._geometry

    def place(self, joints_rad: Array, base_q: Array) -> HandGeometry:
        """Geometry from these joints."""
        return self._place(joints_rad, self._world_T_forearm(base_q))

    def _place(self, joints_rad: Array, world_T_forearm: Array) -> HandGeometry:
        world_T_palm = world_T_forearm @ forearm_T_palm_matrix(joints_rad, self._form.side)
        return HandGeometry(joints_rad, world_T_palm, self._form.side)

    def _world_T_forearm(self, base_q: Array) -> Array:
        return np.asarray((self._world_T_mount * self._mount_T_forearm(base_q)).matrix())
