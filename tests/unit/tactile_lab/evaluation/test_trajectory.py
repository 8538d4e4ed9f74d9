"""The object's trajectory: file, alignment, errors."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from gtsam import Pose3, Rot3
from hypothesis import given, settings
from hypothesis import strategies as st

from drivers.core.errors import SessionError
from drivers.core.poses import planar, transform_points
from tactile_lab.evaluation.files.trajectory_file import COLUMNS, Trajectory, read_trajectory, trajectory_text
from tactile_lab.evaluation.loops import wrong_loops
from tactile_lab.evaluation.registration import FAILURE_LIMIT_MM, registration_rms_mm, registration_verdict
from tactile_lab.evaluation.trajectory import aligned_poses, estimate_T_truth, pose_errors

OFFSET = Pose3(Rot3.RzRyRx(0.1, -0.2, 0.7), np.array([0.01, -0.03, 0.02]))
"""An arbitrary object frame of an estimate, seen from the truth's."""


def table_pose(x_m: float, y_m: float, yaw_rad: float) -> Pose3:
    return Pose3(Rot3.Yaw(yaw_rad), np.array([x_m, y_m, 0.02]))


TRUTH = tuple(table_pose(0.4 + 0.01 * i, -0.02 * i, 0.3 * i) for i in range(5))
SAME = tuple(pose * OFFSET for pose in TRUTH)


def write(path: Path, text: str) -> Path:
    path.write_text(text, encoding="utf-8")
    return path


def test_file_gives_back_the_same_trajectory_with_unplaced_grasps(tmp_path: Path) -> None:
    trajectory = Trajectory((0.5, 1.25, 2.0), (TRUTH[0], None, TRUTH[2]))
    found = read_trajectory(write(tmp_path / "trajectory.csv", trajectory_text(trajectory)))
    assert found.stamps_s == trajectory.stamps_s
    assert found.world_T_object[1] is None
    for pose, expected in zip(found.world_T_object, trajectory.world_T_object, strict=True):
        assert pose is expected or np.array_equal(pose.matrix(), expected.matrix())  # type: ignore[union-attr]


def test_covariances_are_read_back_and_may_be_missing(tmp_path: Path) -> None:
    root = np.random.default_rng(1).normal(size=(6, 6))
    covariances = (1e-6 * root @ root.T, None, None)
    trajectory = Trajectory((0.5, 1.0, 2.0), (TRUTH[0], TRUTH[1], None), covariances)
    text = trajectory_text(trajectory)
    assert {len(line.split(",")) for line in text.splitlines()} == {17 + 21}
    found = read_trajectory(write(tmp_path / "trajectory.csv", text))
    assert found.covariances[1:] == (None, None)
    assert found.covariances[0] == pytest.approx(covariances[0])
    negative = Trajectory((0.5,), (TRUTH[0],), (-np.eye(6),))
    with pytest.raises(SessionError, match=r"line 2: .*negative variances"):
        read_trajectory(write(tmp_path / "negative.csv", trajectory_text(negative)))


def test_unplaced_grasp_has_sixteen_empty_entries() -> None:
    lines = trajectory_text(Trajectory((3.0,), (None,))).splitlines()
    assert lines == [",".join(COLUMNS), "3.000000000" + "," * 16]


@pytest.mark.parametrize(
    ("line", "message"),
    [
        ("1.0,2.0", "17"),
        ("1.0," + ",".join(["x"] * 16), "not a number"),
        ("1.0," + ",".join(["0.5"] * 16), "rigid"),
        ("1.0," + ",".join(["nan"] * 16), "rigid"),
        ("soon" + "," * 16, "not a number"),
    ],
)
def test_wrong_line_is_named(tmp_path: Path, line: str, message: str) -> None:
    path = write(tmp_path / "trajectory.csv", ",".join(COLUMNS) + "\n" + line + "\n")
    with pytest.raises(SessionError, match=f"line 2.*{message}"):
        read_trajectory(path)


def test_missing_and_foreign_files_are_session_errors(tmp_path: Path) -> None:
    with pytest.raises(SessionError, match="Replay the session"):
        read_trajectory(tmp_path / "absent.csv")
    with pytest.raises(SessionError, match="first line"):
        read_trajectory(write(tmp_path / "foreign.csv", "a,b\n1,2\n"))
    (tmp_path / "binary.csv").write_bytes(b"\xff\xfe\x00")
    with pytest.raises(SessionError, match="cannot be read"):
        read_trajectory(tmp_path / "binary.csv")


def test_another_object_frame_is_no_error() -> None:
    errors = pose_errors(SAME, TRUTH)
    assert errors is not None
    assert max(errors.rmse_mm, errors.rmse_deg, errors.step_mm, errors.step_deg, errors.final_mm) < 1e-5
    assert errors.aligned_at == 0


def test_alignment_is_the_truths_frame_in_the_estimates() -> None:
    alignment = estimate_T_truth(SAME, TRUTH)
    assert alignment is not None
    assert alignment.equals(OFFSET.inverse(), 1e-9)


def test_error_is_the_distance_of_origins_and_the_angle_of_frames() -> None:
    shifted = Pose3(Rot3.Yaw(np.radians(3.0)), np.array([0.003, 0.004, 0.0]))
    estimate = (*SAME[:4], TRUTH[4] * shifted * OFFSET)
    errors = pose_errors(estimate, TRUTH)
    assert errors is not None
    last = errors.per_grasp[-1]
    assert last is not None
    assert (last.mm, last.deg) == pytest.approx((5.0, 3.0), abs=1e-6)
    assert (errors.final_mm, errors.final_deg) == pytest.approx((5.0, 3.0), abs=1e-6)
    assert errors.rmse_mm == pytest.approx(5.0 / np.sqrt(4), abs=1e-6)
    assert errors.step_mm == pytest.approx(5.0 / np.sqrt(4), abs=1e-6)


