from __future__ import annotations

import numpy as np
import pytest
from gtsam import Rot3

from calibration.fingertip.data import FingertipData, WrenchPose
from calibration.fingertip.electrodes import faulty_electrodes, load_untouched
from calibration.fingertip.fit import fit_fingertip
from calibration.fingertip.model import PARTS
from calibration.fingertip.record import fingertip_record, judge_fingertip
from calibration.hand.joints import JointPose, corrected_tables, from_contacts, from_poses, joints_record, load_poses
from calibration.steps.refinement import JointOffset
from calibration.store.admission import Installation
from calibration.store.store import write_record
from drivers.core.errors import ConfigurationError
from drivers.core.fingertip import GRAVITY, FingertipCalibration, RigidTransform, load_fingertips
from drivers.shadow.model.joint_calibration import JointCalibration
from drivers.shadow.model.kinematics import JOINT_INDEX, joint_vector
from tactile_lab.experiments.runs.fingertip_runs import NOMINAL as BEFORE
from tactile_lab.experiments.runs.fingertip_runs import draw, recording
from tactile_lab.rigs.description import load_rig

HERE = Installation("simulated-hand")
JOINTS = load_rig("sim").files["joints"]


# --- joints --------------------------------------------------------------------------------------------------------


def pose(known: float, measured: float, joint: str = "FFJ3") -> JointPose:
    return JointPose(known_deg={joint: known}, measured_deg={joint: measured})


def test_one_known_pose_gives_an_offset_and_several_a_gain():
    found = from_poses([pose(0.0, 1.2)])["FFJ3"]
    assert (found.gain, found.shift_deg) == (1.0, pytest.approx(-1.2))
    angles = np.array([0.0, 30.0, 60.0, 90.0])
    found = from_poses([pose(true, (true + 2.0) / 1.05) for true in angles])["FFJ3"]
    assert found.gain == pytest.approx(1.05)
    assert found.shift_deg == pytest.approx(-2.0)
    assert found.rms_deg < 1e-9


def test_the_stated_sigma_is_the_error_that_noisy_poses_make() -> None:
    rng = np.random.default_rng(0)
    for angles in (np.full(5, 30.0), np.linspace(0.0, 90.0, 5)):  # without a gain, and with one
        found = [
            from_poses([pose(true, true + 1.2 + 0.5 * rng.standard_normal()) for true in angles])["FFJ3"]
            for _ in range(300)
        ]
        middle = angles.mean() + 1.2
        off = [each.gain * middle + each.shift_deg - angles.mean() for each in found]
        stated = np.sqrt(np.mean([each.sigma_deg**2 for each in found]))
        assert stated == pytest.approx(np.std(off), rel=0.15)
        assert stated == pytest.approx(0.5 / np.sqrt(5), rel=0.15)


def test_poses_near_each_other_give_no_gain():
    assert from_poses([pose(a, a + 0.5) for a in (0.0, 5.0, 10.0)])["FFJ3"].gain == 1.0


@pytest.mark.parametrize("joint", ["FFJ3", "THJ2"])
def test_corrected_tables_give_the_corrected_angle_exactly(tmp_path, joint):
    corrections = from_poses([pose(0.0, 1.5, joint)])
    write_record(tmp_path / "joints.yaml", joints_record(JOINTS, corrections, "known poses", HERE))
    before, after = JointCalibration.load(JOINTS), JointCalibration.load(tmp_path / "joints.yaml")
    counts = before.raw_counts(joint_vector({joint: 0.2, "MFJ2": 0.4, "THJ1": 0.3}))
    change = np.degrees(after.angles_rad(counts) - before.angles_rad(counts))
    assert change[JOINT_INDEX[joint]] == pytest.approx(-1.5, abs=1e-9)
    assert np.count_nonzero(np.abs(change) > 1e-9) == 1


