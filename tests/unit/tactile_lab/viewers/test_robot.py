"""The robot for other programs: its frames are the kinematics' own, and its description opens elsewhere."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import yourdfpy
from gtsam import Pose3

from drivers.positioner.kinematics import mount_T_forearm
from drivers.shadow.model.hand_form import RIGHT_HAND, HandForm
from drivers.shadow.model.kinematics import JOINTS, forearm_T_palm, palm_T_distal
from drivers.shadow.model.motors import DRIVEN_JOINTS
from tactile_lab.viewers.parts import CapsulePart, EllipsoidPart, rotation_onto
from tactile_lab.viewers.robot import MOUNT, WORLD, Robot
from tactile_lab.viewers.urdf import capsule_of, urdf
from tests.support import told_session

LITE = HandForm("right", tuple(name for name in DRIVEN_JOINTS if name[:2] not in ("LF", "WR") and name != "THJ3"))
FORMS = {"right": RIGHT_HAND, "left": RIGHT_HAND.mirrored, "lite": LITE}


def poses(robot: Robot, positions: dict[str, float]) -> dict[str, Pose3]:
    """Every frame in the world."""
    above = {one.child: one for one in [*robot.fixed(), *robot.moving(positions)]}

    def pose(name: str) -> Pose3:
        return Pose3() if name == WORLD else pose(above[name].parent) * above[name].parent_T_child

    return {name: pose(name) for name in above}


@pytest.mark.parametrize("name", FORMS)
def test_every_frame_is_where_the_kinematics_have_it(name: str) -> None:
    form = FORMS[name]
    robot, (joints, base) = told_session.robot(form), told_session.posture(form)
    found = poses(robot, robot.positions(joints, base))
    world_T_palm = found[MOUNT] * mount_T_forearm(base) * forearm_T_palm(joints, form.side)
    expected = {f"{robot.prefix}palm": world_T_palm}
    for finger, palm_T_tip in palm_T_distal(joints, form.side).items():
        if finger in form.fingers:
            expected[robot.distal_link(finger)] = world_T_palm * palm_T_tip
    for frame, pose in expected.items():
        np.testing.assert_allclose(found[frame].matrix(), pose.matrix(), atol=1e-12, err_msg=frame)


@pytest.mark.parametrize("name", FORMS)
def test_the_description_opens_elsewhere_with_the_same_frames(name: str, tmp_path: Path) -> None:
    form = FORMS[name]
    robot, (joints, base) = told_session.robot(form), told_session.posture(form)
    positions = robot.positions(joints, base)
    (tmp_path / "robot.urdf").write_text(urdf(robot))
    opened = yourdfpy.URDF.load(str(tmp_path / "robot.urdf"), load_meshes=False)
    assert opened.validate()
    assert set(opened.actuated_joint_names) == set(positions)
    opened.update_cfg([positions[joint] for joint in opened.actuated_joint_names])
    for frame, pose in poses(robot, positions).items():
        np.testing.assert_allclose(opened.get_transform(frame, WORLD), pose.matrix(), atol=1e-7, err_msg=frame)


def test_joints_and_links_have_the_names_of_shadow_s_own_description(lab_data: Path) -> None:
    theirs = yourdfpy.URDF.load(str(lab_data / "shadow_models" / "shadowhand_motor.urdf"), load_meshes=False)
    ours = told_session.robot()
    named = {joint.name: joint.child for joint in ours.joints}
    for name in JOINTS:
        assert theirs.joint_map[f"rh_{name}"].child == named[f"rh_{name}"]
        assert theirs.joint_map[f"rh_{name}"].parent == next(j.parent for j in ours.joints if j.name == f"rh_{name}")


def test_a_lite_hand_has_no_links_of_fingers_that_it_lacks() -> None:
    robot = told_session.robot(LITE)
    assert not [joint for joint in robot.joints if "lf" in joint.child]
    assert not [link for link in robot.parts if "lf" in link]
    assert {"rh_WRJ1", "rh_WRJ2", "rh_THJ3"} <= {joint.name for joint in robot.joints if joint.kind == "fixed"}


def test_an_ellipsoid_becomes_the_capsule_along_its_longest_axis() -> None:
    capsule = capsule_of(EllipsoidPart(Pose3(), (0.01, 0.03, 0.02)))
    assert isinstance(capsule, CapsulePart)
    assert capsule.radius_m == pytest.approx(0.015)
    assert capsule.length_m + 2 * capsule.radius_m == pytest.approx(0.06)
    np.testing.assert_allclose(np.abs(capsule.link_T_part.rotation().matrix()[:, 2]), [0, 1, 0])


@pytest.mark.parametrize("axis", [0, 1, 2])
def test_a_rotation_onto_a_direction_is_one_and_has_it_as_the_column(axis: int) -> None:
    direction = np.array([0.6, 0.0, -0.8])
    rotation = rotation_onto(direction, axis)
    np.testing.assert_allclose(rotation @ rotation.T, np.eye(3), atol=1e-12)
    assert np.linalg.det(rotation) == pytest.approx(1.0)
    np.testing.assert_allclose(rotation[:, axis], direction)
