"""Learned contact normals: on a synthetic finger, as a file, in the device, and on the recorded presses."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

from calibration.fingertip.normals import NormalsCalibration, calibrate_normals, normals_record
from calibration.store.store import write_record
from drivers.biotac.biotac import BioTac, BioTacCalibration
from drivers.biotac.electrodes import electrode_layout
from drivers.biotac.learned_normal import LearnedNormals, Presses, Spread, load_normals
from drivers.biotac.normal_training import MethodErrors, angles_rad, compare_methods, fitted_spread, train
from drivers.biotac.press_recording import PressRecording, read_presses
from drivers.core.configuration import load
from drivers.core.contacts import Array
from drivers.core.errors import ConfigurationError
from tactile_lab.cli.app import app
from tactile_lab.rigs.build import build_interpreter
from tactile_lab.rigs.description import load_rig, shipped_rigs

TURN = np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])


def write_presses(path: Path, readings: Array, normals: Array) -> None:
    """A table of counts (n, electrodes) and normals (n, 3), empty where nothing was touched."""
    head = [*(f"e{number}" for number in range(1, readings.shape[1] + 1)), "nx", "ny", "nz"]
    rows = [[*counts, *normal] for counts, normal in zip(readings.tolist(), normals.tolist(), strict=True)]
    lines = [",".join("" if value != value else str(value) for value in row) for row in rows]
    path.write_text("\n".join([",".join(head), *lines]) + "\n")


def synthetic(count: int, seed: int) -> Presses:
    """Presses all over a finger whose electrodes feel further than equation 2.24 believes."""
    rng, layout = np.random.default_rng(seed), electrode_layout(19)
    turns = np.linspace(0.0, 24.0 * np.pi, count)
    raw = np.c_[0.5 + 0.4 * np.sin(0.31 * turns), 0.7 * np.sin(turns), -np.ones(count)]
    normals = raw / np.linalg.norm(raw, axis=1, keepdims=True)
    points = 0.007 * normals
    near = np.exp(-((points[:, None] - layout.positions_m[None]) ** 2).sum(axis=2) / (2 * 0.004**2))
    strength = 300.0 + 200.0 * rng.random((count, 1))
    return Presses(strength * (0.25 - near) + rng.normal(0.0, 3.0, near.shape), normals)


@pytest.fixture(scope="module")
def learned() -> LearnedNormals:
    return train(synthetic(400, 1), 19, most=200)


def test_learned_normals_beat_equation_2_24_and_state_their_spread() -> None:
    rows = {row.method: row for row in compare_methods(synthetic(600, 2), 19, in_sensor_frame=True, most=200)}
    usual, ours = rows["equation 2.24, squeezed electrodes"], rows["learned"]
    assert ours.median_deg < 0.5 * usual.median_deg
    assert 0.5 < ours.within_68 < 0.9
    assert ours.within_95 > 0.8


def test_a_reference_in_another_frame_is_turned_to_the_sensors() -> None:
    presses = synthetic(400, 3)
    turned = Presses(presses.changes, presses.normals @ TURN.T)
    found = calibrate_normals(PressRecording(turned, 19), in_sensor_frame=False).learned
    assert np.degrees(np.median(angles_rad(found.normals(presses.changes)[0], presses.normals))) < 5.0


def test_far_from_the_recording_the_answer_is_equation_2_24_with_a_wide_spread(learned: LearnedNormals) -> None:
    known, sigma_known = learned.normals(synthetic(50, 5).changes)
    back = np.zeros((1, 19))
    back[0, 2] = -400.0  # one electrode alone, far up the finger: never pressed like that
    far, sigma_far = learned.normals(back)
    assert sigma_far[0] > 2.0 * np.median(sigma_known)
    assert np.degrees(angles_rad(far, np.array([[0.0, -0.692, -0.722]]))[0]) < 25.0
    np.testing.assert_allclose(np.linalg.norm(known, axis=1), 1.0)


def test_the_spread_is_the_most_likely_one() -> None:
    rng = np.random.default_rng(0)
    variance = rng.random(1500)
    errors = np.sqrt(0.05**2 + 0.2**2 * variance) * np.linalg.norm(rng.normal(size=(2, 1500)), axis=0)
    spread = fitted_spread(errors, variance)
    assert spread.near_rad == pytest.approx(0.05, rel=0.25)
    assert spread.far_rad == pytest.approx(0.2, rel=0.15)
    assert Spread(near_rad=0.3, far_rad=0.4).sigma_rad(np.array([1.0]))[0] == pytest.approx(0.5)


def test_a_file_gives_back_what_was_learned(learned: LearnedNormals, tmp_path: Path) -> None:
    presses = synthetic(20, 6)
    path = tmp_path / "normals.yaml"
    rows = compare_methods(synthetic(200, 1), 19, in_sensor_frame=True, most=100)
    found = NormalsCalibration(learned, tuple(rows))
    write_record(path, normals_record(found, "FF", "bench", serial="BT1"))
    write_record(path, normals_record(found, "TH", "bench", earlier=path))
    restored = load_normals(path)
    assert sorted(restored) == ["FF", "TH"]
    np.testing.assert_allclose(
        restored["FF"].normals(presses.changes)[0], learned.normals(presses.changes)[0], atol=1e-4
    )
    with pytest.raises(ConfigurationError, match="rig bench, not normals of other"):
        normals_record(found, "FF", "other", earlier=path)
    path.write_text(path.read_text().replace("FF:", "XX:", 1))
    with pytest.raises(ConfigurationError, match="changed by hand"):
        load_normals(path)


def test_the_device_uses_what_was_learned_and_refuses_another_model(learned: LearnedNormals) -> None:
    model = {"electrodes": 24, "distal_T_sensor": {"translation_m": (0.0, 0.0, 0.0)}}
    with pytest.raises(ConfigurationError, match="19 electrodes, but the sensor has 24"):
        BioTac("FF", BioTacCalibration.model_validate(model), normals=learned)


def test_a_rig_that_names_the_file_gives_it_to_its_fingers(learned: LearnedNormals, tmp_path: Path) -> None:
    shipped = shipped_rigs()["sim-biotac"]
    content = load(shipped)
    files = {role: str(shipped.parent / file) for role, file in content["calibration"].items()}
    rows = compare_methods(synthetic(200, 1), 19, in_sensor_frame=True, most=100)
    record = normals_record(NormalsCalibration(learned, tuple(rows)), "MF", "simulated-hand")
    write_record(tmp_path / "normals.yaml", record)
    content["calibration"] = files | {"normals": "normals.yaml"}
    (tmp_path / "rig.yaml").write_text(json.dumps(content))
    tips = build_interpreter(load_rig(str(tmp_path / "rig.yaml"))).perception.fingertips
    assert isinstance(tips["MF"], BioTac)
    assert isinstance(tips["FF"], BioTac)
    assert tips["MF"].normals is not None
    assert tips["FF"].normals is None


def test_a_table_is_written_and_read_with_untouched_rows_as_its_tare(tmp_path: Path) -> None:
    presses = synthetic(30, 7)
    normals = presses.normals.copy()
    normals[:5] = np.nan
    readings = 2000.0 + presses.changes
    readings[:5] = 2000.0
    write_presses(tmp_path / "presses.csv", readings, normals)
    read = read_presses(tmp_path / "presses.csv")
    np.testing.assert_allclose(read.presses.changes, presses.changes[5:], atol=1e-9)
    np.testing.assert_allclose(read.presses.normals, presses.normals[5:])


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("", "not a table of presses"),
        ("a,b\n1,2\n", "not a table of presses"),
        ("e1,e2,nx,ny,nz\n1,2,0,0,1\n", "2 electrodes"),
        ("e1,e2,nx,ny,nz\n1,x,0,0,1\n", "line 2: is not a sample"),
        ("e1,e2,nx,ny,nz\n1,2,0,0\n", "line 2: is not a sample"),
        ("e1,e2,nx,ny,nz\n1,2,0,0,3\n", "2 electrodes"),
    ],
)
def test_a_table_that_does_not_fit_is_refused(text: str, words: str, tmp_path: Path) -> None:
    (tmp_path / "presses.csv").write_text(text)
    with pytest.raises(ConfigurationError, match=words):
        read_presses(tmp_path / "presses.csv")


def test_normals_that_are_no_unit_vectors_or_too_few_are_refused(tmp_path: Path) -> None:
    np.savetxt(tmp_path / "x.txt", np.ones((19, 6)))
    np.savetxt(tmp_path / "y.txt", 3.0 * np.ones((3, 6)))
    with pytest.raises(ConfigurationError, match=r"the normal of sample 1 has length 5\.2, not 1"):
        read_presses(tmp_path / "x.txt", tmp_path / "y.txt")
    np.savetxt(tmp_path / "y.txt", np.ones((3, 5)) / np.sqrt(3.0))
    with pytest.raises(ConfigurationError, match="6 samples of electrodes"):
        read_presses(tmp_path / "x.txt", tmp_path / "y.txt")
    with pytest.raises(ConfigurationError, match="cannot be read"):
        read_presses(tmp_path / "none.txt", tmp_path / "y.txt")
    np.savetxt(tmp_path / "y.txt", np.ones((3, 6)) / np.sqrt(3.0))
    with pytest.raises(ConfigurationError, match="6 presses with a known normal, but 100 are needed"):
        calibrate_normals(read_presses(tmp_path / "x.txt", tmp_path / "y.txt"), in_sensor_frame=True)


def test_the_command_compares_and_stores(tmp_path: Path) -> None:
    presses = synthetic(240, 8)
    write_presses(tmp_path / "presses.csv", presses.changes, presses.normals)
    out = tmp_path / "normals.yaml"
    words = [
        "calibrate",
        "biotac",
        str(tmp_path / "presses.csv"),
        "--sensor-frame",
        "--out",
        str(out),
        "--finger",
        "RF",
    ]
    result = CliRunner().invoke(app, [*words, "--json"])
    told = json.loads(result.stdout)
    assert result.exit_code == (0 if told["passed"] else 3)
    assert {row["method"] for row in told["methods"]} >= {"learned", "sum of squeezed normals"}
    assert list(load_normals(out)) == ["RF"]


@pytest.mark.long
def test_on_recorded_presses_learning_halves_the_error_and_states_it_truly(lab_data: Path) -> None:
    folder = lab_data / "biotac_normal"
    recording = read_presses(folder / "X1.txt", folder / "Y1.txt")
    rows = {row.method: row for row in compare_methods(recording.presses, 19)}
    ours: MethodErrors = rows["learned"]
    assert ours.median_deg < 0.5 * rows["equation 2.24, squeezed electrodes"].median_deg  # measured 4.7 and 9.5
    assert ours.median_deg < 0.3 * rows["equation 2.24, all electrodes, squared"].median_deg  # 18.1
    assert 0.6 < ours.within_68 < 0.76  # measured 0.68
    assert 0.85 < ours.within_95 < 0.99  # measured 0.90


def test_angles_between_equal_and_opposite_vectors() -> None:
    up: Array = np.array([[0.0, 0.0, 1.0]])
    assert angles_rad(up, up)[0] == 0.0
    assert angles_rad(up, -up)[0] == pytest.approx(np.pi)
