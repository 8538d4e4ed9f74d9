from __future__ import annotations

import numpy as np
import pytest
from gtsam import Pose3

from calibration.fingertip.data import FingertipData, wrench_pose
from calibration.fingertip.plan import PALM_HEIGHT_m, PlannedFree, plan_wrenches
from calibration.fingertip.wizard import FingertipWizard
from calibration.forearm.touch_plan import pointing_vector
from calibration.steps.hand_chain import mount_T_link
from calibration.steps.observations import HandPose
from drivers.core.errors import ConfigurationError, DeviceError
from drivers.core.fingertip import load_fingertips
from drivers.positioner.settings import PositionerSettings
from drivers.shadow.closing.posture import TipEllipsoid
from tactile_lab.rigs.description import load_rig

PLAN = plan_wrenches("FF", 8)
JOINTS = pointing_vector("FF")


def base_q(planned):
    if isinstance(planned, PlannedFree):
        return planned.base_q(Pose3(), JOINTS)
    return planned.base_q(Pose3(), JOINTS, TipEllipsoid())


class Pretended:
    """A rig that takes every pose exactly, and feels what the weight and a press of 1 N do."""

    def __init__(self, failing: int = -1) -> None:
        self._failing = failing

    def measure(self, planned):
        if planned is PLAN[self._failing] and self._failing >= 0:
            raise DeviceError("met nothing", where="touch")
        rotation = mount_T_link(HandPose(base_q(planned), JOINTS), "FF")[:3, :3]
        up, tip = rotation[2], TipEllipsoid()
        axes, place = np.array(tip.semi_axes_m), np.array([0.0, 0.0, 0.004])
        weight = -0.08 * up
        point = np.array(tip.centre_distal_m) - axes**2 * up / np.linalg.norm(axes * up)
        free = np.concatenate([weight, np.cross(np.array([0, 0, 0.015]), weight)])
        press = np.concatenate([up, np.cross(point - place, up)])
        pressed = () if isinstance(planned, PlannedFree) else (wrench_pose(rotation, free + press),)
        return (wrench_pose(rotation, free), *pressed)


def wizard() -> FingertipWizard:
    before = load_fingertips(load_rig("sim").files["fingertips"])["FF"]
    return FingertipWizard(PLAN, FingertipData(rig="lab", finger="FF", free=(), presses=()), before)


def test_every_planned_pose_is_within_the_positioners_reach_with_the_palm_above_the_table():
    low, high = np.array(PositionerSettings().ranges).T
    for planned in PLAN:
        q = base_q(planned)
        assert (q >= low).all(), planned.instruction
        assert (q <= high).all(), planned.instruction
        palm = mount_T_link(HandPose(q, JOINTS), "palm")[:3, 3]
        assert palm[2] > 0.06
        if isinstance(planned, PlannedFree):
            np.testing.assert_allclose(palm, [0, 0, PALM_HEIGHT_m], atol=1e-9)


def test_all_steps_tell_mounting_and_weight():
    run = wizard()
    for step in run.steps():
        run.measure(step, Pretended())
    assert run.motion().ok
    found = run.solve()
    assert found.calibration.mass_kg == pytest.approx(0.08 / 9.80665, abs=1e-6)
    assert found.turned_rad < 1e-4
    np.testing.assert_allclose(found.calibration.com_distal_m, [0, 0, 0.019], atol=1e-6)


def test_steps_are_taken_back_and_what_is_missing_is_told():
    run, measurer = wizard(), Pretended(failing=1)
    steps = run.steps()
    run.measure(steps[0], measurer)
    with pytest.raises(DeviceError):
        run.measure(steps[1], measurer)
    assert len(run.measured.free) == 1
    assert not run.motion().ok
    assert any("presses 0" in words for words in run.motion().missing)
    with pytest.raises(ConfigurationError, match="1 untouched wrenches, but 6 are needed"):
        run.solve()
    assert run.undo() == 1
    assert run.undo() is None
