"""A calibration of another rig or device is refused also for an old recording, and a record says when it was made."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from gtsam import Pose3

from calibration.forearm.placement import ForearmCalibration
from calibration.store.admission import Installation, refuse_foreign
from calibration.store.store import CalibrationRecord, Covariance, new_record, write_record
from drivers.core.errors import ConfigurationError

HERE = Installation("lab", {"hand": "378"})


@pytest.fixture
def stored(tmp_path: Path) -> Path:
    parameters = ForearmCalibration.of(Pose3(), np.diag([1e-6] * 6))
    devices = {"hand": "378", "base": "B1"}
    path = tmp_path / "forearm.yaml"
    write_record(
        path, new_record("forearm", rig="lab", method="touch", verdict="PASS", parameters=parameters, devices=devices)
    )
    return path


@pytest.mark.parametrize("here", [HERE, Installation("lab", {}), Installation("lab", {"hand": "378", "base": "B1"})])
def test_a_calibration_of_this_rig_and_its_devices_is_taken(stored: Path, here: Installation) -> None:
    refuse_foreign(stored, here)


@pytest.mark.parametrize(
    ("here", "words"),
    [
        (Installation("attic", {"hand": "378"}), "belongs to rig lab, not to attic"),
        (Installation("lab", {"hand": "379"}), "belongs to the hand with serial number 378, not 379"),
        (Installation("lab", {"hand": "378", "base": "B2"}), "belongs to the base with serial number B1, not B2"),
    ],
)
def test_a_foreign_calibration_is_refused_by_name(stored: Path, here: Installation, words: str) -> None:
    with pytest.raises(ConfigurationError, match=words) as caught:
        refuse_foreign(stored, here)
    assert caught.value.where == str(stored)


def test_a_plain_file_does_not_say_whose_it_is(tmp_path: Path) -> None:
    plain = tmp_path / "forearm.yaml"
    plain.write_text("translation_m: [0, 0, 0]\n")
    refuse_foreign(plain, HERE)


@pytest.mark.parametrize(
    ("created", "words"),
    [("yesterday", "must be a time such as"), ("2026-11-21T09:30:00", "must include its time zone")],
)
def test_a_record_has_a_time_that_means_the_same_everywhere(created: str, words: str) -> None:
    parameters = ForearmCalibration.of(Pose3(), np.diag([1e-6] * 6))
    content = new_record("forearm", rig="lab", method="touch", verdict="PASS", parameters=parameters).model_dump()
    with pytest.raises(ValueError, match=words):
        CalibrationRecord.model_validate(content | {"created_utc": created})


def test_a_covariance_is_square() -> None:
    with pytest.raises(ValueError, match="the matrix is not square"):
        Covariance(of=("x", "y"), matrix=((1.0, 0.0), (0.0,)))