def test_contacts_correct_those_joints_alone_that_they_tell():
    sure, unsure = JointOffset(0.01, 0.002, 0.0105), JointOffset(0.01, 0.009, 0.0105)
    found = from_contacts({"WRJ2": sure, "FFJ1": unsure})
    assert list(found) == ["WRJ2"]
    assert found["WRJ2"].shift_deg == pytest.approx(-np.degrees(0.01))
    with pytest.raises(ConfigurationError, match="do not determine the offset of any joint"):
        from_contacts({"FFJ1": unsure})


def test_a_correction_that_is_too_large_is_refused():
    with pytest.raises(ConfigurationError, match=r"the correction of FFJ3 is -40\.0 deg"):
        corrected_tables(JOINTS, from_poses([pose(0.0, 40.0)]))


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("rig: other\nposes: [{known_deg: {FFJ3: 0}, measured_deg: {FFJ3: 1}}]", "recorded on rig other"),
        ("rig: simulated-hand\nposes: [{known_deg: {XXJ3: 0}, measured_deg: {XXJ3: 1}}]", "unknown joints XXJ3"),
        (
            "rig: simulated-hand\nposes: [{known_deg: {FFJ3: 0}, measured_deg: {FFJ3: 1, YYJ1: 2}}]",
            "unknown joints YYJ1",
        ),
        ("rig: simulated-hand\nposes: [{known_deg: {FFJ3: 0}, measured_deg: {}}]", "has no measured FFJ3"),
        ("rig: simulated-hand\nposes: []", "poses"),
    ],
)
def test_files_of_poses_that_do_not_fit_are_refused(tmp_path, text, words):
    path = tmp_path / "poses.yaml"
    path.write_text(text)
    with pytest.raises(ConfigurationError, match=words):
        load_poses(path, HERE)


# --- fingertips ----------------------------------------------------------------------------------------------------

TRUE_SIMULATED = draw(np.random.default_rng(1))
NOMINAL = load_fingertips(load_rig("sim").files["fingertips"])["FF"]
TRUE = NOMINAL.model_copy(
    update={
        "distal_T_sensor": RigidTransform(translation_m=(0.0, 0.0, 0.004), rpy_rad=(0.0, 0.0, 0.3)),
        "mass_kg": 0.012,
        "com_distal_m": (0.001, -0.002, 0.017),
        "centre_distal_m": (0.0005, -0.0004, 0.0196),
    }
)


def wrench(
    tip: FingertipCalibration, world_R_distal: np.ndarray, press_N: float, rng: np.random.Generator
) -> WrenchPose:
    """What the sensor says, bias and noise included, when the tip is pressed on a level plate."""
    mounting = tip.distal_T_sensor.pose()
    up = world_R_distal[2]
    axes, centre = np.array(tip.semi_axes_m), np.array(tip.centre_distal_m)
    touch = centre - axes**2 * up / np.linalg.norm(axes * up)
    place, rotation = np.asarray(mounting.translation()), mounting.rotation().matrix()
    weight = -tip.mass_kg * GRAVITY * up
    force = press_N * up + weight
    torque = np.cross(touch - place, press_N * up) + np.cross(np.array(tip.com_distal_m) - place, weight)
    sensed = np.concatenate([rotation.T @ force, rotation.T @ torque])
    bias = np.array([0.2, -0.3, 0.1, 1e-3, -2e-3, 5e-4])
    noise = rng.standard_normal(6) * np.repeat([1e-3, 5e-6], 3)
    return WrenchPose(world_R_distal=tuple(map(tuple, world_R_distal.tolist())), wrench=tuple(sensed + bias + noise))


