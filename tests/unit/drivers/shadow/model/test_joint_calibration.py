from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
import yaml
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.interpolate import LinearNDInterpolator

from drivers.core.contacts import Array
from drivers.core.errors import ConfigurationError
from drivers.shadow.model.interpolation import Curves, Plane
from drivers.shadow.model.joint_calibration import JointCalibration
from drivers.shadow.model.kinematics import JOINT_INDEX, JOINTS, JOINT_LIMITS_rad, joint_vector
from drivers.shadow.protocol.palm_codec import SENSORS
from tactile_lab import rigs

SIMULATED = Path(rigs.__file__).parent / "calibrations" / "simulated-hand" / "joints.yaml"
DOUBLE = {"THJ5": ("THJ5A", "THJ5B"), "WRJ1": ("WRJ1A", "WRJ1B")}
within_limits = st.lists(st.floats(0, 1), min_size=24, max_size=24).map(
    lambda share: JOINT_LIMITS_rad[:, 0] + np.array(share) * np.ptp(JOINT_LIMITS_rad, axis=1)
)


@pytest.fixture(scope="module")
def simulated() -> JointCalibration:
    return JointCalibration.load(SIMULATED)


def tables() -> dict[str, list[tuple[float, float]]]:
    """A straight calibration for every joint: 2000 counts are 0, 10 counts a degree."""
    return {joint: [(1000.0, -100.0), (3000.0, 100.0)] for joint in JOINTS}


def sensors_with(**counts: float) -> Array:
    sensors = np.full(len(SENSORS), 2000.0)
    for name, value in counts.items():
        sensors[SENSORS.index(name)] = value
    return sensors


def angle_deg(calibration: JointCalibration, joint: str, sensors: Array) -> float:
    return float(np.degrees(calibration.angles_rad(sensors)[JOINT_INDEX[joint]]))


def write(path: Path, content: object) -> Path:
    path.write_text(yaml.safe_dump(content))
    return path


def test_first_finger_matches_the_golden_vector(lab_data: Path) -> None:
    golden = json.loads((lab_data / "golden_vectors.json").read_text())["joint_calibration_378_FFJ1_deg"]
    calibration = JointCalibration.load(lab_data / "shadow_hand_config" / "378" / "calibration.yaml")
    for counts, degrees in golden.items():
        read = angle_deg(calibration, "FFJ1", sensors_with(FFJ1=float(counts)))
        assert read == pytest.approx(degrees, abs=1e-4)


@pytest.mark.parametrize("hand", ["378", "554"])
def test_published_calibrations_agree_with_independent_interpolation(lab_data: Path, hand: str) -> None:
    """At the sensors of the published record, which belongs to yet another hand, so only consistency is meant."""
    record = yaml.safe_load((lab_data / "shadow_published_debug_ethercat.yaml").read_text())[0]
    folder = lab_data / "shadow_hand_config" / hand
    content = yaml.safe_load((folder / "calibration.yaml").read_text())
    sensors = np.array(record["sensors"], np.uint16)
    angles_deg = np.degrees(JointCalibration.load(folder / "calibration.yaml").angles_rad(sensors))
    for joint, table in content["sr_calibrations"]:
        counts = np.mean([sensors[SENSORS.index(channel)] for channel in DOUBLE.get(joint, (joint,))])
        assert angles_deg[JOINT_INDEX[joint]] == pytest.approx(_bracket(table, float(counts)), abs=1e-9), joint


def _bracket(table: list[list[float]], counts: float) -> float:
    points = sorted(map(tuple, table))
    following = next((index for index in range(1, len(points)) if counts < points[index][0]), len(points) - 1)
    (x0, y0), (x1, y1) = points[following - 1], points[following]
    return y0 + (y1 - y0) * (counts - x0) / (x1 - x0)


