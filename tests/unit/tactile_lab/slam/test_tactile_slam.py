"""Tactile SLAM as a whole: frames, verdicts, bad input, determinism, and that it tracks."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from gtsam import Pose2, Pose3, Rot3
from pydantic import ValidationError
from threadpoolctl import threadpool_limits

from drivers.core.contacts import ApproachPath, Grasp
from drivers.core.poses import palm_heading, spatial
from tactile_lab.experiments.data import spatial_data
from tactile_lab.experiments.data.carried_off import carried_off
from tactile_lab.experiments.data.planar_data import simulate
from tactile_lab.experiments.data.sensing import SimulatedGrasps
from tactile_lab.slam import current_shape
from tactile_lab.slam.result import SlamResult
from tactile_lab.slam.shape.metrics.metrics import contour_errors
from tactile_lab.slam.shape.surfaces.surface import Contour
from tactile_lab.slam.slam_settings import SlamSettings
from tactile_lab.slam.tactile_slam import TactileSlam
from tests.support.simulated_contacts import registration_mm


def settings(**changes: object) -> SlamSettings:
    return SlamSettings.model_validate({"contour_resolution_m": 0.002, **changes})


def run(data: SimulatedGrasps, seed: int = 0, **changes: object) -> SlamResult:
    slam = TactileSlam(settings(**changes), seed)
    for grasp in data.grasps:
        slam.add_grasp(grasp)
    return slam.finish()


def with_contacts(grasp: Grasp, keep: int) -> Grasp:
    return replace(grasp, contacts=grasp.contacts[:keep])


FOUR = simulate("rectangle", 3, count=4)


@pytest.mark.parametrize(("carried_m", "verdict"), [(0.0, "first"), (0.01, "untracked")])
def test_few_contacts_wait_for_more_while_the_object_stays(carried_m: float, verdict: str) -> None:
    first, motion = FOUR.grasps[0], Pose3(Rot3(), np.array([carried_m, 0.0, 0.0]))
    slam = TactileSlam(settings())
    assert slam.add_grasp(with_contacts(first, 2)).verdict == "untracked"
    step = slam.add_grasp(replace(first, index=1, contacts=first.contacts[2:4], hand_motion_world=motion))
    assert step.verdict == verdict
    assert step.contacts == (4 if verdict == "first" else 2)


@pytest.mark.parametrize("shape", ["rectangle", pytest.param("ellipse", marks=pytest.mark.long)])
def test_the_default_method_tracks_at_full_motion_noise(shape: str) -> None:
    data = simulate(shape, 1, count=6)
    result = run(data)
    assert result.status == "complete"
    assert registration_mm(data, result) < 4.0
    assert result.contour is not None
    body_T_object = data.world_T_body[0].between(result.world_T_object[0])
    fit = Pose2(body_T_object.x(), body_T_object.y(), body_T_object.rotation().yaw())
    assert contour_errors(result.contour.points_m, data.outline_m, fit).mean_distance_m < 0.006


def test_the_calibrated_filter_tracks_at_the_slip_of_the_rig() -> None:
    data = simulate("hexagon", 2, count=8, motion_scale=0.5)
    result = run(data, method="particle", particles=10_000)
    assert registration_mm(data, result) < 5.0
    assert all(1 < step.effective_count <= 10_000 for step in result.steps)


def test_the_thesis_s_filter_follows_an_object_that_hardly_slips() -> None:
    data = simulate("rectangle", 3, count=8, motion_scale=0.1)
    result = run(data, method="thesis-pf", motion={"translation_m": 0.001, "rotation_rad": 0.035}, particles=5_000)
    assert result.status == "complete"
    assert registration_mm(data, result) < 5.0


@pytest.mark.parametrize("matching", ["map", "previous"])
def test_the_thesis_s_likelihood_may_know_the_previous_grasp_alone(matching: str) -> None:
    result = run(simulate("ellipse", 3, count=4), method="thesis-pf", matching=matching, particles=1_000)
    assert len(result.world_T_object) == 4


def test_the_thesis_s_filter_runs_and_says_which_grasps_it_could_not_place() -> None:
    result = run(simulate("rectangle", 0, count=6), method="thesis-pf", particles=5_000)
    assert result.method == "thesis-pf"
    verdicts = {step.verdict for step in result.steps}
    assert verdicts <= {"first", "tracked", "uncertain", "untracked"}
    for step in result.steps:
        if step.verdict == "untracked":
            assert step.contacts_used == 0


def test_a_solid_is_followed_and_meshed() -> None:
    data = spatial_data.simulate("box-12x6x6", 1, count=5)
    result = run(data, dimension=3, mesh_resolution_m=0.01)
    assert registration_mm(data, result) < 6.0
    assert result.mesh is not None
    assert result.contour is None
    heights = [pose.z() for pose in result.world_T_object if pose is not None]
    assert np.allclose(heights, data.grasps[0].points_world_m[:, 2].mean())


def test_the_present_shape_is_made_once_and_again_after_the_next_grasp() -> None:
    slam = TactileSlam(settings())
    assert slam.shape(0.002) is None
    for grasp in FOUR.grasps[:3]:
        slam.add_grasp(grasp)
    outline = slam.shape(0.002)
    assert isinstance(outline, Contour)
    assert slam.shape(0.002) is outline
    assert slam.shape(0.004) is not outline
    slam.add_grasp(FOUR.grasps[3])
    later = slam.shape(0.002)
    assert isinstance(later, Contour)
    assert not np.array_equal(later.points_m, outline.points_m)


def test_the_object_frame_is_born_at_the_contacts_centre_along_the_palm() -> None:
    slam = TactileSlam(settings())
    grasp = FOUR.grasps[0]
    step = slam.add_grasp(grasp)
    assert step.verdict == "first"
    assert step.world_T_object is not None
    assert np.allclose(step.world_T_object.translation(), grasp.points_world_m.mean(axis=0), atol=1e-9)
    assert step.world_T_object.rotation().yaw() == pytest.approx(grasp.world_T_palm.rotation().yaw())


def test_a_palm_that_faces_down_gives_its_fingers_direction() -> None:
    forward = Pose3(Rot3(np.array([[0.0, 0, 1], [1, 0, 0], [0, 1, 0]])), np.zeros(3))
    assert palm_heading(forward) == pytest.approx(0.0)
    assert palm_heading(spatial(Pose2(0, 0, 0.7)).compose(forward)) == pytest.approx(0.7)
    assert palm_heading(spatial(Pose2(0, 0, 0.7))) == pytest.approx(0.7)


def test_results_are_the_same_for_a_seed() -> None:
    for method in ("joint", "particle"):
        first, second = (run(FOUR, method=method, particles=2_000) for _ in range(2))
        for one, other in zip(first.world_T_object, second.world_T_object, strict=True):
            assert np.array_equal(one.matrix(), other.matrix())
        assert np.array_equal(first.contour.points_m, second.contour.points_m)


def test_another_seed_draws_other_particles() -> None:
    first, second = (run(FOUR, seed, method="particle", particles=2_000) for seed in (0, 1))
    assert not np.array_equal(first.world_T_object[-1].matrix(), second.world_T_object[-1].matrix())


def test_grasps_before_the_object_frame_have_no_pose() -> None:
    slam = TactileSlam(settings())
    step = slam.add_grasp(with_contacts(FOUR.grasps[0], 2))
    assert step.verdict == "untracked"
    assert "2 contacts" in step.reason
    assert slam.world_T_object is None
    assert slam.surface is None
    slam.add_grasp(FOUR.grasps[1])
    result = slam.finish()
    assert result.world_T_object[0] is None
    assert result.world_T_object[1] is not None


@pytest.mark.long  # quicker: test_relocalization
def test_a_grasp_that_finds_its_place_at_the_end_is_not_lost() -> None:
    carried = carried_off(simulate("triangle", 5, count=9), 6, Pose3(Rot3.Rz(1.0), np.array([0.1, 0.02, 0.0])))
    slam = TactileSlam(settings(lost_after=1))
    for grasp in carried.grasps[:6]:
        slam.add_grasp(grasp)
    assert slam.add_grasp(carried.grasps[6]).verdict == "untracked"
    assert slam.is_lost
    assert slam.finish().status != "lost"


@pytest.mark.parametrize(("ends_m", "lost"), [((0.05, 0.05), False), ((0.05, -0.05), True)], ids=["touch", "closing"])
def test_touches_that_meet_nothing_do_not_lose_the_object_as_closings_do(ends_m: tuple[float, ...], lost: bool) -> None:
    slam = TactileSlam(settings(lost_after=2))
    slam.add_grasp(FOUR.grasps[0])
    ends = [np.array([end_m, 0.0, 0.02]) for end_m in ends_m]
    paths = tuple(ApproachPath(f, np.array([0.0, 0.0, 0.02]), end, False) for f, end in zip("FM", ends, strict=True))
    for grasp in FOUR.grasps[1:3]:
        slam.add_grasp(replace(with_contacts(grasp, 0), approach_paths=paths))
    assert slam.is_lost is lost


def test_a_session_without_any_contact_is_lost_but_finishes() -> None:
    slam = TactileSlam(settings())
    slam.add_grasp(with_contacts(FOUR.grasps[0], 0))
    result = slam.finish()
    assert result.status == "lost"
    assert result.contour is None
    assert result.world_T_object == (None,)
    assert TactileSlam(settings()).finish().status == "lost"


@pytest.mark.parametrize("method", ["joint", "particle", "thesis-pf-graph"])
def test_a_grasp_that_met_nothing_keeps_the_prediction_and_grows_uncertain(method: str) -> None:
    slam = TactileSlam(settings(method=method, particles=2_000, back_end={"enabled": False}))
    first = slam.add_grasp(FOUR.grasps[0])
    empty = with_contacts(FOUR.grasps[1], 0)
    step = slam.add_grasp(empty)
    assert step.verdict == "untracked"
    assert step.contacts_used == 0
    predicted = empty.hand_motion_world.compose(first.world_T_object)
    assert np.allclose(step.world_T_object.translation()[:2], predicted.translation()[:2], atol=0.002)
    assert step.covariance[0, 0] > 0.5e-4


@pytest.mark.parametrize("method", ["joint", "particle"])
def test_few_contacts_leave_a_large_uncertainty_and_are_survived(method: str) -> None:
    data = simulate("rectangle", 5, count=5, motion_scale=0.5)
    slam = TactileSlam(settings(method=method, particles=5_000), 0)
    for grasp in data.grasps:
        slam.add_grasp(with_contacts(grasp, 2 if grasp.index == 4 else 5))
    result = slam.finish()
    assert np.trace(result.steps[4].covariance) > np.trace(result.steps[3].covariance)
    assert registration_mm(data, result) < 8.0


@pytest.mark.long
def test_a_tenth_of_torn_contacts_is_survived() -> None:
    data = simulate("ellipse", 1, count=10, outlier_share=0.1)
    result = run(data)
    assert sum(step.contacts - step.contacts_used for step in result.steps) > 0
    assert result.contour is not None
    body_T_object = data.world_T_body[0].between(result.world_T_object[0])
    fit = Pose2(body_T_object.x(), body_T_object.y(), body_T_object.rotation().yaw())
    assert contour_errors(result.contour.points_m, data.outline_m, fit).mean_distance_m < 0.006


def test_an_object_that_jumps_away_does_not_spoil_the_shape() -> None:
    data = simulate("ellipse", 1, count=5)
    slam = TactileSlam(settings(), 0)
    for grasp in data.grasps:
        away = [replace(one, point_world_m=one.point_world_m + np.array([0.1, 0, 0])) for one in grasp.contacts]
        slam.add_grasp(replace(grasp, contacts=tuple(away)) if grasp.index >= 4 else grasp)
    result = slam.finish()
    assert result.steps[4].verdict in {"uncertain", "untracked"}
    assert result.steps[4].covariance[0, 0] > 10 * result.steps[3].covariance[0, 0]
    assert result.contour is not None
    assert np.ptp(result.contour.points_m, axis=0).max() < 0.11


@pytest.mark.parametrize("scale", [np.nan, np.inf, 1000.0])
def test_a_grasp_with_unusable_contacts_counts_as_one_without_contacts(scale: float) -> None:
    slam = TactileSlam(settings())
    slam.add_grasp(FOUR.grasps[0])
    before = slam.world_T_object
    broken = tuple(replace(one, point_world_m=scale * (one.point_world_m + 1.0)) for one in FOUR.grasps[1].contacts)
    broken = (replace(broken[0], point_world_m=broken[0].point_world_m * 1.5), *broken[1:])
    step = slam.add_grasp(replace(FOUR.grasps[1], contacts=broken))
    assert step.verdict == "untracked"
    assert "grasp 1" in step.reason
    assert slam.world_T_object.equals(FOUR.grasps[1].hand_motion_world * before, 1e-6)
    assert slam.add_grasp(FOUR.grasps[2]).verdict in {"tracked", "uncertain"}


def test_contacts_repeated_at_one_place_do_not_break_the_shape() -> None:
    grasp = FOUR.grasps[0]
    same = replace(grasp, contacts=tuple(replace(grasp.contacts[0], finger=one.finger) for one in grasp.contacts))
    slam = TactileSlam(settings())
    slam.add_grasp(same)
    slam.add_grasp(replace(same, index=1))
    assert slam.finish().world_T_object[1] is not None


def test_the_back_end_reports_its_loops() -> None:
    data = simulate("rectangle", 4, count=8, motion_scale=0.3)
    result = run(data, method="particle", particles=5_000)
    assert any(loop.accepted for loop in result.loops)
    assert all(loop.reason for loop in result.loops)


def test_the_joint_method_needs_normals_in_the_field() -> None:
    with pytest.raises(ValidationError, match="normals"):
        settings(method="joint", shape={"observations": "offsurface"})


def test_refused_grasp_is_taken_as_one_without_contacts() -> None:
    slam = TactileSlam(settings())
    slam.add_grasp(FOUR.grasps[0])
    bad = replace(FOUR.grasps[1].contacts[0], point_world_m=np.full(3, np.nan))
    step = slam.add_grasp(replace(FOUR.grasps[1], contacts=(bad,)))
    assert slam.step_count == 2
    assert step.contacts == 0
    assert "grasp 1" in step.reason


def test_the_number_of_threads_changes_nothing() -> None:
    data = simulate("rectangle", 5, count=2)
    results = []
    for threads in (1, 2):
        with threadpool_limits(threads):
            results.append(run(data, joint={"backwards": False}))
    for one, other in zip(results[0].world_T_object, results[1].world_T_object, strict=True):
        assert one is not None
        assert other is not None
        assert np.array_equal(one.matrix(), other.matrix())


def test_the_field_between_grasps_has_a_bounded_number_of_contacts(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(current_shape, "MOST_CONTACTS", 20)
    slam = TactileSlam(settings(method="odometry", joint={"window": 2}))
    counts = []
    for grasp in simulate("rectangle", 3, count=8).grasps:
        slam.add_grasp(grasp)
        field = slam.surface
        assert field is not None
        assert len(slam.surface_grasps) == len(field.contacts_m)
        counts.append(len(field.contacts_m))
    assert max(counts) == counts[-1] == 20
    assert slam.surface_grasps[-1] == slam.surface_grasps.max() == 2  # the settled ones, and the window
    outline = slam.shape(0.004)
    assert isinstance(outline, Contour)
    slam.finish()
    assert slam.surface is not None
    assert len(slam.surface.contacts_m) > 20  # at the end all of them count
