"""A hand's model in numbers: kinematics of both sides, joint tables, interpolation, motors and gains."""

from __future__ import annotations

import numpy as np
import pytest

from drivers.shadow.model.bodies import FOREARM, LINK_SHAPES, mirror_shape
from drivers.shadow.model.gains import GainTable
from drivers.shadow.model.hand_form import HandForm
from drivers.shadow.model.interpolation import Curves, Plane
from drivers.shadow.model.joint_calibration import JointCalibration, joint_counts
from drivers.shadow.model.kinematics import (
    JOINT_LIMITS_rad,
    forearm_T_palm_matrix,
    joint_table,
    link_T_matrices,
    palm_T_distal_matrices,
)
from drivers.shadow.model.motors import DRIVEN_JOINTS, MotorMap, drivable_range_rad
from drivers.simulation.calibration import SimulatedCalibration
from tests.support.baseline import assert_baseline
from tests.support.plain_values import plain


@pytest.mark.parametrize("side", ["right", "left"])
def test_kinematics(side: str) -> None:
    low, high = JOINT_LIMITS_rad.T
    bent = np.array([low + share * (high - low) for share in (0.3, 0.8)])
    found = {
        "limits": JOINT_LIMITS_rad,
        "joints": plain(joint_table(side)),
        "tips": palm_T_distal_matrices(bent, side)[..., :3, :],
        "palm": forearm_T_palm_matrix(bent, side)[..., :3, :],
    }
    if side == "right":
        found["links"] = link_T_matrices(bent[:1])[..., :3, :]
    assert_baseline(f"shadow/kinematics_{side}", found)


def test_outer_shapes() -> None:
    links = {name: plain(list(shapes)) for name, shapes in LINK_SHAPES.items()}
    mirrored = plain([mirror_shape(shape) for shape in (*FOREARM, *LINK_SHAPES["WRJ1"])])
    assert_baseline("shadow/bodies", {"forearm": plain(list(FOREARM)), "mirrored": mirrored, **links})


def test_joint_tables_read_forwards_and_backwards() -> None:
    joints: JointCalibration = SimulatedCalibration.from_package().joints
    counts = np.linspace(300.0, 3900.0, 37)
    found = {
        "joint counts": joint_counts(counts),
        "angles": [joints.angles_rad(counts), joints.angles_rad(counts[::-1]), joints.angles_rad(np.full(37, 5000.0))],
        "counts": [joints.raw_counts(np.linspace(-0.2, 1.4, 24)), joints.raw_counts(np.full(24, 0.1))],
        "ranges": [joints.range_counts, joints.range_rad, joints.has_joint, joints.turns],
    }
    assert_baseline("shadow/joint_tables", found)


def test_curves_and_maps_of_the_plane() -> None:
    curves = Curves([np.array([[0.0, 5.0], [1.0, 3.0], [4.0, -2.0]]), np.array([[1.0, 7.0], [3.0, 7.0]])])
    source = np.array([[0.0, 0.0], [4.0, 0.5], [0.5, 3.0], [4.0, 4.0], [2.0, 1.7]])
    target = np.array([[1.0, 0.0], [9.0, 2.0], [2.0, 7.0], [10.0, 9.0], [5.0, 4.4]])
    plane, line = Plane(source, target), Plane(source[:4], target[:4] * [1.0, 0.0] + [0.0, 6.0])
    places = np.array([[1.0, 1.0], [3.0, 2.5], [-9.0, 2.0], [2.0, 30.0], [4.5, 4.4]])
    found = {
        "curves": [curves(np.array([x, x])) for x in (-1.0, 0.5, 1.0, 2.0, 9.0)],
        "back": [curves.inverse(np.array([y, y])) for y in (6.0, 4.0, 3.0, 0.0, -9.0)],
        "plane": [plane(place) for place in places],
        "plane back": [plane.inverse(plane(place)) for place in places],
        "line": [line(place) for place in places],
        "line back": [line.inverse(line(place)) for place in places],
        "invertible": [plane.invertible, line.invertible],
    }
    assert_baseline("shadow/interpolation", found)


def test_motors_gains_and_forms_of_hands() -> None:
    motors, calibration = MotorMap.load(), SimulatedCalibration.from_package().joints
    backwards = motors.reverse(("FFJ0", "WRJ2"))
    lite = HandForm("left", tuple(name for name in DRIVEN_JOINTS if name[:2] not in ("LF", "WR")))
    table = GainTable()
    found = {
        "motors": [motors.numbers, motors.names, motors.sign, motors.from_joints, motors.limits_rad, motors.is_fitted],
        "backwards": [backwards.sign, backwards.driven],
        "ranges": drivable_range_rad(motors, calibration, 0.05),
        "gains": {name: plain(table.of(name)) for name in DRIVEN_JOINTS},
        "lite": [str(lite), lite.fingers, lite.long_fingers, lite.joints, lite.is_left, lite.handedness],
        "mirrored": str(lite.mirrored),
    }
    assert_baseline("shadow/motors", found)
