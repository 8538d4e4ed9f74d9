"""The robot of a rig, by its description and its calibration files."""

from __future__ import annotations

from typing import Any

import numpy as np
from gtsam import Pose3, Rot3

from calibration.forearm.placement import load_forearm
from calibration.steps.geometry import KnownGeometry
from drivers.core.configuration import load_model
from drivers.core.errors import ConfigurationError
from drivers.fingertips.kind import FingertipKind
from drivers.shadow.closing.posture import TipEllipsoid
from tactile_lab.rigs.build import fitted_tips
from tactile_lab.rigs.description import Rig
from tactile_lab.rigs.wired import hand_form
from tactile_lab.viewers.robot import Robot, Tip, make_robot

_TABLE_m = (0.6, 0.6, 0.02)
"""Shown where the rig does not describe its table."""


_ANYWHERE = ((-2.0, 2.0),) * 3 + ((-6.2832, 6.2832),) * 3


def robot_of_rig(rig: Rig) -> Robot:
    """Hand, positioner and table of a rig.

    Raises:
        ConfigurationError: a calibration file is invalid.
    """
    kind = rig.description.fingertip_kind
    tips = {finger: _tip(kind, finger, calibration) for finger, calibration in fitted_tips(rig).items()}
    size_m, centre_m = _table(rig)
    world_T_mount = load_forearm(rig.files["forearm"]).world_T_mount.pose()
    ranges = getattr(rig.description.base, "ranges", _ANYWHERE)  # of a positioner of one's own there may be none
    return make_robot(hand_form(rig), world_T_mount, tips, ranges, size_m, centre_m)


def _table(rig: Rig) -> tuple[tuple[float, float, float], tuple[float, float]]:
    if "geometry" in rig.files and (table := load_model(rig.files["geometry"], KnownGeometry).table) is not None:
        return (*table.size_m, table.thickness_m), table.centre_m
    return _TABLE_m, (0.0, 0.0)


def _tip(kind: FingertipKind[Any], finger: str, calibration: Any) -> Tip:
    usual = TipEllipsoid()
    place, semi_axes_m = Pose3(Rot3(), np.array(usual.centre_distal_m)), usual.semi_axes_m
    if (surface := kind.surface(calibration)) is not None:
        semi_axes_m, place = surface
    try:
        sensor: Pose3 | None = kind.body(finger, calibration).distal_T_sensor
    except ConfigurationError:  # its skin is no ellipsoid: the physics does not know it
        sensor = None
    return Tip(place, semi_axes_m, sensor)