def test_the_coupled_thumb_agrees_with_an_independent_triangulation(lab_data: Path) -> None:
    path = lab_data / "shadow_hand_config" / "378" / "calibration.yaml"
    points = yaml.safe_load(path.read_text())["sr_calibrations_coupled"][0][1]
    reference = LinearNDInterpolator([point[0] for point in points], [point[1:] for point in points])
    calibration, random = JointCalibration.load(path), np.random.default_rng(1)
    for counts in random.uniform([1600, 1950], [3100, 2250], (100, 2)):
        angles = np.degrees(calibration.angles_rad(sensors_with(THJ1=counts[0], THJ2=counts[1])))
        np.testing.assert_allclose(angles[[JOINT_INDEX["THJ1"], JOINT_INDEX["THJ2"]]], reference(*counts), atol=1e-9)


def test_every_table_point_reads_back_exactly(simulated: JointCalibration) -> None:
    content = yaml.safe_load(SIMULATED.read_text())
    for joint, table in content["sr_calibrations"]:
        pair = DOUBLE.get(joint, (joint,))
        for counts, degrees in table:
            assert angle_deg(simulated, joint, sensors_with(**dict.fromkeys(pair, counts))) == pytest.approx(degrees)
    for pair, points in content["sr_calibrations_coupled"]:
        for counts, *degrees in points:
            read = simulated.angles_rad(sensors_with(**dict(zip(pair, counts, strict=True))))
            np.testing.assert_allclose(np.degrees(read[[JOINT_INDEX[joint] for joint in pair]]), degrees, atol=1e-9)


@settings(max_examples=60, deadline=None, derandomize=True)
@given(joints_rad=within_limits)
def test_readings_and_angles_are_inverse_within_joint_limits(simulated: JointCalibration, joints_rad: Array) -> None:
    counts = simulated.raw_counts(joints_rad)
    np.testing.assert_allclose(simulated.angles_rad(counts), joints_rad, atol=1e-9)
    assert counts.min() >= 0
    assert counts.max() < 4096


@settings(max_examples=40, deadline=None, derandomize=True)
@given(joints_rad=within_limits)
def test_reading_a_rounded_sample_returns_within_one_count(simulated: JointCalibration, joints_rad: Array) -> None:
    counts = simulated.raw_counts(joints_rad)
    again = simulated.raw_counts(simulated.angles_rad(np.rint(counts).astype(np.uint16)))
    assert np.abs(again - counts).max() <= 1.0


def test_double_sensors_are_averaged_before_the_table_is_read() -> None:
    calibration = JointCalibration(tables(), {})
    assert angle_deg(calibration, "THJ5", sensors_with(THJ5A=1900, THJ5B=2300)) == pytest.approx(10.0)
    assert angle_deg(calibration, "WRJ1", sensors_with(WRJ1A=2000, WRJ1B=1800)) == pytest.approx(-10.0)


def test_every_other_joint_is_read_from_its_own_channel() -> None:
    calibration = JointCalibration(tables(), {})
    for joint in set(JOINTS) - {"THJ5", "WRJ1"}:
        angles_deg = np.degrees(calibration.angles_rad(sensors_with(**{joint: 2150})))
        assert angles_deg[JOINT_INDEX[joint]] == pytest.approx(15.0)
        assert np.count_nonzero(np.abs(angles_deg) > 1e-9) == 1


def test_channels_without_a_joint_read_as_not_fitted(simulated: JointCalibration) -> None:
    assert simulated.raw_counts(np.zeros(24))[26:].tolist() == [26, 27, 28, 29, 30, 31, 0, 0, 0, 0, 0]


def test_the_order_of_the_points_does_not_matter() -> None:
    shuffled = tables() | {"FFJ1": [(3000.0, 100.0), (2000.0, 0.0), (1000.0, -100.0)]}
    sensors = sensors_with(FFJ1=1234)
    read = JointCalibration(shuffled, {}).angles_rad(sensors)
    np.testing.assert_allclose(read, JointCalibration(tables(), {}).angles_rad(sensors), atol=1e-12)


