"""Turns of an object about its own axis: which it has, and that they do not count in the registration."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from gtsam import Pose2, Pose3, Rot3

from drivers.core.poses import spatial
from tactile_lab.evaluation.registration import registration_rms_mm
from tactile_lab.evaluation.truth.rotational_symmetry import (
    ANY_TURN,
    modulo_symmetry,
    outline_symmetry,
    round_axis_m,
    symmetry_turns,
)
from tactile_lab.experiments.data.sensing import planar_pose
from tactile_lab.experiments.data.solids import DATA_VARIABLE, solid
from tactile_lab.experiments.data.spatial_data import simulate
from tactile_lab.slam.doubt.symmetry import Symmetry


@pytest.mark.parametrize(
    ("name", "turns"),
    [
        ("cylinder", ANY_TURN),
        ("sphere", ANY_TURN),
        ("bottle", ANY_TURN),
        ("hexagonal-prism", 6),
        ("cube-6", None),
        ("triangular-prism", None),
        ("elliptic-cylinder", None),
        ("mug", None),
        ("l-block", None),
    ],
)
def test_what_turns_leave_an_object_as_it_is(name: str, turns: int | None) -> None:
    assert symmetry_turns(solid(name).mesh) == turns


def test_eighths_of_a_turn_leave_an_octagon_as_it_is_and_ninths_do_not() -> None:
    angles = 2 * np.pi * np.arange(8) / 8
    found = outline_symmetry(0.042 * np.column_stack([np.cos(angles), np.sin(angles)]))
    assert found is not None
    assert found.order == 8


@pytest.mark.long  # quicker: what turns leave an object as it is
def test_a_dented_can_is_round(lab_data: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv(DATA_VARIABLE, str(lab_data))
    assert symmetry_turns(solid("ycb:tomato_soup_can").mesh) == ANY_TURN
    assert symmetry_turns(solid("ycb:mustard_bottle").mesh) is None


def test_turns_about_the_own_axis_do_not_count_but_shifts_do() -> None:
    data, rng = simulate("cylinder", 0, count=8), np.random.default_rng(0)
    contacts = [grasp.points_world_m for grasp in data.grasps]
    born = spatial(Pose2(0.01, -0.02, 0.7))

    def registration(shift_m: float) -> tuple[float, float]:
        slips = [planar_pose(shift_m * rng.normal(size=2), rng.normal(0.0, 1.0)) for _ in contacts]
        estimate = [pose * spatial(slip) * born for pose, slip in zip(data.world_T_body, slips, strict=True)]
        plain = registration_rms_mm(contacts, estimate, data.world_T_body, 3)
        told = modulo_symmetry(estimate, data.world_T_body, ANY_TURN)
        turned = registration_rms_mm(contacts, told, data.world_T_body, 3)
        assert plain is not None
        assert turned is not None
        return plain, turned

    plain, turned = registration(0.0)
    assert plain > 10.0
    assert turned < 1e-6
    _, turned = registration(0.004)
    assert 2.0 < turned < 8.0


def test_sixths_of_a_turn_do_not_count_but_what_is_left_of_a_turn_does() -> None:
    truth = [spatial(Pose2(0.0, 0.0, yaw_rad)) for yaw_rad in (0.0, 0.5, 1.0)]
    off_rad = (0.0, np.pi / 3 + 0.1, -2 * np.pi / 3 + 0.2)
    estimate = [pose * spatial(Pose2(0.0, 0.0, turn_rad)) for pose, turn_rad in zip(truth, off_rad, strict=True)]
    found = modulo_symmetry(estimate, truth, 6)
    left_rad = [(pose.inverse() * told).rotation().yaw() for pose, told in zip(truth, found, strict=True) if told]
    np.testing.assert_allclose(left_rad, (0.0, 0.1, 0.2), atol=1e-9)


def test_poses_that_are_not_known_or_do_not_stand_stay_as_they_are() -> None:
    lying = Pose3(Rot3.Rx(0.5), np.zeros(3))
    turned = Pose3(Rot3.Rz(1.0), np.zeros(3))
    assert modulo_symmetry([None, turned], [turned, None], ANY_TURN) == (None, turned)
    assert modulo_symmetry([turned, turned], [lying, turned], ANY_TURN) == (turned, turned)


def test_only_a_round_object_that_stands_has_an_axis_to_be_judged_by() -> None:
    centre_m, stands, lies = np.array([0.01, 0.02]), Pose3(), Pose3(Rot3.Rx(0.5), np.zeros(3))
    round_one = Symmetry(ANY_TURN, centre_m)
    np.testing.assert_array_equal(round_axis_m(round_one, [None, stands]), centre_m)
    assert round_axis_m(round_one, [stands, lies]) is None
    assert round_axis_m(Symmetry(6, centre_m), [stands]) is None
    assert round_axis_m(None, [stands]) is None


def test_sixths_of_a_turn_of_an_outline_do_not_count_wherever_its_frame_is() -> None:
    angles, centre_m = np.deg2rad(60.0 * np.arange(6)), np.array([0.03, -0.01])
    found = outline_symmetry(0.04 * np.column_stack([np.cos(angles), np.sin(angles)]) + centre_m)
    assert found is not None
    assert found.order == 6
    truth = [spatial(Pose2(0.1 * yaw_rad, 0.0, yaw_rad)) for yaw_rad in (0.0, 0.5, 1.0)]
    turns = [found.offset(number) for number in (0, 1, -2)]
    estimate = [pose * spatial(Pose2(*turn)) for pose, turn in zip(truth, turns, strict=True)]
    told = modulo_symmetry(estimate, truth, 6, found.centre_m)
    for pose, true in zip(told, truth, strict=True):
        assert pose is not None
        assert pose.equals(true, 1e-4)
    assert outline_symmetry(0.04 * np.array([[1.0, 1.0], [-1.0, 1.0], [-1.0, -1.0], [1.0, -1.0]])) is None
