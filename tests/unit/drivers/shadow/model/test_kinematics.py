from __future__ import annotations

import json
import xml.etree.ElementTree as ElementTree
from pathlib import Path

import numpy as np
import pytest
from gtsam import Pose3, Rot3
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from drivers.core.contacts import FINGERS, Array
from drivers.core.errors import ConfigurationError
from drivers.shadow.model import kinematics
from drivers.shadow.model.kinematics import JOINT_INDEX, JOINT_TABLE, JOINTS, JOINT_LIMITS_rad, joint_vector

within_limits = st.lists(st.floats(0, 1), min_size=24, max_size=24).map(
    lambda share: JOINT_LIMITS_rad[:, 0] + np.array(share) * np.ptp(JOINT_LIMITS_rad, axis=1)
)


class Urdf:
    """The tree of a URDF, evaluated joint by joint with scipy's rotations: an independent reference."""

    def __init__(self, path: Path) -> None:
        joints = [joint for joint in ElementTree.parse(path).iter("joint") if "type" in joint.attrib]
        self.joint_of = {joint.find("child").attrib["link"]: joint for joint in joints}

    def link_in(self, base: str, link: str, joints_rad: dict[str, float]) -> Array:
        if link == base:
            return np.eye(4)
        joint = self.joint_of[link]
        return self.link_in(base, joint.find("parent").attrib["link"], joints_rad) @ self._joint(joint, joints_rad)

    def _joint(self, joint: ElementTree.Element, joints_rad: dict[str, float]) -> Array:
        origin, axis = joint.find("origin"), joint.find("axis")
        matrix = np.eye(4)
        if origin is not None:
            matrix[:3, 3] = self._numbers(origin, "xyz")
            matrix[:3, :3] = Rotation.from_euler("xyz", self._numbers(origin, "rpy")).as_matrix()
        if axis is not None and joint.attrib["type"] == "revolute":
            unit = np.array(self._numbers(axis, "xyz"))
            angle = joints_rad[joint.attrib["name"].removeprefix("rh_")]
            matrix[:3, :3] = matrix[:3, :3] @ Rotation.from_rotvec(unit / np.linalg.norm(unit) * angle).as_matrix()
        return matrix

    def limits(self) -> dict[str, tuple[float, float]]:
        return {
            joint.attrib["name"].removeprefix("rh_"): (float(limit.attrib["lower"]), float(limit.attrib["upper"]))
            for joint in self.joint_of.values()
            if (limit := joint.find("limit")) is not None
        }

    @staticmethod
    def _numbers(element: ElementTree.Element, key: str) -> list[float]:
        return [float(text) for text in element.attrib.get(key, "0 0 0").split()]


@pytest.fixture(scope="module")
def urdf(lab_data: Path) -> Urdf:
    return Urdf(lab_data / "shadow_models" / "shadowhand_motor.urdf")


TIP_OFFSET_m = {"FF": 0.026, "MF": 0.026, "RF": 0.026, "LF": 0.026, "TH": 0.0275}
"""The model's nominal fingertip along z of the distal frame, from the J1 axis."""


def palm_T_tip(joints_rad: np.ndarray) -> dict[str, Pose3]:
    """The nominal fingertips: the distal frames, moved out to the tip."""
    distals = kinematics.palm_T_distal(joints_rad)
    return {finger: distals[finger] * Pose3(Rot3(), np.array([0.0, 0.0, TIP_OFFSET_m[finger]])) for finger in FINGERS}


@pytest.mark.parametrize("pose", ["zero", "at_q"])
def test_tips_match_the_golden_vectors_in_palm_and_forearm(lab_data: Path, pose: str) -> None:
    golden = json.loads((lab_data / "golden_vectors.json").read_text())["fk_right_hand"]
    joints_rad = joint_vector(golden["q"] if pose == "at_q" else {})
    tips, forearm_T_palm = palm_T_tip(joints_rad), kinematics.forearm_T_palm(joints_rad)
    for finger in FINGERS:
        in_palm_m, in_forearm_m = golden[pose][f"{finger.lower()}tip"]
        np.testing.assert_allclose(tips[finger].translation(), in_palm_m, atol=1e-6)
        np.testing.assert_allclose((forearm_T_palm * tips[finger]).translation(), in_forearm_m, atol=1e-6)


@settings(max_examples=30, deadline=None, derandomize=True)
@given(joints_rad=within_limits)
def test_frames_match_the_published_model(urdf: Urdf, joints_rad: Array) -> None:
    named = dict(zip(JOINTS, joints_rad, strict=True))
    distals = kinematics.palm_T_distal_matrices(joints_rad)
    for finger, distal in zip(FINGERS, distals, strict=True):
        np.testing.assert_allclose(distal, urdf.link_in("rh_palm", f"rh_{finger.lower()}distal", named), atol=2e-6)
    palm = kinematics.forearm_T_palm_matrix(joints_rad)
    np.testing.assert_allclose(palm, urdf.link_in("rh_forearm", "rh_palm", named), atol=1e-9)


