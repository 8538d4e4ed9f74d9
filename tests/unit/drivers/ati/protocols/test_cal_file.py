"""ATI calibration files: from gauge readings to a wrench (protocols: ATI calibration files)."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from drivers.ati.protocols import cal_file
from drivers.core.errors import ConfigurationError

AXIS = '<Axis Name="{n}" values="{v}" max="12" scale="2"/>'
SENSOR = """<FTSensor Serial="FT1" Family="DAQ" CalFileVersion="1.0">
<Calibration PartNumber="SI-12-0.12" ForceUnits="N" TorqueUnits="{torque}" DistUnits="{length}">{axes}
<BasicTransform Dx="0" Dy="0" Dz="{dz}" Rx="{rx}" Ry="0" Rz="0"/></Calibration></FTSensor>"""


def sensor_text(*, torque: str = "N-mm", length: str = "mm", dz: str = "6", rx: str = "0") -> str:
    rows = 2 * np.eye(6)
    axes = "".join(AXIS.format(n=n, v=" ".join(map(str, row))) for n, row in zip(cal_file.AXES, rows, strict=True))
    return SENSOR.format(axes=axes, torque=torque, length=length, dz=dz, rx=rx)


def write(path: Path, text: str) -> Path:
    path.write_text(text, encoding="utf-8")
    return path


@pytest.mark.parametrize("name", ["ati_cal/FT14048.cal", "finger_manipulation/FT44297.cal"])
def test_a_real_file_gives_its_own_user_rows(lab_data: Path, name: str) -> None:
    calibration = cal_file.load(lab_data / name)
    assert calibration.user_rows is not None
    np.testing.assert_allclose(calibration.matrix, calibration.user_rows, rtol=0, atol=2e-5)
    assert calibration.serial == Path(name).stem


def test_a_real_file_of_version_1_0_loads_without_user_rows(lab_data: Path) -> None:
    calibration = cal_file.load(lab_data / "ati_cal" / "FT11564.cal")
    assert calibration.user_rows is None
    assert 12 < np.linalg.cond(calibration.matrix) < 13
    np.testing.assert_allclose(calibration.ranges_SI, [50, 50, 70, 0.5, 0.5, 0.5])


def test_a_real_net_box_file_loads(lab_data: Path) -> None:
    calibration = cal_file.load(lab_data / "ati_cal" / "FT10484_Net.xml")
    assert (calibration.serial, calibration.family, calibration.part_number) == ("FT10484", "Net F/T", "SI-580-20")
    assert calibration.working_matrix[2, 0] == pytest.approx(0.0376920270770521)
    np.testing.assert_allclose(calibration.ranges_SI, [580, 580, 1160, 20, 20, 20])


def test_published_working_matrices_have_the_same_structure(lab_data: Path) -> None:
    """A Nano17's three axial gauges carry Fz, whichever sensor it is: the loaded rows agree with published ones."""
    published = json.loads((lab_data / "ati_cal" / "nano17_SI-12-0.12_working_matrices.json").read_text())
    loaded = cal_file.load(lab_data / "ati_cal" / "FT14048.cal").matrix
    for matrix in (np.array(published["FT32918"]), np.array(published["FT38799"])):
        assert np.corrcoef((matrix / np.abs(matrix).max(1)[:, None]).ravel(), loaded.ravel())[0, 1] > 0.5
        cosine = np.sum(matrix * loaded, 1) / np.linalg.norm(matrix, axis=1) / np.linalg.norm(loaded, axis=1)
        assert np.all(cosine > 0.99)


def test_volts_become_newtons_and_newton_metres(tmp_path: Path) -> None:
    calibration = cal_file.load(write(tmp_path / "a.cal", sensor_text()))
    wrench = calibration.working_matrix @ np.array([1.0, 0.0, 0.0, 0.0, 0.0, 0.0])
    np.testing.assert_allclose(wrench, [1.0, 0.0, 0.0, 0.0, -0.006, 0.0])


@pytest.mark.parametrize(("torque", "length", "dz"), [("N-mm", "mm", "6"), ("N-m", "m", "0.006"), ("N-m", "mm", "6")])
def test_the_displacement_is_converted_to_the_torque_unit(tmp_path: Path, torque: str, length: str, dz: str) -> None:
    calibration = cal_file.load(write(tmp_path / "a.cal", sensor_text(torque=torque, length=length, dz=dz)))
    push = calibration.working_matrix @ np.array([1.0, 0, 0, 0, 0, 0])
    np.testing.assert_allclose(push, [1, 0, 0, 0, -0.006, 0])


def test_a_rotated_tool_frame_turns_force_and_torque(tmp_path: Path) -> None:
    calibration = cal_file.load(write(tmp_path / "a.cal", sensor_text(rx="90")))
    push = calibration.working_matrix @ np.array(
        [0, 1.0, 0, 0, 0, 0]
    )  # along y: along -z of a tool turned by +90 about x
    np.testing.assert_allclose(push, [0, 0, -1, 0.006, 0, 0], atol=1e-12)


def test_temperature_terms_are_read_where_the_file_has_them(tmp_path: Path) -> None:
    terms = "<BiasSlope values='1 2 3 4 5 6'/><GainSlope values='0 0 0 0 0 1'/><Thermistor value='2.5'/></Calibration>"
    calibration = cal_file.load(write(tmp_path / "a.cal", sensor_text().replace("</Calibration>", terms)))
    assert calibration.temperature is not None
    corrected = calibration.temperature.correct(np.zeros(6), np.array(2.6))
    np.testing.assert_allclose(corrected, [0.1, 0.2, 0.3, 0.4, 0.5, 0.6 / 0.9])
    assert cal_file.load(write(tmp_path / "b.cal", sensor_text())).temperature is None


@pytest.mark.parametrize(
    ("text", "complaint"),
    [
        ("<!DOCTYPE a [<!ENTITY b 'c'>]><FTSensor/>", "document type"),
        ("<other/>", "not an ATI calibration"),
        ("<FTSensor", "not valid XML"),
        ("<FTSensor Serial='1'/>", "Calibration is missing"),
        (sensor_text().replace('"6"', '"nan"'), "finite"),
        (sensor_text().replace('DistUnits="mm"', 'DistUnits="furlong"'), "furlong"),
        (sensor_text(torque="ounce"), "ounce"),
        (sensor_text().replace("2.0 0.0", "2.0"), "numbers instead of 6"),
        (sensor_text().replace('Name="Tz"', 'Name="Tw"'), "Tz"),
    ],
)
def test_a_damaged_file_is_refused_with_the_reason(tmp_path: Path, text: str, complaint: str) -> None:
    with pytest.raises(ConfigurationError, match=complaint):
        cal_file.load(write(tmp_path / "bad.cal", text))


def test_a_document_type_hidden_in_utf_16_is_refused(tmp_path: Path) -> None:
    (tmp_path / "bad.cal").write_bytes("<!DOCTYPE a []><FTSensor/>".encode("utf-16"))
    with pytest.raises(ConfigurationError, match="document type"):
        cal_file.load(tmp_path / "bad.cal")


def test_a_missing_or_huge_file_is_refused(tmp_path: Path) -> None:
    with pytest.raises(ConfigurationError, match="cannot be read"):
        cal_file.load(tmp_path / "none.cal")
    with pytest.raises(ConfigurationError, match="too large"):
        cal_file.load(write(tmp_path / "big.cal", " " * (1 << 20) + "<a/>"))
