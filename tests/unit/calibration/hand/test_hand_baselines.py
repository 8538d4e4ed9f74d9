"""Whole results of small fixed calibrations of joints: by touches of a block, and by known poses."""

from __future__ import annotations

import numpy as np
import pytest
from gtsam import Pose3

from calibration.forearm.placement import ForearmCalibration
from calibration.hand.block_plan import plan_block
from calibration.hand.block_problem import BlockSettings, block_motion, solve_block
from calibration.hand.joints import JointLimits, JointPose, from_poses, joints_record, judge_joints
from calibration.hand.pose_steps import PlannedPose
from calibration.steps.geometry import Block
from calibration.steps.hand_chain import HandPose, joints_of, link_motion, mount_T_link
from calibration.store.admission import Installation
from drivers.core.fingertip import RigidTransform
from drivers.shadow.closing.posture import TipEllipsoid
from drivers.shadow.model.hand_form import HandForm
from tactile_lab.experiments.data.calibration_data import TrueRig, touches_of
from tactile_lab.rigs.description import load_rig
from tests.support.baseline import assert_baseline
from tests.support.plain_values import plain

BLOCK = Block(
    size_m=(0.12, 0.06, 0.06), world_T_block=RigidTransform(translation_m=(0.02, 0.01, 0.03), rpy_rad=(0.0, 0.0, 0.2))
)
SPREAD = np.diag(np.repeat([np.radians(0.1), 2e-4], 3) ** 2)


@pytest.mark.parametrize("side", ["right", "left"])
def test_touches_of_a_block(side: str) -> None:
    form, rng = HandForm(side), np.random.default_rng(8)
    plan = plan_block(BLOCK, ("FF", "LF"), 1, form)
    rig = TrueRig.draw(rng, place_m=0.0, turn_rad=0.0)
    touches = touches_of(plan, rig, rng)
    forearm = ForearmCalibration.of(Pose3.Expmap(np.full(6, 1e-3)), SPREAD)
    joints, tip = np.linspace(0.0, 0.2, 24), TipEllipsoid()
    found = {
        "plan": [[each.instruction, each.flexion_rad, each.base_q(Pose3(), joints, tip)] for each in plan],
        "result": plain(solve_block(touches, forearm, BlockSettings())),
        "motion": plain(block_motion(touches[:3], BlockSettings())),
    }
    assert_baseline(f"calibration/block_{side}", found, rtol=1e-5, atol=1e-12)


@pytest.mark.parametrize("side", ["right", "left"])
def test_links_and_how_they_move_with_the_joints(side: str) -> None:
    form = HandForm(side)
    pose = HandPose(np.array([0.1, -0.2, 0.3, 0.2, -0.1, 0.3]), np.linspace(-0.1, 0.6, 24), form)
    found = {}
    for link in ("palm", "FF", "LF", "TH"):
        joints = joints_of([link], form)
        motion = link_motion(pose, link, joints, np.linspace(0.0, 0.01, len(joints)))
        moved = motion.at(np.full(len(joints), 0.02))
        found[link] = [list(joints), mount_T_link(pose, link)[:3], motion.derivatives[:, :3], moved[:3]]
    assert_baseline(f"calibration/links_{side}", found, rtol=1e-5, atol=1e-9)


def test_known_poses() -> None:
    angles: list[dict[str, tuple[float, float]]] = [
        {"FFJ3": (0.0, 1.0), "FFJ2": (10.0, 11.0)},
        {"FFJ3": (45.0, 44.0), "WRJ1": (5.0, 5.2)},
        {"FFJ3": (90.0, 88.5), "FFJ2": (12.0, 15.0), "THJ1": (30.0, 28.0)},
        {"FFJ3": (20.0, 20.1), "FFJ2": (14.0, 15.4), "THJ1": (10.0, 9.0)},
    ]
    poses = [
        JointPose(
            name="jig" if number == 0 else "",
            known_deg={joint: known for joint, (known, _) in each.items()},
            measured_deg={joint: measured for joint, (_, measured) in each.items()},
        )
        for number, each in enumerate(angles)
    ]
    corrections = from_poses(poses)
    record = joints_record(
        load_rig("sim").files["joints"], corrections, "jig", Installation("sim", {"hand": "1", "base": "2"}), "noted"
    )
    found = {
        "told": [PlannedPose(pose).instruction for pose in poses],
        "corrections": plain(corrections),
        "judged": judge_joints(corrections),
        "strict": judge_joints(corrections, JointLimits(left_deg=0.1, sigma_deg=0.1, poses=4)),
        "record": [record.verdict, record.residuals, record.details, record.limits, record.devices, record.parameters],
    }
    assert_baseline("calibration/known_poses", found)