def test_drift_is_the_slope_of_a_steadily_growing_error() -> None:
    estimate = tuple(pose * Pose3(Rot3(), np.array([0.002 * i, 0.0, 0.0])) for i, pose in enumerate(TRUTH))
    errors = pose_errors(estimate, TRUTH)
    assert errors is not None
    assert errors.drift_mm_per_grasp == pytest.approx(2.0)
    assert errors.drift_deg_per_grasp == pytest.approx(0.0, abs=1e-6)


def test_grasps_without_estimate_or_sighting_are_left_out() -> None:
    estimate = (None, *SAME[1:])
    truth = (*TRUTH[:2], None, *TRUTH[3:])
    errors = pose_errors(estimate, truth)
    assert errors is not None
    assert errors.aligned_at == 1
    assert [error is None for error in errors.per_grasp] == [True, False, True, False, False]
    assert errors.rmse_mm < 1e-5


def test_one_common_grasp_is_too_few_and_none_aligns_nothing() -> None:
    assert pose_errors((SAME[0], None), (TRUTH[0], TRUTH[1])) is None
    assert estimate_T_truth((None, None), TRUTH[:2]) is None
    assert aligned_poses((SAME[0], None), (None, None)) == (None, None)


@settings(derandomize=True, max_examples=25, deadline=None)
@given(st.floats(-3.0, 3.0), st.floats(-0.2, 0.2), st.floats(-0.2, 0.2))
def test_figures_do_not_depend_on_the_estimates_object_frame(yaw: float, x: float, y: float) -> None:
    noisy = tuple(pose * table_pose(0.001 * i, 0.0, 0.01 * i) for i, pose in enumerate(TRUTH))
    moved = tuple(pose * table_pose(x, y, yaw) for pose in noisy)
    before, after = pose_errors(noisy, TRUTH), pose_errors(moved, TRUTH)
    assert before is not None
    assert after is not None
    assert after.rmse_mm == pytest.approx(before.rmse_mm, abs=1e-5)
    assert after.rmse_deg == pytest.approx(before.rmse_deg, abs=1e-5)


def contacts(count: int = 5) -> list[np.ndarray]:
    rng = np.random.default_rng(4)
    return [transform_points(pose, rng.uniform(-0.03, 0.03, (count, 3))) for pose in TRUTH]


@pytest.mark.parametrize("dimension", [2, 3])
def test_registration_error_ignores_the_choice_of_object_frame(dimension: int) -> None:
    upright = tuple(pose * table_pose(0.02, 0.01, 0.6) for pose in TRUTH)
    value = registration_rms_mm(contacts(), upright, TRUTH, dimension)
    assert value == pytest.approx(0.0, abs=1e-6)


def test_registration_error_grows_with_one_wrong_pose_and_is_less_than_the_shift() -> None:
    wrong = (*SAME[:2], TRUTH[2] * Pose3(Rot3(), np.array([0.02, 0.0, 0.0])) * OFFSET, *SAME[3:])
    value = registration_rms_mm(contacts(), wrong, TRUTH, 3)
    assert value is not None
    assert 5.0 < value < 20.0


def test_registration_needs_two_grasps_with_contacts() -> None:
    empty = [np.zeros((0, 3))] * 4
    assert registration_rms_mm([contacts()[0], *empty], SAME, TRUTH, 3) is None


def loop(relative: Pose3, *, accepted: bool = True) -> dict[str, object]:
    matrix = planar(relative).matrix().tolist()
    return {"earlier": 0, "later": 2, "accepted": accepted, "earlier_T_later": matrix}


UPRIGHT = tuple(pose * table_pose(0.02, 0.01, 0.6) for pose in TRUTH)
RIGHT = UPRIGHT[1].between(UPRIGHT[3])
ALIAS = RIGHT * table_pose(0.0, 0.0, np.pi)


def test_loop_that_took_another_face_is_wrong_and_noise_is_not() -> None:
    estimate = (None, *UPRIGHT[1:])
    noisy = RIGHT * table_pose(0.002, -0.001, 0.03)
    loops = [loop(RIGHT), loop(noisy), loop(ALIAS), loop(ALIAS, accepted=False)]
    assert wrong_loops(loops, estimate, TRUTH) == 1


def test_loops_without_truth_can_not_be_judged() -> None:
    estimate = (None, *UPRIGHT[1:])
    assert wrong_loops([loop(RIGHT)], estimate, (*TRUTH[:3], None, TRUTH[4])) is None
    assert wrong_loops([loop(RIGHT)], estimate, (None,) * 5) is None
    assert wrong_loops([], estimate, TRUTH) == 0


def test_drift_begins_at_the_grasp_whose_frames_are_aligned() -> None:
    """The first two grasps were not placed: from the third on the error grows by 2 mm each."""
    drifting = [pose.compose(Pose3(Rot3(), np.array([0.002 * i, 0.0, 0.0]))) for i, pose in enumerate(TRUTH[2:])]
    errors = pose_errors([None, None, *drifting], TRUTH)
    assert errors is not None
    assert errors.aligned_at == 2
    assert errors.drift_mm_per_grasp == pytest.approx(2.0)


def test_a_registration_error_at_the_limit_passes() -> None:
    assert registration_verdict(FAILURE_LIMIT_MM, None)[0]
    assert not registration_verdict(FAILURE_LIMIT_MM + 1e-6, None)[0]