def test_a_table_may_fall() -> None:
    calibration = JointCalibration(tables() | {"FFJ1": [(1000.0, 100.0), (2000.0, 10.0), (3000.0, -100.0)]}, {})
    assert angle_deg(calibration, "FFJ1", sensors_with(FFJ1=1500)) == pytest.approx(55.0)
    assert calibration.raw_counts(np.radians(np.full(24, 55.0)))[SENSORS.index("FFJ1")] == pytest.approx(1500)


def test_a_fixed_joint_has_one_angle_and_reads_the_middle_of_its_table() -> None:
    calibration = JointCalibration(tables() | {"FFJ1": [(0.0, 20.0), (1.0, 20.0)]}, {})
    assert angle_deg(calibration, "FFJ1", sensors_with(FFJ1=700)) == pytest.approx(20.0)
    assert calibration.raw_counts(np.zeros(24))[0] == 0.5


def coupled(*rows: tuple[tuple[float, float], float, float]) -> JointCalibration:
    """A calibration with these points of THJ1 and THJ2."""
    plain = {joint: table for joint, table in tables().items() if joint not in ("THJ1", "THJ2")}
    return JointCalibration(plain, {("THJ1", "THJ2"): rows}, "hand.yaml")


def test_a_thumb_whose_last_joint_is_fixed_is_read_and_emulated() -> None:
    """As in a published hand without a sensor in that joint."""
    calibration = coupled(((1.0, 2050.0), 20.0, -40.0), ((0.0, 2150.0), 20.0, -15.0), ((0.0, 2400.0), 20.0, 40.0))
    assert [calibration.turns[JOINT_INDEX[joint]] for joint in ("THJ1", "THJ2")] == [False, True]
    for degrees in (-40.0, -15.0, 3.0, 40.0):
        sensors = calibration.raw_counts(joint_vector({"THJ1": 0.7, "THJ2": np.radians(degrees)}))
        assert angle_deg(calibration, "THJ2", sensors) == pytest.approx(degrees)
        assert angle_deg(calibration, "THJ1", sensors) == pytest.approx(20.0)


def test_a_coupling_that_leaves_an_angle_open_cannot_be_emulated() -> None:
    calibration = coupled(((1.0, 2050.0), 20.0, -40.0), ((0.0, 2150.0), 30.0, -20.0), ((0.0, 2400.0), 40.0, 0.0))
    words = r"^hand.yaml: .*THJ1 and THJ2 does not determine both angles\. .*needs another"
    with pytest.raises(ConfigurationError, match=words):
        calibration.raw_counts(np.zeros(24))


@pytest.mark.parametrize(
    ("table", "problem"),
    [
        ([(1000.0, 0.0)], "two or more points"),
        ([(1000.0, 0.0), (1000.0, 10.0)], "not monotonic: 1000 counts stand for 2 angles"),
        (
            [(3000.0, 0.0), (10.0, 22.5), (3000.0, 45.0), (3000.0, 90.0)],
            "not monotonic: 3000 counts stand for 3 angles",
        ),
        ([(1000.0, 0.0), (1500.0, 10.0), (2000.0, 5.0)], "not monotonic"),
        ([(1000.0, 0.0), (1500.0, 0.0), (2000.0, 5.0)], "not monotonic"),
        ([(1000.0, 5.0), (1500.0, 0.0), (2000.0, 0.0)], "not monotonic"),
        ([(1000.0, 0.0), (2000.0, float("nan"))], "not monotonic"),
        ([(4000.0, 0.0), (1700.0, 22.5), (2000.0, 45.0), (2300.0, 67.5)], "monotonic: 4000 counts at 0 degrees contra"),
        ([(1000.0, 0.0), (1100.0, 5.0), (2000.0, 3.0), (2100.0, 10.0)], "not monotonic. Each"),
        ([(4095.0, 0.0), (9.0, 22.5), (7.0, 45.0)], "only 2 counts for 22.5 degrees"),
    ],
)
def test_an_unusable_table_is_refused_with_the_joint_named(table: list[tuple[float, float]], problem: str) -> None:
    with pytest.raises(ConfigurationError, match=f"hand.yaml: the table of MFJ3 .*{problem}"):
        JointCalibration(tables() | {"MFJ3": table}, {}, "hand.yaml")


