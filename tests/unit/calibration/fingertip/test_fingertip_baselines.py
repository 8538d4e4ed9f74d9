"""Whole results of small fixed calibrations of fingertips: mounting, weight, shape, figures and verdicts."""

from __future__ import annotations

import numpy as np
import pytest
from gtsam import Pose3, Rot3

from calibration.fingertip.data import FingertipData, wrench_pose
from calibration.fingertip.fit import fit_fingertip, wrench_motion
from calibration.fingertip.model import FingertipNoise, orientation_covariance
from calibration.fingertip.plan import PlannedTouch, plan_wrenches
from calibration.fingertip.record import fingertip_record, judge_fingertip
from calibration.store.admission import Installation
from drivers.core.errors import ConfigurationError
from drivers.shadow.closing.posture import TipEllipsoid
from drivers.shadow.model.hand_form import HandForm
from tactile_lab.experiments.runs.fingertip_runs import NOMINAL, draw, recording
from tests.support.baseline import assert_baseline
from tests.support.plain_values import plain

HERE = Installation("simulated", {"ft/MF": "7", "hand": "378"})


def drawn(seed: int = 3) -> tuple[FingertipData, np.random.Generator]:
    rng = np.random.default_rng(seed)
    truth = draw(rng)
    return recording(truth, rng, presses=6), rng


def test_a_fit_with_its_record() -> None:
    truth = draw(np.random.default_rng(3))
    data, _ = drawn()
    fit = fit_fingertip(data, NOMINAL)
    quiet = FingertipNoise(joint_deg=0.0, level_deg=0.02, drift_s=2.0, contact_mm=0.01, shape_mm=0.2)
    strict = fit_fingertip(data.model_copy(update={"side": "left"}), NOMINAL, quiet)
    found = {
        "fit": plain(fit),
        "strict": plain(strict),
        "off": fit.errors(truth),
        "holds": [fit.holds(truth), strict.holds(truth, "mass")],
        "judged": plain(judge_fingertip(strict)),
        "record": plain(fingertip_record(data, fit, {"MF": NOMINAL}, HERE, "noted")) | {"software": {}},
        "motion": plain(wrench_motion(data)),
        "little": plain(wrench_motion(data.model_copy(update={"free": data.free[:4], "presses": data.presses[:3]}))),
    }
    for part in ("created_utc", "valid_until_utc", "created", "covariance"):
        del found["record"][part]
    for one in ("fit", "strict"):
        del found[one]["covariance"]
    spreads = {"fit": fit.covariance, "strict": strict.covariance}
    found["sigmas"] = {name: np.sqrt(np.diag(spread)) for name, spread in spreads.items()}
    assert_baseline("calibration/fingertip", found, rtol=1e-3, atol=1e-9)
    correlations = {
        name: spread / np.outer(found["sigmas"][name], found["sigmas"][name]) for name, spread in spreads.items()
    }
    assert_baseline("calibration/fingertip_correlations", correlations, rtol=0.0, atol=0.02)


@pytest.mark.parametrize("side", ["right", "left"])
def test_planned_wrenches_and_what_the_joints_leave_open(side: str) -> None:
    form, joints, tip = HandForm(side), np.linspace(0.0, 0.3, 24), TipEllipsoid()
    mount = Pose3.Expmap(np.array([0.1, -0.2, 0.3, 0.05, 0.1, -0.2]))
    planned = [
        [
            each.instruction,
            each.base_q(mount, joints, tip) if isinstance(each, PlannedTouch) else each.base_q(mount, joints),
        ]
        for each in plan_wrenches("RF", 5, form)
    ]
    spreads = {finger: orientation_covariance(finger, FingertipNoise(), side) for finger in ("FF", "LF", "TH")}
    assert_baseline(f"calibration/wrenches_{side}", {"planned": planned, "spread": spreads}, atol=1e-12)


def turned(axes: list[list[float]]) -> tuple[np.ndarray, ...]:
    return tuple(Rot3.Expmap(np.array(axis)).matrix() for axis in axes)


def pressed(data: FingertipData, angles: list[tuple[float, float]]) -> FingertipData:
    """The untouched wrenches of some data, with presses of 1 N straight up at other orientations."""
    rotations = turned([[np.pi, 0, 0]] * len(angles))
    leaned = [
        rotation @ Rot3.Rx(a).matrix() @ Rot3.Ry(b).matrix() for rotation, (a, b) in zip(rotations, angles, strict=True)
    ]
    poses = tuple(wrench_pose(rotation, np.append(rotation[2], np.zeros(3)), 1.0) for rotation in leaned)
    return data.model_copy(update={"presses": poses})


def test_presses_rolled_in_one_plane_are_enough_and_presses_all_alike_are_not() -> None:
    data, _ = drawn()
    with pytest.raises(ConfigurationError, match="the presses are all in nearly the same orientation"):
        fit_fingertip(pressed(data, [(0.01 * n, 0.0) for n in range(8)]), NOMINAL)
    with pytest.raises(ConfigurationError) as refused:  # they get past the orientations, to what the forces say
        fit_fingertip(pressed(data, [(0.2 * n - 0.7, 0.0) for n in range(8)]), NOMINAL)
    assert "orientation" not in str(refused.value)
