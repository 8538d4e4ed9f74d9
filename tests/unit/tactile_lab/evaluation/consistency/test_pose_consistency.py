"""Coverage of stated pose covariances, on errors drawn from the stated distribution."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest
from gtsam import Pose3, Rot3

from drivers.core.contacts import Array
from drivers.core.rotations import exponential, logarithm
from tactile_lab.evaluation.consistency.figures import PoseFigures, common_covariances
from tactile_lab.evaluation.consistency.levels import LEVELS
from tactile_lab.evaluation.consistency.pose_covariance import covariance_in_world, pose_deviation
from tactile_lab.evaluation.consistency.poses import birth_frame, common_frame, pose_consistency
from tactile_lab.evaluation.truth.rotational_symmetry import ANY_TURN, modulo_symmetry

OBJECT_FRAME = Pose3(Rot3.Rz(0.7), np.array([0.02, -0.01, 0.0]))
"""The truth's object frame in the estimate's."""
STATED = np.diag([4e-6, 1e-6, 1e-4])
GRASPS = 400


def moved(pose: Pose3, error: Array) -> Pose3:
    """A pose with an error of position and rotation in the world, shape (6,)."""
    return Pose3(Rot3(exponential(error[3:]) @ pose.rotation().matrix()), pose.translation() + error[:3])


def drawn(factor: float) -> tuple[list[Pose3], list[Pose3]]:
    """Estimates and truths on a table; the first estimate is exact, the others have the stated errors by a factor."""
    rng = np.random.default_rng(7)
    errors = factor * rng.multivariate_normal(np.zeros(3), STATED, GRASPS)
    errors[0] = 0.0
    born = [Pose3(Rot3.Rz(turn), np.array([x, y, 0.03])) for x, y, turn in rng.normal(size=(GRASPS, 3))]
    told = [moved(pose, np.array([x, y, 0, 0, 0, turn])) for pose, (x, y, turn) in zip(born, errors, strict=True)]
    return told, [pose * OBJECT_FRAME for pose in born]


@pytest.mark.parametrize("frame", [birth_frame, common_frame])
def test_true_covariances_hold_the_truth_as_often_as_they_say(frame: object) -> None:
    told, truth = drawn(1.0)
    stated = [covariance_in_world(pose, STATED) for pose in told]
    assert callable(frame)
    found = pose_consistency(told, stated, truth, frame(told, truth))
    assert found is not None
    assert found.components == 3
    assert found.inside == pytest.approx(LEVELS, abs=0.06)
    assert np.mean(found.nees) == pytest.approx(1.0, abs=0.1)


def test_of_a_round_object_the_place_of_its_axis_is_judged_alone() -> None:
    told, truth = drawn(1.0)
    axis_m = np.array([0.015, -0.02])
    told = list(modulo_symmetry(told, truth, ANY_TURN, axis_m))
    stated = [covariance_in_world(pose, STATED) for pose in told if pose is not None]
    frame = birth_frame(told, truth)
    with_turns = pose_consistency(told, stated, truth, frame)
    found = pose_consistency(told, stated, truth, frame, axis_m)
    assert found is not None
    assert with_turns is not None
    assert found.components == 2
    assert found.inside == pytest.approx(LEVELS, abs=0.06)
    assert with_turns.inside[1] > 0.78  # the turn has no error by then, and is stated all the same


def test_covariances_that_are_too_small_are_seen_and_score_lower() -> None:
    told, truth = drawn(1.0)
    frame = birth_frame(told, truth)
    honest, bold = (
        pose_consistency(told, [covariance_in_world(pose, scale * STATED) for pose in told], truth, frame)
        for scale in (1.0, 0.1)
    )
    assert honest is not None
    assert bold is not None
    assert bold.inside[2] < 0.5 < honest.inside[2]
    assert bold.log_score < honest.log_score
    assert np.mean(bold.nees) == pytest.approx(10 * np.mean(honest.nees))


def test_the_given_birth_pose_and_unknown_ones_do_not_count() -> None:
    told, truth = drawn(1.0)
    stated = [1e-10 * np.eye(6), None, covariance_in_world(told[2], STATED)]
    found = pose_consistency(told[:3], stated, truth[:3], birth_frame(told[:3], truth[:3]))
    assert found is not None
    assert len(found.nees) == 1


def test_errors_count_in_standard_deviations_of_the_components_that_were_estimated() -> None:
    """On a table one is off by two sigma in x, in space one by a sigma in all six; another covariance is void."""
    variances = np.array([1e-6, 4e-6, 9e-6, 1e-4, 4e-4, 9e-4])
    on_table = covariance_in_world(Pose3(), np.diag(variances[[0, 1, 5]]))
    void = np.diag(variances)
    void[0, 1] = void[1, 0] = 3e-6
    errors = [np.zeros(6), np.array([0.002, 0, 0, 0, 0, 0]), np.sqrt(variances), np.zeros(6)]
    told = [moved(Pose3(), error) for error in errors]
    found = pose_consistency(told, [1e-12 * np.eye(6), on_table, np.diag(variances), void], [Pose3()] * 4, Pose3())
    assert found is not None
    assert found.nees == pytest.approx((4 / 3, 1.0), rel=1e-3)
    assert found.components == 6
    assert found.inside == (0.0, 0.5, 1.0)  # chi square: 4 is beyond 3.5 of three components, 6 within 7.0 of six
    table, space = (
        -0.5 * (squared + np.sum(np.log(2 * np.pi * of)))
        for squared, of in ((4.0, variances[[0, 1, 5]]), (6.0, variances))
    )
    assert found.log_score == pytest.approx((table + space) / 2, rel=1e-4)
    assert PoseFigures.of(found) == PoseFigures(2, pytest.approx(7 / 6, rel=1e-3), found.inside, found.log_score)
    assert PoseFigures.of(None) is None


def test_covariances_of_the_common_frame_are_those_stated_of_known_poses() -> None:
    stated = [STATED.tolist(), None, STATED.tolist()]
    trajectory = SimpleNamespace(world_T_object=(Pose3(), Pose3(), None))
    results = SimpleNamespace(slam={"common_covariances": stated}, trajectory=trajectory)
    first, *others = common_covariances(results)  # type: ignore[arg-type]
    np.testing.assert_array_equal(first, covariance_in_world(Pose3(), STATED))
    assert others == [None, None]
    assert common_covariances(SimpleNamespace(slam={}, trajectory=trajectory)) == ()  # type: ignore[arg-type]


def test_without_the_birth_grasps_truth_only_the_common_frame_is_known() -> None:
    told, truth = drawn(0.0)
    unseen = [None, *truth[1:5]]
    assert birth_frame(told[:5], unseen) is None
    frame = common_frame(told[:5], unseen)
    assert frame is not None
    assert frame.equals(OBJECT_FRAME, 1e-9)
    assert pose_consistency(told[:5], [], unseen, frame) is None


def test_a_covariance_in_space_is_that_of_small_rotations_of_the_world() -> None:
    rng = np.random.default_rng(3)
    vector = np.array([0.5, -1.1, 2.0])
    pose = Pose3(Rot3(exponential(vector)), np.array([0.1, 0.2, 0.3]))
    chart = 1e-8 * np.diag([1.0, 2.0, 3.0, 400.0, 500.0, 600.0])
    steps = rng.multivariate_normal(np.zeros(6), chart, 4000)
    shaken = [Pose3(Rot3(exponential(vector + step[3:])), pose.translation() + step[:3]) for step in steps]
    seen = np.cov(np.array([pose_deviation(one, pose) for one in shaken]).T)
    expected = covariance_in_world(pose, chart)
    assert seen == pytest.approx(expected, abs=0.1 * expected.diagonal().max())
    assert logarithm(pose.rotation().matrix()) == pytest.approx(vector)
