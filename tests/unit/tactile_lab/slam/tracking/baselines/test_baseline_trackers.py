"""The baselines that methods are measured between: known poses, odometry, registration."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from gtsam import Pose2, Pose3

from drivers.core.contacts import Array, Contact, Grasp
from drivers.core.errors import ConfigurationError
from drivers.core.poses import planar, spatial
from tactile_lab.evaluation.registration import registration_rms_mm
from tactile_lab.experiments.data import spatial_data
from tactile_lab.experiments.data.planar_data import simulate
from tactile_lab.experiments.data.sensing import SimulatedGrasps
from tactile_lab.experiments.touched_metrics import touched_figures
from tactile_lab.slam.result import SlamResult
from tactile_lab.slam.slam_settings import SlamSettings
from tactile_lab.slam.tactile_slam import TactileSlam
from tests.support.simulated_contacts import registration_mm


def run(data: SimulatedGrasps, method: str, known=None, **changes: object) -> SlamResult:
    slam = TactileSlam(
        SlamSettings.model_validate({"method": method, "contour_resolution_m": 0.002, **changes}), 0, known
    )
    for grasp in data.grasps:
        slam.add_grasp(grasp)
    return slam.finish()


DATA = simulate("rectangle", 3, count=8)
LITTLE_MOTION = {"translation_m": 0.001, "rotation_rad": 0.02}


def test_known_poses_place_every_grasp_where_the_object_was() -> None:
    result = run(DATA, "known-pose", DATA.world_T_body)
    assert registration_mm(DATA, result) < 1e-6
    assert result.status == "complete"
    assert result.loops == ()
    assert [step.verdict for step in result.steps] == ["first"] + ["tracked"] * 7


def test_known_poses_place_a_solid_too() -> None:
    data = spatial_data.simulate("box-12x6x6", 1, count=6)
    result = run(data, "known-pose", data.world_T_body, dimension=3, mesh_resolution_m=0.006)
    assert registration_mm(data, result) < 1e-6


@pytest.mark.parametrize("method", ["thesis-pf", "thesis-pf-graph"])
def test_the_filter_of_the_thesis_ends_a_session_in_space_with_doubts_of_its_own(method: str) -> None:
    """Eight grasps are enough to ask whether the object was exchanged, which compares contacts with the field."""
    data = spatial_data.simulate("box-12x6x6", 1, count=8, motion_scale=0.0)
    result = run(data, method, dimension=3, mesh_resolution_m=0.006, particles=200, motion=LITTLE_MOTION)
    assert registration_mm(data, result) < 5.0
    assert result.mesh is not None


@pytest.mark.long
def test_known_poses_keep_the_contacts_inside_a_cup() -> None:
    """A field that has seen the outside first has no room for a wall of 4 mm, and leaves the inside out."""
    data = spatial_data.simulate("cup", 7, count=24, motion_scale=0.1, heights="all")
    result = run(data, "known-pose", data.world_T_body, dimension=3, mesh_resolution_m=0.006)
    left_out = sum(step.contacts for step in result.steps) - len(result.surface.contacts_m)
    assert left_out < 10
    assert touched_figures(data, result)["touched_hausdorff_mm"] < 5


def test_a_grasp_whose_pose_is_not_known_is_kept_aside_and_the_next_ones_are_placed() -> None:
    poses = [None if index in {0, 3} else pose for index, pose in enumerate(DATA.world_T_body)]
    result = run(DATA, "known-pose", poses)
    assert result.world_T_object[0] is None
    assert result.steps[0].reason == "its true pose is not known"
    assert (result.steps[3].verdict, result.steps[3].contacts_used) == ("untracked", 0)
    assert result.steps[3].covariance[0, 0] > 100 * result.steps[4].covariance[0, 0]
    kept = [index for index in range(8) if index not in {0, 3}]
    points = [DATA.grasps[index].points_world_m for index in kept]
    found, true = ([poses[index] for index in kept] for poses in (result.world_T_object, DATA.world_T_body))
    assert registration_rms_mm(points, found, true, 2) < 1e-6


@pytest.mark.parametrize("poses", [None, [], [None, None]])
def test_known_pose_without_poses_is_refused(poses) -> None:
    with pytest.raises(ConfigurationError, match="needs the object's true poses"):
        TactileSlam(SlamSettings(method="known-pose"), 0, poses)


@pytest.mark.parametrize("method", ["joint", "particle", "thesis-pf", "thesis-pf-graph", "odometry", "icp"])
def test_no_other_method_takes_the_truth(method: str) -> None:
    with pytest.raises(ConfigurationError, match="must not be given the true poses"):
        TactileSlam(SlamSettings.model_validate({"method": method}), 0, DATA.world_T_body)


def test_odometry_is_exact_without_slip_and_adds_its_uncertainty_up() -> None:
    data = simulate("hexagon", 2, count=6, motion_scale=0.0)
    result = run(data, "odometry")
    assert registration_mm(data, result) < 1e-6
    variances = [step.covariance[2, 2] for step in result.steps]
    np.testing.assert_allclose(np.diff(variances), np.deg2rad(20.0) ** 2, rtol=1e-6)


def test_odometry_loses_the_object_at_full_motion_noise() -> None:
    assert registration_mm(DATA, run(DATA, "odometry")) > 10.0


def test_registration_improves_on_odometry_at_half_the_slip() -> None:
    better = 0
    for seed in range(3):
        data = simulate("rectangle", seed, count=12, motion_scale=0.5)
        motion = {"translation_m": 0.005, "rotation_rad": float(np.deg2rad(10.0))}
        registered, carried = (run(data, method, motion=motion) for method in ("icp", "odometry"))
        better += registration_mm(data, registered) < registration_mm(data, carried)
    assert better >= 2


def test_registration_finds_a_small_motion_of_a_well_known_object() -> None:
    data = simulate("rectangle", 1, count=10, motion_scale=0.0)
    slam = TactileSlam(SlamSettings(method="icp"))
    for grasp in data.grasps:
        slam.add_grasp(grasp)
    last = data.grasps[-1]
    away = spatial(Pose2(0.004, -0.003, 0.03))
    slam.add_grasp(replace(last, index=10, hand_motion_world=away.inverse()))
    found = slam.finish().world_T_object[-2:]
    between = planar(found[0].between(found[1]))
    assert np.hypot(between.x(), between.y()) < 0.004
    assert abs(between.theta()) < 0.03


SIDE_m, SIGMA_m = 0.05, 0.001


def square(larger_by_m: float = 0.0) -> Grasp:
    """Two contacts on each side of a square about a place on the table."""
    contacts = []
    for normal in (np.array(way) for way in ([1.0, 0, 0], [0, 1.0, 0], [-1.0, 0, 0], [0, -1.0, 0])):
        for along in (-0.015, 0.015):
            point = (SIDE_m / 2 + larger_by_m) * normal + along * np.cross([0, 0, 1.0], normal) + [0.4, 0.1, 0.03]
            contacts.append(Contact("FF", point, normal, SIGMA_m**2 * np.eye(3), 0.1, 1.0))
    return replace(DATA.grasps[0], contacts=tuple(contacts), hand_motion_world=Pose3())


def covariance_after(second: Grasp) -> tuple[Array, Array]:
    """Of a pose registered to a grasp of the square, and before: by odometry alone."""
    slam = TactileSlam(SlamSettings(method="icp"))
    first = slam.add_grasp(square())
    step = slam.add_grasp(replace(second, index=1))
    assert step.verdict == "tracked"
    return step.covariance, first.covariance + np.diag([0.01**2, 0.01**2, np.deg2rad(20.0) ** 2])


def told_by_distances(sigma_m: float) -> Array:
    """What eight distances along the square's normals tell: four along each axis, and levers of 15 mm."""
    return np.diag([4.0, 4.0, 8 * 0.015**2]) / sigma_m**2