def test_missing_and_unknown_joints_are_named() -> None:
    names = tables() | {"FFJ9": [(0.0, 0.0), (1.0, 1.0)]}
    del names["RFJ2"]
    with pytest.raises(ConfigurationError, match="misses RFJ2 and has unknown FFJ9"):
        JointCalibration(names, {})


def test_a_joint_calibrated_alone_and_in_a_pair_is_refused() -> None:
    corners = [((0.0, 0.0), 0.0, 0.0), ((1.0, 0.0), 1.0, 0.0), ((0.0, 1.0), 0.0, 1.0)]
    with pytest.raises(ConfigurationError, match="THJ1, THJ2 more than once"):
        JointCalibration(tables(), {("THJ1", "THJ2"): corners})


def test_a_folded_or_repeated_coupled_table_is_refused() -> None:
    grid = [((float(a), float(b)), float(a), float(b)) for a in range(3) for b in range(3)]
    plain = {joint: table for joint, table in tables().items() if joint not in ("THJ1", "THJ2")}
    JointCalibration(plain, {("THJ1", "THJ2"): grid})
    grid[4] = (grid[4][0], 5.0, 1.0)
    with pytest.raises(ConfigurationError, match="THJ1 and THJ2 folds"):
        JointCalibration(plain, {("THJ1", "THJ2"): grid})
    with pytest.raises(ConfigurationError, match="THJ1 and THJ2 needs three"):
        JointCalibration(plain, {("THJ1", "THJ2"): grid[:2]})


@pytest.mark.parametrize(
    ("content", "problem"),
    [
        ({"sr_calibrations": [["FFJ1", [[0.0, 0.0], [1.0, 1.0]]]] * 2}, "FFJ1 more than once"),
        ({"sr_calibrations": [], "sr_calibrations_coupled": [[["THJ1", "THJ2"], []]] * 2}, "THJ1, THJ2 more than once"),
        ({"sr_calibrations": [["FFJ1", [[0.0, 0.0, 2.0]]]]}, r"sr_calibrations\.0\.1\.0"),
        ({"sr_calibrations": [["FFJ1", [[0.0, float("nan")], [1.0, 1.0]]]]}, "finite number"),
        ({"calibrations": []}, "sr_calibrations"),
        ([], "document"),
    ],
)
def test_a_malformed_file_is_refused_with_the_place_named(tmp_path: Path, content: object, problem: str) -> None:
    with pytest.raises(ConfigurationError, match=problem):
        JointCalibration.load(write(tmp_path / "calibration.yaml", content))


def test_a_missing_file_is_refused(tmp_path: Path) -> None:
    with pytest.raises(ConfigurationError, match="file not found"):
        JointCalibration.load(tmp_path / "absent.yaml")


def test_curves_of_two_points_alone_work() -> None:
    curves = Curves([np.array([[0.0, 1.0], [2.0, 5.0]]), np.array([[0.0, 0.0], [1.0, -1.0]])])
    np.testing.assert_allclose(curves(np.array([-1.0, 3.0])), [-1.0, -3.0])
    np.testing.assert_allclose(curves.inverse(np.array([-1.0, -3.0])), [-1.0, 3.0])


@settings(max_examples=30, deadline=None, derandomize=True)
@given(x=st.floats(-1e4, 1e4), y=st.floats(-1e4, 1e4))
def test_an_affine_plane_stays_affine_inside_and_far_outside_the_table(x: float, y: float) -> None:
    corners = np.array([[0.0, 0.0], [100.0, 0.0], [0.0, 100.0], [90.0, 80.0]])
    matrix = np.array([[0.5, 0.1], [-0.2, 1.0]])
    plane = Plane(corners, corners @ matrix + [3.0, -2.0])
    image = plane(np.array([x, y]))
    np.testing.assert_allclose(image, np.array([x, y]) @ matrix + [3.0, -2.0], atol=1e-6)
    np.testing.assert_allclose(plane.inverse(image), [x, y], atol=1e-6)