def recorded(tip: FingertipCalibration = TRUE, sign: float = 1.0) -> FingertipData:
    rng = np.random.default_rng(5)
    free = [Rot3.Expmap(2.0 * rng.standard_normal(3)) for _ in range(12)]
    down = [
        Rot3.Expmap(np.array([np.pi, 0, 0])) * Rot3.Expmap(np.append(rng.uniform(-0.9, 0.9, 2), 0.0)) for _ in range(16)
    ]
    entries = [wrench(tip, rotation.matrix(), 0.0, rng) for rotation in free]
    presses = [wrench(tip, rotation.matrix(), 1.5, rng) for rotation in down]
    turned = [p.model_copy(update={"wrench": tuple(sign * np.array(p.wrench))}) for p in presses]
    still = [p.model_copy(update={"wrench": tuple(sign * np.array(p.wrench))}) for p in entries]
    return FingertipData(rig="simulated-hand", finger="FF", free=tuple(still), presses=tuple(turned))


def test_mounting_weight_and_shape_are_found():
    found = fit_fingertip(recorded(), NOMINAL).calibration
    assert found.distal_T_sensor.rpy_rad[2] == pytest.approx(0.3, abs=0.01)
    assert found.mass_kg == pytest.approx(0.012, abs=5e-4)
    np.testing.assert_allclose(found.com_distal_m, TRUE.com_distal_m, atol=5e-4)
    np.testing.assert_allclose(found.centre_distal_m[:2], TRUE.centre_distal_m[:2], atol=3e-4)


def test_the_stated_regions_hold_the_truth_whatever_mounting_weight_and_shape():
    held, apart, off = [], [], []
    for seed in range(12):
        rng = np.random.default_rng(seed)
        truth = draw(rng)
        found = fit_fingertip(recording(truth, rng, presses=8), BEFORE)
        held.append(found.holds(truth))
        apart += [found.holds(truth, part) for part in PARTS]
        off.append(np.linalg.norm(found.errors(truth)[PARTS["mounting"]]) / found.sigma("mounting"))
    assert sum(held) >= 10  # 9 or fewer of 12 come once in 50 times when a region holds 95 %
    assert sum(apart) >= 54  # of 60
    assert 0.5 < np.sqrt(np.mean(np.square(off))) < 1.5


def test_drift_that_readings_share_counts_once():
    data = recording(TRUE_SIMULATED, np.random.default_rng(0), presses=6)
    timeless = data.model_copy(
        update={
            part: tuple(pose.model_copy(update={"time_s": None}) for pose in getattr(data, part))
            for part in ("free", "presses")
        }
    )
    timed, untimed = (fit_fingertip(each, BEFORE) for each in (data, timeless))
    assert timed.variance_factor != untimed.variance_factor
    assert timed.sigma("mounting") < untimed.sigma("mounting")  # the moment before a press tells its drift


def test_more_noise_than_stated_widens_the_regions():
    data = recording(TRUE_SIMULATED, np.random.default_rng(0), presses=6)
    calm = BEFORE.model_copy(update={"force_drift_N": 0.002, "moment_drift_Nm": 1e-5, "force_sigma_N": 5e-4})
    found = fit_fingertip(data, calm)
    assert found.variance_factor > 4.0
    judged = {judgement.name: judgement for judgement in judge_fingertip(found)}
    assert not judged["noise relative to the stated"].ok


def test_the_record_keeps_the_other_fingers(tmp_path):
    tips = load_fingertips(load_rig("sim").files["fingertips"])
    record = fingertip_record(recorded(), fit_fingertip(recorded(), NOMINAL), tips, HERE)
    write_record(tmp_path / "fingertips.yaml", record)
    back = load_fingertips(tmp_path / "fingertips.yaml")
    assert back["MF"] == tips["MF"]
    assert back["FF"].mass_kg == pytest.approx(0.012, abs=5e-4)
    assert record.covariance is not None
    assert len(record.covariance.of) == len(record.covariance.matrix) == 13


def test_forces_of_the_opposite_sign_are_named():
    with pytest.raises(ConfigurationError, match="forces have the opposite sign"):
        fit_fingertip(recorded(sign=-1.0), NOMINAL)


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"free": 3}, "3 untouched wrenches, but 6 are needed"),
        ({"presses": 2}, "2 presses, but 6 are needed"),
    ],
)
def test_too_few_wrenches_are_named(change, words):
    data = recorded()
    cut = {name: getattr(data, name)[:count] for name, count in change.items()}
    with pytest.raises(ConfigurationError, match=words):
        fit_fingertip(data.model_copy(update=cut), NOMINAL)