def test_the_covariance_of_a_registered_pose_is_what_two_noisy_surfaces_tell() -> None:
    registered, before = covariance_after(square())
    told = told_by_distances(np.sqrt(2) * SIGMA_m)
    np.testing.assert_allclose(np.linalg.inv(registered), np.linalg.inv(before) + told, rtol=1e-3, atol=1.0)


def test_contacts_that_do_not_fit_the_map_tell_as_little_as_they_are_off() -> None:
    registered, before = covariance_after(square(larger_by_m=0.004))
    told = told_by_distances(0.004)
    np.testing.assert_allclose(np.linalg.inv(registered), np.linalg.inv(before) + told, rtol=0.05, atol=1.0)


def test_registration_of_contacts_far_from_all_others_leaves_odometry_and_stays_out_of_the_shape() -> None:
    slam = TactileSlam(SlamSettings(method="icp"))
    slam.add_grasp(DATA.grasps[0])
    far = [replace(one, point_world_m=one.point_world_m + np.array([0.3, 0.0, 0.0])) for one in DATA.grasps[1].contacts]
    step = slam.add_grasp(replace(DATA.grasps[1], contacts=tuple(far), hand_motion_world=Pose3()))
    assert (step.verdict, step.contacts_used) == ("untracked", 0)


def test_the_thesis_s_filter_comes_with_and_without_the_graph() -> None:
    data = simulate("rectangle", 4, count=5, motion_scale=0.2)
    alone, graph = (run(data, name, particles=3000) for name in ("thesis-pf", "thesis-pf-graph"))
    assert alone.loops == ()
    assert (alone.method, graph.method) == ("thesis-pf", "thesis-pf-graph")
