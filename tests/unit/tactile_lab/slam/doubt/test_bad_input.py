"""Sessions that cannot tell the whole object: each has its status and its sentence, and no shape that looks certain."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pytest
from gtsam import Pose2, Pose3, Rot3

from drivers.core.contacts import FINGERS, Contact, Grasp
from drivers.core.poses import spatial
from tactile_lab.experiments.data import planar_data
from tactile_lab.experiments.data.carried_off import carried_off
from tactile_lab.slam.result import SlamResult
from tactile_lab.slam.slam_settings import SlamSettings
from tactile_lab.slam.tactile_slam import TactileSlam

HALF_m = 0.045
OUTWARD = np.array([[1.0, 0.0], [0.0, 1.0], [-1.0, 0.0], [0.0, -1.0]])
"""Normals of the faces of a square of 90 mm."""


def grasps_on(faces: Sequence[int], seed: int, count: int, along_m: tuple[float, float] = (-0.04, 0.04)) -> list[Grasp]:
    """Grasps with contacts on some faces only; the object is carried about between them, and slips.

    Args:
        faces: touched by the fingers in turn.
        seed: of all random numbers.
        count: number of grasps.
        along_m: part of each face, counter-clockwise from its middle.
    """
    rng, made, pose = np.random.default_rng(seed), [], Pose2()
    for index in range(count):
        carried = Pose2(*(rng.normal(size=3) * [0.02, 0.02, 0.4])) if index else Pose2()
        slip = Pose2(*(rng.normal(size=3) * [0.004, 0.004, 0.12])) if index else Pose2()
        pose = carried.compose(pose).compose(slip)
        contacts = tuple(_touch(finger, faces[i % len(faces)], pose, rng, along_m) for i, finger in enumerate(FINGERS))
        made.append(Grasp(index, index, contacts, spatial(pose), spatial(carried)))
    return made


def _touch(
    finger: str, face: int, world_T_object: Pose2, rng: np.random.Generator, along_m: tuple[float, float]
) -> Contact:
    normal = OUTWARD[face]
    along = np.array([-normal[1], normal[0]])
    point = HALF_m * normal + rng.uniform(*along_m) * along + 0.001 * rng.normal(size=2)
    turned = Pose2(0.0, 0.0, 0.087 * rng.normal()).rotation().matrix() @ normal
    facing = world_T_object.rotation().matrix() @ turned
    return Contact(finger, np.array([*world_T_object.transformFrom(point), 0.02]), np.array([*facing, 0.0]))


def result_of(grasps: Sequence[Grasp]) -> SlamResult:
    motion = {"translation_m": 0.004, "rotation_rad": 0.12}
    slam = TactileSlam(SlamSettings.model_validate({"motion": motion, "joint": {"backwards": False}}), 0)
    for grasp in grasps:
        slam.add_grasp(grasp)
    return slam.finish()


@pytest.mark.parametrize(
    ("faces", "along_m", "share"),
    [((0, 1), (0.03, 0.044), 0.8), ((0,), (-0.04, 0.04), 0.5), ((0, 2), (-0.04, 0.04), 0.7)],
    ids=["corner", "one face", "two opposite faces"],
)
def test_a_part_of_the_outline_gives_a_partial_result_that_names_the_unknown_end(
    faces: tuple[int, ...], along_m: tuple[float, float], share: float
) -> None:
    result = result_of(grasps_on(faces, seed=3, count=4, along_m=along_m))
    assert result.status == "partial"
    assert result.known_share is not None
    assert result.known_share < share
    assert any("was not touched" in doubt.words for doubt in result.doubts)
    if result.contour is not None:
        assert result.contour.known is not None
        assert result.contour.sigma_m[~result.contour.known].min() >= 0.005


def test_one_grasp_is_partial_because_nothing_confirms_it() -> None:
    result = result_of(grasps_on((0, 1, 2, 3), seed=4, count=1))
    assert result.status == "partial"
    assert any("nothing confirms the shape" in doubt.words for doubt in result.doubts)
    assert result.contour is not None
    assert result.known_share is not None
    assert result.known_share < 0.8
    assert np.quantile(result.contour.sigma_m, 0.95) > 0.010


@pytest.mark.long
def test_two_objects_one_after_the_other_in_one_log_are_told_with_the_first_grasp_of_the_second() -> None:
    first = planar_data.simulate("rectangle", 3001, count=7).grasps
    second = planar_data.simulate("triangle", 3002, count=7).grasps
    slam = TactileSlam(SlamSettings(), 0)
    for index, grasp in enumerate((*first, *second)):
        slam.add_grasp(replace(grasp, index=index))
    result = slam.finish()
    assert result.status == "ambiguous"
    (told,) = [doubt for doubt in result.doubts if doubt.name == "other-object"]
    assert told.grasps[0] == 7
    assert "is it another object" in told.words


@pytest.mark.long
def test_a_truth_that_moved_is_told_with_the_grasp_before_which_it_did() -> None:
    jump = Pose3(Rot3.Rz(1.0), np.array([0.05, 0.02, 0.0]))
    result = TactileSlam(SlamSettings(), 0)
    for grasp in carried_off(planar_data.simulate("rectangle", 3001, count=10), 6, jump).grasps:
        result.add_grasp(grasp)
    found = result.finish()
    assert found.status == "ambiguous"
    (told,) = [doubt for doubt in found.doubts if doubt.name == "jump"]
    assert told.grasps == (6,)
    assert "did it fall, was it moved or exchanged?" in told.words