def changed(poses, change):
    """Poses with their wrenches changed by a function of wrench and orientation."""
    return tuple(
        pose.model_copy(update={"wrench": tuple(change(np.array(pose.wrench), np.array(pose.world_R_distal)))})
        for pose in poses
    )


def test_soft_presses_are_named_with_the_softest():
    data, rng = recorded(), np.random.default_rng(2)
    soft = wrench(TRUE, np.array(data.presses[0].world_R_distal), 0.25, rng)
    with pytest.raises(ConfigurationError, match=r"a press of only 0\.1\d N\. Press with"):
        fit_fingertip(data.model_copy(update={"presses": (*data.presses[1:], soft)}), NOMINAL)


def test_forces_that_lie_sideways_fit_no_mounting():
    data, rng = recorded(), np.random.default_rng(3)

    def slid(reading, _):
        direction = rng.standard_normal(3)
        return np.concatenate([2.0 * direction / np.linalg.norm(direction), reading[3:]])

    with pytest.raises(ConfigurationError, match=r"forces are \d+ deg off the plate's normal for every mounting"):
        fit_fingertip(data.model_copy(update={"presses": changed(data.presses, slid)}), NOMINAL)


def test_orientations_all_alike_are_named():
    data = recorded()
    with pytest.raises(ConfigurationError, match="all in nearly the same orientation"):
        fit_fingertip(data.model_copy(update={"free": data.free[:1] * 8}), NOMINAL)


def test_electrodes_that_are_dead_open_or_noisy_are_named():
    counts = 2000.0 + 3.0 * np.random.default_rng(0).standard_normal((200, 19))
    assert faulty_electrodes(counts) == {}
    counts[:, 3], counts[:, 7] = 1800.0, 4095.0
    counts[:, 11] = 2000.0 + 80.0 * np.random.default_rng(1).standard_normal(200)
    found = faulty_electrodes(counts)
    assert set(found) == {3, 7, 11}
    assert "dead" in found[3]
    assert "end of its range" in found[7]
    assert "noisy" in found[11]


def test_an_electrode_is_judged_by_the_others_and_by_its_range():
    counts = 2000.0 + np.where(np.arange(200)[:, None] % 2, 1.0, -1.0) * np.ones(19)
    counts[:, 4] = 2000.0 + np.where(np.arange(200) % 2, 30.0, -30.0)
    counts[:, 5] = 3.0 + np.where(np.arange(200) % 2, 1.0, -1.0)
    found = faulty_electrodes(counts)
    assert found[4] == "is noisy: 30 counts, the others 1"
    assert found[5] == "reads 3 counts, at the end of its range: open or short"
    with pytest.raises(ConfigurationError, match=r"5 samples, \d+ needed"):
        faulty_electrodes(counts[:5])


def test_a_touched_biotac_is_refused():
    counts = 2000.0 + np.linspace(0, 400, 200)[:, None] * np.ones(19)
    with pytest.raises(ConfigurationError, match="touched, or is still warming up"):
        faulty_electrodes(counts)


def test_a_table_of_counts_is_read_and_others_are_refused(tmp_path):
    path = tmp_path / "counts.csv"
    path.write_text("1, 2, 3\n4 5 6\n\n")
    np.testing.assert_array_equal(load_untouched(path), [[1, 2, 3], [4, 5, 6]])
    for text in ("a b", "1 2\n3\n", "1 nan"):
        path.write_text(text)
        with pytest.raises(ConfigurationError, match="is not a table of counts"):
            load_untouched(path)
    with pytest.raises(ConfigurationError, match="cannot be read"):
        load_untouched(tmp_path / "none.csv")
