from __future__ import annotations

import json

import cv2
import numpy as np
import pytest
from gtsam import Pose3, Rot3

from calibration.forearm.hand_eye import solve_ax_xb, solve_ax_zb
from calibration.forearm.pair_problem import PairNoise, PairProblem
from calibration.forearm.recordings import ForearmData, load_data
from calibration.forearm.wizard import WizardSettings, solve_forearm
from calibration.steps.motion_check import check_pairs
from calibration.steps.observations import PosePair
from calibration.steps.quality import region_holds
from drivers.core.errors import ConfigurationError

HAND_T_TARGET = Pose3.Expmap(np.array([0.3, -0.2, 0.5, 0.02, 0.05, -0.03]))
MOUNT_T_CAMERA = Pose3.Expmap(np.array([-1.0, 0.4, 0.2, 0.6, -0.2, 0.8]))


def pairs(turns: np.ndarray, noise_m: float = 0.0, seed: int = 0) -> tuple[PosePair, ...]:
    """Pairs with the hand turned by rotation vectors (n, 3), at places drawn at random."""
    rng = np.random.default_rng(seed)
    hands = [Pose3(Rot3.Expmap(turn), rng.uniform(-0.2, 0.2, 3)) for turn in turns]
    shaken = [Pose3.Expmap(noise_m * rng.standard_normal(6)) for _ in hands]
    return tuple(
        PosePair(hand, MOUNT_T_CAMERA.inverse() * hand * HAND_T_TARGET * noise)
        for hand, noise in zip(hands, shaken, strict=True)
    )


def turns(count: int = 12, size: float = 0.6, seed: int = 1) -> np.ndarray:
    return size * np.random.default_rng(seed).standard_normal((count, 3))


@pytest.mark.parametrize("solve", [solve_ax_xb, solve_ax_zb])
@pytest.mark.parametrize("seed", range(5))
def test_closed_forms_are_exact_without_noise(solve, seed):
    exact = pairs(turns(seed=seed))
    found = solve([pair.mount_T_hand for pair in exact], [pair.camera_T_target for pair in exact])
    assert found.mount_T_camera.equals(MOUNT_T_CAMERA, 1e-8)
    assert found.hand_T_target.equals(HAND_T_TARGET, 1e-8)


def test_the_real_pairs_give_the_known_answer_with_residuals_of_every_pair(lab_data):
    data = load_data(lab_data / "hand_eye_pairs" / "pose_samples.json")
    result = solve_forearm(data)
    mount_T_camera = result.solution.world_T_mount.inverse()
    assert np.linalg.norm(mount_T_camera.translation() - [0.659, -0.249, 0.830]) < 0.002
    assert len(result.quality.residuals) == 50
    assert all(np.isfinite(residual.distance_m) for residual in result.quality.residuals)
    assert 0.0 < result.quality.repeat_m < 0.001


def test_outlying_pairs_are_named_and_do_not_move_the_answer():
    good = list(pairs(turns(20), noise_m=5e-4))
    good[3] = PosePair(good[3].mount_T_hand, good[3].camera_T_target * Pose3(Rot3(), np.array([0.05, 0, 0])))
    result = solve_forearm(ForearmData(pairs=tuple(good)))
    assert result.quality.outliers == ("pair 4",)
    without = PairProblem(good[:3] + good[4:]).solve()
    moved = without.world_T_mount.inverse().translation() - result.solution.world_T_mount.inverse().translation()
    assert np.linalg.norm(moved) < 2e-4
    assert region_holds(result.solution, MOUNT_T_CAMERA.inverse())


def test_rotations_that_are_too_small_are_refused_where_opencv_gives_an_answer_all_the_same():
    small = pairs(turns(size=0.002), noise_m=5e-4)
    hands, targets = ([getattr(pair, name) for pair in small] for name in ("mount_T_hand", "camera_T_target"))
    rotation, _ = cv2.calibrateHandEye(
        [pose.rotation().matrix().T for pose in hands],
        [-pose.rotation().matrix().T @ pose.translation() for pose in hands],
        [pose.rotation().matrix() for pose in targets],
        [pose.translation() for pose in targets],
        method=cv2.CALIB_HAND_EYE_TSAI,
    )
    assert np.isfinite(rotation).all()  # it answers, with the identity or with noise
    with pytest.raises(ConfigurationError, match=r"largest rotation between two poses .* turn the hand farther"):
        solve_forearm(ForearmData(pairs=small))


