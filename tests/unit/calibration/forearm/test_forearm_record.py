"""What is stored of a forearm calibration: millimetres and degrees that agree with the covariance and the poses."""

from __future__ import annotations

import numpy as np
import pytest
from gtsam import Pose3
from scipy.stats import chi2

from calibration.forearm.record import manual_record, record_of
from calibration.forearm.recordings import ForearmData
from calibration.forearm.touch_plan import plan_touches
from calibration.forearm.wizard import ForearmResult, solve_forearm
from calibration.steps.geometry import KnownGeometry, TableEdges
from calibration.store.admission import Installation
from calibration.store.store import CalibrationRecord
from tactile_lab.experiments.data.calibration_data import TrueRig, touches_of

HERE = Installation("lab", {"hand": "378", "base": "B1", "camera": "C1", "ft/FF": "FT1"})


@pytest.fixture(scope="module")
def result() -> ForearmResult:
    rng = np.random.default_rng(1)
    table = KnownGeometry(table=TableEdges(size_m=(1.0, 1.0), thickness_m=0.02, pressed_m=0.3))
    truth = TrueRig.draw(rng)
    return solve_forearm(ForearmData(touches=tuple(touches_of(plan_touches(table, ("FF", "MF"), 4), truth, rng))))


@pytest.fixture(scope="module")
def record(result: ForearmResult) -> CalibrationRecord:
    return record_of(result, HERE)


def half_axes(covariance: np.ndarray) -> np.ndarray:
    """Of the ellipsoid that holds three normal numbers 95 times in 100."""
    return np.sqrt(chi2.ppf(0.95, 3) * np.linalg.eigvalsh(covariance))


def test_the_stored_95_percent_region_is_that_of_the_stored_covariance(record: CalibrationRecord) -> None:
    covariance = np.array(record.covariance.matrix)
    np.testing.assert_allclose(record.residuals["region_95_mm"], 1000 * half_axes(covariance[3:, 3:]), rtol=1e-6)
    degrees = np.degrees(half_axes(covariance[:3, :3]))
    np.testing.assert_allclose(record.residuals["region_95_deg"], degrees, rtol=1e-6)


def test_the_stored_rms_is_that_of_the_stored_poses(result: ForearmResult, record: CalibrationRecord) -> None:
    poses = record.residuals["poses"]
    assert len(poses) == len(result.quality.residuals)
    for of in ("mm", "deg"):
        rms = np.sqrt(np.mean([pose[of] ** 2 for pose in poses]))
        assert record.residuals[f"rms_{of}"] == pytest.approx(rms)
    assert 0.01 < record.residuals["rms_mm"] < 3.0
    assert record.residuals["held_out_mm"] == pytest.approx(1000 * result.quality.held_out_m)
    assert record.residuals["held_out_deg"] == pytest.approx(np.degrees(result.quality.held_out_rad))
    assert record.residuals["leave_one_out_mm"] == pytest.approx(1000 * result.quality.repeat_m)
    assert record.residuals["leave_one_out_deg"] == pytest.approx(np.degrees(result.quality.repeat_rad))


def test_a_record_knows_the_devices_it_holds_for_and_what_else_was_found(
    result: ForearmResult, record: CalibrationRecord
) -> None:
    assert record.devices == {"hand": "378", "base": "B1", "camera": "C1"}
    assert record.verdict == ("PASS" if result.quality.passed else "FAIL")
    wrist = record.details["joint_offsets"]["WRJ2"]
    offset = result.solution.offsets["WRJ2"]
    assert wrist["deg"] == pytest.approx(np.degrees(offset.offset_rad))
    assert wrist["sigma_deg"] == pytest.approx(np.degrees(offset.sigma_rad))
    assert wrist["observable"] is True


def test_a_stated_pose_is_stored_with_the_uncertainty_as_stated() -> None:
    record = manual_record(Pose3(), 0.002, float(np.radians(0.5)), HERE)
    sigmas = np.sqrt(np.diag(record.covariance.matrix))
    np.testing.assert_allclose(sigmas, [*np.radians([0.5] * 3), 0.002, 0.002, 0.002])
    assert record.details == {"stated_sigma_mm": pytest.approx(2.0), "stated_sigma_deg": pytest.approx(0.5)}
    assert record.devices == {"hand": "378", "base": "B1"}
