"""Joint offsets from several fingers on one block, by kinematics alone: joints of the fingers off by 0.6 degrees."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from gtsam import Pose3

from calibration.forearm.placement import ForearmCalibration
from calibration.forearm.recordings import ForearmData, save_data
from calibration.forearm.touch_problem import TouchNoise
from calibration.hand.block_plan import FINGERS, CLEAR_m, load_block, plan_block
from calibration.hand.block_problem import BlockResult, BlockSettings, BlockWizard, is_of_block, solve_block
from calibration.steps.geometry import Block
from calibration.steps.hand_chain import WRIST, mount_T_link
from calibration.steps.observations import HandPose, Touch
from drivers.core.errors import ConfigurationError, DeviceError
from drivers.core.fingertip import RigidTransform
from drivers.positioner.settings import PositionerSettings
from drivers.shadow.closing.posture import TipEllipsoid
from drivers.shadow.model.kinematics import JOINT_INDEX
from sessions.recording.recorder import NullTraffic
from tactile_lab.experiments.data import calibration_data
from tactile_lab.experiments.data.calibration_data import TrueRig, touches_of
from tactile_lab.rigs.description import load_rig
from tactile_lab.workflow.calibrating_joints import JointRequest, JointSettings, from_file, joint_wizard

BLOCK = Block(size_m=(0.12, 0.06, 0.06), world_T_block=RigidTransform(translation_m=(0.0, 0.0, 0.03)))
PLAN = plan_block(BLOCK)
SPREAD = np.diag(np.repeat([np.radians(0.1), 2e-4], 3) ** 2)


def solved(seed: int) -> tuple[BlockResult, TrueRig]:
    touches, rig = touched(seed)
    rng = np.random.default_rng(1000 + seed)
    known = rig.world_T_mount * Pose3.Expmap(np.sqrt(np.diag(SPREAD)) * rng.standard_normal(6))
    return solve_block(touches, ForearmCalibration.of(known, SPREAD), BlockSettings()), rig


def touched(seed: int, exact: bool = False) -> tuple[tuple[Touch, ...], TrueRig]:
    rng = np.random.default_rng(seed)
    rig = TrueRig.draw(rng, place_m=0.0 if exact else 0.02, turn_rad=0.0 if exact else 0.03)
    rig.bias_rad[[JOINT_INDEX[joint] for joint in WRIST]] = 0.0
    return tuple(touches_of(PLAN, rig, rng)), rig


@pytest.fixture(autouse=True)
def _precise_contacts(monkeypatch: pytest.MonkeyPatch) -> None:
    """Of a force fingertip, averaged over a press, 0.2 mm."""
    monkeypatch.setattr(calibration_data, "CONTACT_SIGMA_m", 2e-4)


def test_offsets_are_told_or_named_and_their_sigmas_tell_so() -> None:
    off, told = [], []
    for seed in range(4):
        found, rig = solved(seed)
        assert found.passed, [str(judgement) for judgement in found.judgements]
        told += [joint for joint, offset in found.offsets.items() if offset.observable]
        off += [
            (offset.offset_rad - rig.bias_rad[JOINT_INDEX[joint]]) / offset.sigma_rad
            for joint, offset in found.offsets.items()
        ]
    assert {joint for joint in told if told.count(joint) == 4} == {
        f"{finger}{joint}" for finger in FINGERS for joint in ("J4", "J3")
    }
    assert not {f"{finger}J1" for finger in FINGERS} & set(told)
    assert 0.5 < np.sqrt(np.mean(np.square(off))) < 1.4
    assert np.abs(off).max() < 4.0


def test_every_touch_is_in_reach_with_palm_and_forearm_clear_of_the_table() -> None:
    low, high = np.array(PositionerSettings().ranges).T
    for planned in PLAN:
        q = planned.base_q(Pose3(), planned.joints_rad, TipEllipsoid())
        assert (q >= low).all(), planned.instruction
        assert (q <= high).all(), planned.instruction
        assert mount_T_link(HandPose(q, planned.joints_rad), "palm")[2, 3] > CLEAR_m - 1e-9
    assert {planned.flexion_rad for planned in PLAN if planned.finger == "FF"} == {p.flexion_rad for p in PLAN}


def test_touches_that_do_not_fit_fail_and_too_few_are_refused() -> None:
    touches, rig = touched(0)
    calibration = ForearmCalibration.of(rig.world_T_mount * Pose3.Expmap(np.full(6, 0.006)), SPREAD)
    assert not solve_block(touches, calibration, BlockSettings()).passed
    with pytest.raises(ConfigurationError, match="press with two fingers or more"):
        solve_block(touches[: len(touches) // 3], calibration, BlockSettings())
    faces = [touch for touch in touches if touch.target.name != "block +x"]
    with pytest.raises(ConfigurationError, match="press the top and all four sides"):
        solve_block(faces, calibration, BlockSettings())


def test_recorded_touches_of_a_block_are_told_from_others_and_solved(tmp_path: Path) -> None:
    touches, rig = touched(2, exact=True)
    path = tmp_path / "touches.json"
    save_data(path, ForearmData("simulated-hand", touches=touches))
    found = from_file(path, load_rig("sim"), JointSettings())
    assert is_of_block(touches)
    assert (found.method, found.trusted) == ("contacts of a block", True)
    assert {"FFJ3", "FFJ4", "MFJ3", "MFJ4"} <= set(found.corrections) < set(found.offsets)
    for joint, correction in found.corrections.items():
        true_deg = -np.degrees(rig.bias_rad[JOINT_INDEX[joint]])
        assert abs(correction.shift_deg - true_deg) < 3.0 * correction.sigma_deg


def test_the_wizard_repeats_and_tells_what_is_missing() -> None:
    touches, _ = touched(0)
    wizard, first = BlockWizard(PLAN), PLAN[0]

    class EmulatorHost:
        def measure(self, planned: object) -> Touch:
            if planned is not first:
                raise DeviceError("met nothing", where="touch")
            return touches[0]

    steps = wizard.steps()
    wizard.measure(steps[0], EmulatorHost())
    with pytest.raises(DeviceError):
        wizard.measure(steps[1], EmulatorHost())
    assert wizard.touches == (touches[0],)
    assert any("fingers 1 of 2" in words for words in wizard.motion().missing)


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("block: {size_m: [0.1, 0.1, 0.1], world_T_block: {translation_m: [0, 0, 0.05]}}", "block is 120 x 60 x 60 mm"),
        ("table: {size_m: [1, 1], thickness_m: 0.02}", "does not describe a block"),
    ],
)
def test_blocks_that_do_not_fit_are_named(tmp_path: Path, text: str, words: str) -> None:
    path = tmp_path / "block.yaml"
    path.write_text(text)
    with pytest.raises(ConfigurationError, match=words), joint_wizard(JointRequest("sim", path), NullTraffic()):
        pass


def test_fingers_that_can_not_press_alone_are_named() -> None:
    with (
        pytest.raises(ConfigurationError, match="TH cannot press alone"),
        joint_wizard(JointRequest("sim", fingers=("TH",)), NullTraffic()),
    ):
        pass


def test_the_shipped_rig_has_its_block() -> None:
    assert load_block(load_rig("sim").files["block"]).size_m == BLOCK.size_m
    assert TouchNoise().joint_offset_rad == pytest.approx(np.radians(0.6))
