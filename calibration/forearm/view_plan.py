"""A plan of pictures: the palm over the camera, turned and tilted in every direction, near and far."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np
from gtsam import Pose3, Rot3
from pydantic import Field

from drivers.core.configuration import StrictModel
from drivers.core.contacts import Array
from drivers.core.fingertip import RigidTransform, Vector3
from drivers.positioner.kinematics import mount_joints
from drivers.shadow.model.hand_form import RIGHT_HAND, HandForm
from drivers.shadow.model.kinematics import forearm_T_palm_matrix, joint_vector

PALM_T_BOARD = RigidTransform(translation_m=(0.010, -0.012, 0.045), rpy_rad=(float(np.pi / 2), 0.0, 0.0))
"""A board flat on a right palm, its print out of the palm and its up along the fingers."""

_PALM_DOWN = np.array([[0.0, 0.0, 1.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]])
_THUMB_AWAY = {"THJ5": np.radians(-30.0), "THJ4": 0.1}


class ViewSettings(StrictModel):
    """Poses at which the board is shown.

    Attributes:
        pictures: their number.
        centre_m: middle of the board's places, world; above the camera.
        spread_m: largest distance from it, per axis.
        tilt_rad: largest tilt of the palm.
        turn_rad: largest turn about the vertical.
        wrist_rad: largest bend of the wrist joints to either side.
    """

    pictures: int = Field(default=20, ge=3)
    centre_m: Vector3 = (0.0, 0.0, 0.19)
    spread_m: Vector3 = (0.09, 0.06, 0.07)
    tilt_rad: float = Field(default=float(np.radians(25.0)), ge=0.0)
    turn_rad: float = Field(default=float(np.radians(100.0)), ge=0.0)
    wrist_rad: float = Field(default=float(np.radians(8.0)), ge=0.0)


@dataclass(frozen=True, eq=False)
class PlannedView:
    """One picture to take.

    Attributes:
        world_T_palm: where the palm should be.
        joints_rad: joint angles of the hand, shape (24,).
        form: the hand that shows the board.
    """

    world_T_palm: Pose3
    joints_rad: Array
    form: HandForm = RIGHT_HAND
    kind: Literal["view"] = "view"

    @property
    def instruction(self) -> str:
        """What to do, in words."""
        x, y, z = (1e3 * np.asarray(self.world_T_palm.translation())).tolist()
        return f"show the board with the palm at ({x:.0f}, {y:.0f}, {z:.0f}) mm"

    def base_q(self, world_T_mount: Pose3) -> Array:
        """Axes of the positioner for it, shape (6,)."""
        forearm_T_palm = Pose3(forearm_T_palm_matrix(self.joints_rad, self.form.side))
        return np.asarray(mount_joints(world_T_mount.inverse() * self.world_T_palm * forearm_T_palm.inverse(), 0.0))


def palm_T_board(form: HandForm) -> RigidTransform:
    """Where the board belongs on a hand's palm: :data:`PALM_T_BOARD`, or its mirror image."""
    x_m, *others_m = PALM_T_BOARD.translation_m
    return PALM_T_BOARD.model_copy(update={"translation_m": (form.handedness * x_m, *others_m)})


def plan_views(settings: ViewSettings | None = None, form: HandForm = RIGHT_HAND) -> tuple[PlannedView, ...]:
    """Pictures spread evenly over places, tilts and turns (an additive recurrence, the same every time).

    Args:
        settings: how many, and where.
        form: the hand that shows the board; one without a wrist bends none.
    """
    settings = settings or ViewSettings()
    return tuple(_view(settings, _even(index), form) for index in range(settings.pictures))


def _even(index: int) -> Array:
    """A point of [-1, 1]^7 from a sequence that fills it evenly (generalised golden ratio)."""
    root = 1.1127756842787055  # of x^8 = x + 1
    return np.asarray(2.0 * ((0.5 + (index + 1) * root ** -np.arange(1.0, 8.0)) % 1.0) - 1.0)


def _view(settings: ViewSettings, at: Array, form: HandForm) -> PlannedView:
    turn, tilt, towards = settings.turn_rad * at[0], settings.tilt_rad * np.sqrt(abs(at[1])), np.pi * at[2]
    lean = Rot3.Expmap(tilt * np.array([np.cos(towards), np.sin(towards), 0.0])).matrix()
    rotation = lean @ Rot3.Yaw(float(turn)).matrix() @ _PALM_DOWN
    board = np.array(settings.centre_m) + np.array(settings.spread_m) * at[3:6]
    place = board - rotation @ np.array(palm_T_board(form).translation_m)
    bend = settings.wrist_rad * at[6]
    angles = {**_THUMB_AWAY, "WRJ1": float(bend), "WRJ2": float(-bend)}
    joints = joint_vector({joint: angle for joint, angle in angles.items() if joint in form.joints})
    return PlannedView(Pose3(Rot3(rotation), place), joints, form)