def test_limits_are_the_published_ones_but_for_the_documented_lower_ends(urdf: Urdf) -> None:
    extended = {"FFJ3", "MFJ3", "RFJ3", "LFJ3", "THJ1"}
    published = urdf.limits()
    for name, (lower, upper) in zip(JOINTS, JOINT_LIMITS_rad, strict=True):
        expected = np.radians(-15) if name in extended else published[name][0]
        assert lower == pytest.approx(expected, abs=2e-3), name
        assert upper == pytest.approx(published[name][1], abs=2e-3), name


def test_joint_order_is_finger_by_finger_then_wrist() -> None:
    assert JOINTS[:4] == ("FFJ1", "FFJ2", "FFJ3", "FFJ4")
    assert JOINTS[12:] == (
        "LFJ1",
        "LFJ2",
        "LFJ3",
        "LFJ4",
        "LFJ5",
        "THJ1",
        "THJ2",
        "THJ3",
        "THJ4",
        "THJ5",
        "WRJ1",
        "WRJ2",
    )
    assert len(JOINTS) == 24
    assert [JOINT_INDEX[joint.name] for joint in JOINT_TABLE] == list(range(24))


@settings(max_examples=20, deadline=None, derandomize=True)
@given(joints_rad=within_limits)
def test_pose_objects_and_batches_agree_with_single_matrices(joints_rad: Array) -> None:
    single = kinematics.palm_T_distal_matrices(joints_rad)
    batch = kinematics.palm_T_distal_matrices(np.array([[joints_rad], [np.zeros(24)]]))
    assert batch.shape == (2, 1, 5, 4, 4)
    np.testing.assert_allclose(batch[0, 0], single, atol=1e-15)
    for finger, matrix in zip(FINGERS, single, strict=True):
        np.testing.assert_allclose(kinematics.palm_T_distal(joints_rad)[finger].matrix(), matrix, atol=1e-15)
    rotations = single[:, :3, :3]
    np.testing.assert_allclose(rotations @ rotations.transpose(0, 2, 1), np.tile(np.eye(3), (5, 1, 1)), atol=1e-12)


def test_flexion_moves_every_long_fingertip_to_the_palm_side() -> None:
    flexed = palm_T_tip(joint_vector({f"{finger}J3": 0.5 for finger in FINGERS[:4]}))
    assert all(flexed[finger].y() < -0.01 for finger in FINGERS[:4])


def test_link_matrices_compose_to_the_distal_frame() -> None:
    joints_rad = joint_vector({"THJ1": 0.5, "THJ2": 0.2, "THJ3": 0.1, "THJ4": 0.9, "THJ5": 0.4})
    links = kinematics.link_T_matrices(joints_rad)
    chain = np.linalg.multi_dot([links[JOINT_INDEX[f"THJ{number}"]] for number in (5, 4, 3, 2, 1)])
    np.testing.assert_allclose(chain, kinematics.palm_T_distal_matrices(joints_rad)[4], atol=1e-15)


def test_an_unknown_joint_name_is_refused_by_name() -> None:
    with pytest.raises(ConfigurationError, match="FFJ9"):
        joint_vector({"FFJ9": 0.1})


def test_a_left_hand_is_the_mirror_image_joint_by_joint() -> None:
    joints_rad = np.random.default_rng(3).uniform(*JOINT_LIMITS_rad.T)
    mirror = np.diag([-1.0, 1.0, 1.0, 1.0])
    expected = mirror @ kinematics.palm_T_distal_matrices(joints_rad) @ mirror
    np.testing.assert_allclose(kinematics.palm_T_distal_matrices(joints_rad, "left"), expected, atol=1e-15)
    forearm = mirror @ kinematics.forearm_T_palm_matrix(joints_rad) @ mirror
    np.testing.assert_allclose(kinematics.forearm_T_palm_matrix(joints_rad, "left"), forearm, atol=1e-15)
    for joint, mirrored in zip(JOINT_TABLE, kinematics.joint_table("left"), strict=True):
        angle = joints_rad[JOINT_INDEX[joint.name]]
        own, other = (sum_of_terms(each, angle) for each in (joint, mirrored))
        np.testing.assert_allclose(other, mirror @ own @ mirror, atol=1e-15)


def sum_of_terms(joint: kinematics.Joint, angle: float) -> Array:
    constant, sine, cosine = kinematics._rodrigues_terms(joint)
    return np.asarray(constant + np.sin(angle) * sine + np.cos(angle) * cosine)