def test_poses_all_about_one_axis_are_refused_with_the_axis():
    one_axis = pairs(np.outer(np.linspace(-1.5, 1.5, 12), [0.0, 0.0, 1.0]))
    with pytest.raises(ConfigurationError, match=r"about one axis, \(0\.00, 0\.00, 1\.00\) of the hand"):
        solve_forearm(ForearmData(pairs=one_axis))


def with_print(larger: float, seed: int) -> tuple[PosePair, ...]:
    """Pairs of a program that took the print to be smaller than it is by this share."""
    seen = pairs(turns(20, seed=seed), noise_m=1e-3, seed=seed)
    return tuple(
        PosePair(
            pair.mount_T_hand,
            Pose3(pair.camera_T_target.rotation(), pair.camera_T_target.translation() / (1.0 + larger)),
        )
        for pair in seen
    )


@pytest.mark.parametrize(
    "larger", [0.002, *(pytest.param(each, marks=pytest.mark.long) for each in (0.0, 0.005, 0.02))]
)
def test_a_print_of_another_size_leaves_the_region_honest(larger):
    solutions = [PairProblem(with_print(larger, seed)).solve() for seed in range(40)]
    held = sum(region_holds(solution, MOUNT_T_CAMERA.inverse()) for solution in solutions)
    assert 36 <= held <= 40
    found = [solution.numbers["print_larger_share"] for solution in solutions]
    assert np.median(found) == pytest.approx(larger, abs=5e-4)
    assert max(solution.numbers["print_larger_sigma"] for solution in solutions) < 2e-3


def test_the_closed_forms_stand_beside_the_refined_answer():
    told = {larger: PairProblem(with_print(larger, 2)).solve().numbers for larger in (0.0, 0.02)}
    for form in ("shah", "park_martin"):
        assert told[0.0][f"{form}_mm_away"] < 5.0
        assert told[0.02][f"{form}_mm_away"] > 10.0  # they take the print at its word
        assert told[0.02][f"{form}_deg_away"] < 1.0


def test_pairs_that_contradict_a_stated_print_are_refused():
    known = PairNoise(print_scale_sigma=0.001)
    assert PairProblem(with_print(0.001, 1), known).solve().numbers["print_larger_share"] == pytest.approx(
        0.001, abs=2e-3
    )
    with pytest.raises(
        ConfigurationError, match=r"the print is \+2\.\d+ % larger .* known to 0\.1 %.* Measure the printed"
    ):
        PairProblem(with_print(0.02, 1), known).solve()


def test_too_few_poses_are_refused():
    with pytest.raises(ConfigurationError, match="pose pairs 5 of 8 needed: add more"):
        solve_forearm(ForearmData(pairs=pairs(turns(5))))


def test_enough_motion_is_told_too():
    report = check_pairs(pairs(turns()))
    assert report.ok
    assert report.missing == ()
    assert "12 of 8 needed" in str(report.checks[0])


def test_limits_of_pairs_may_be_set():
    strict = WizardSettings.model_validate({"limits": {"residual_mm": 1e-6}})
    noisy = ForearmData(pairs=pairs(turns(20), noise_m=5e-4))
    assert not solve_forearm(noisy, strict).quality.passed
    assert solve_forearm(noisy).quality.passed


@pytest.mark.parametrize(
    ("content", "words"),
    [
        ("[[[[1,0,0,0],[0,1,0,0],[0,0,1,0],[0,0,0,1]]]]", "at least 2 items|Field required|is missing"),
        (
            "[[[[2,0,0,0],[0,1,0,0],[0,0,1,0],[0,0,0,1]],[[1,0,0,0],[0,1,0,0],[0,0,1,0],[0,0,0,1]]]]",
            "not a rigid motion",
        ),
        ("{}", "no known kind of observations"),
        ("not json", "is not JSON"),
        (json.dumps({"format": "tactile-forearm-data/1", "rig": "x"}), "needs either touches or views"),
    ],
)
def test_files_that_hold_no_observations_are_refused(tmp_path, content, words):
    path = tmp_path / "data.json"
    path.write_text(content)
    with pytest.raises(ConfigurationError, match=words):
        load_data(path)
