"""What a fingertip's calibration is judged by: each figure in its unit, and the verdict that is stored."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from calibration.fingertip.data import FingertipData
from calibration.fingertip.fit import FingertipFit
from calibration.fingertip.model import PARTS
from calibration.fingertip.record import fingertip_record, judge_fingertip
from calibration.store.admission import Installation
from drivers.core.fingertip import load_fingertips
from tactile_lab.rigs.description import load_rig

TIPS = load_fingertips(load_rig("sim").files["fingertips"])
GOOD = FingertipFit(
    calibration=TIPS["FF"],
    turned_rad=np.radians(5.0),
    covariance=np.zeros((13, 13)),
    variance_factor=1.0,
    rms_force_N=0.020,
    rms_lever_m=0.0005,
    tilt_rad=float(np.radians(10.0)),
)


def with_sigma(part: str, sigma: float) -> FingertipFit:
    """A fit of which a part has a standard deviation, all of it in the part's first number."""
    covariance = np.zeros((13, 13))
    first = PARTS[part].start
    covariance[first, first] = sigma**2
    return replace(GOOD, covariance=covariance)


FAULTS = [
    (replace(GOOD, rms_force_N=0.031), "left of the untouched forces", 31.0, "mN"),
    (replace(GOOD, rms_lever_m=0.0009), "left of the presses' levers", 0.9, "mm"),
    (replace(GOOD, tilt_rad=float(np.radians(31.0))), "forces from the plate's normal", 31.0, "deg"),
    (replace(GOOD, variance_factor=4.41), "noise relative to the stated", 2.1, ""),
    (with_sigma("mass", 0.0011), "sigma of the mass", 1.1, "g"),
    (with_sigma("com", 0.0021), "sigma of the centre of mass", 2.1, "mm"),
    (with_sigma("mounting", float(np.radians(3.1))), "sigma of the mounting", 3.1, "deg"),
    (with_sigma("centre", 0.0021), "sigma of the ellipsoid's centre", 2.1, "mm"),
]


def stored(fit: FingertipFit):
    data = FingertipData(rig="simulated-hand", finger="FF", serial="FT1", free=(), presses=())
    here = Installation("simulated-hand", {"ft/MF": "FT2", "hand": "378"})
    return fingertip_record(data, fit, TIPS, here)


def test_what_keeps_to_all_limits_passes_and_is_stored_with_its_figures() -> None:
    assert all(judgement.ok for judgement in judge_fingertip(GOOD))
    record = stored(GOOD)
    assert record.verdict == "PASS"
    assert record.residuals["left of the untouched forces"] == pytest.approx(20.0)
    assert record.residuals["left of the presses' levers"] == pytest.approx(0.5)
    assert record.details["turned_deg"] == pytest.approx(5.0)
    assert record.devices == {"ft/FF": "FT1", "ft/MF": "FT2"}


@pytest.mark.parametrize(("fit", "name", "value", "unit"), FAULTS)
def test_one_figure_beyond_its_limit_fails_in_its_own_unit(
    fit: FingertipFit, name: str, value: float, unit: str
) -> None:
    (failed,) = (judgement for judgement in judge_fingertip(fit) if not judgement.ok)
    assert (failed.name, failed.unit) == (name, unit)
    assert failed.value == pytest.approx(value)
    record = stored(fit)
    assert record.verdict == "FAIL"
    assert record.residuals[name] == pytest.approx(value)
