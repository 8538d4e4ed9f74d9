"""Estimating from recorded contacts as a library: what decides the settings, where truth goes, honest results."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from gtsam import Pose3

from drivers.core.contacts import FINGERS, Contact, Grasp
from drivers.core.errors import ConfigurationError
from sessions.exchange.contact_log import ContactLog, MotionSigma, ObjectTruth, write_contact_log
from tactile_lab.experiments.data.planar_data import PlanarGrasps, simulate
from tactile_lab.slam.result import SlamResult
from tactile_lab.slam.slam_settings import SlamSettings
from tactile_lab.slam.tactile_slam import TactileSlam
from tactile_lab.workflow.reconstructing import Wishes, log_settings, log_truth, reconstruct, reconstruct_log

DATA = simulate("rectangle", 3, count=6)
MOTION = MotionSigma(translation_m=0.004, rotation_rad=0.1)
TRUTH = ObjectTruth(name="rectangle", polygon_m=tuple(map(tuple, DATA.outline_m.tolist())))


def log(**changes: object) -> ContactLog:
    content = {"grasps": DATA.grasps, "motion_sigma": MOTION, "truth": TRUTH, "true_poses": DATA.world_T_body}
    return ContactLog(**{"dimension": 2, "point_sigma_m": 0.001, "normal_sigma_rad": 0.0873, **content, **changes})


def test_the_log_states_the_motion_model_and_the_file_and_the_options_go_before_it(tmp_path: Path) -> None:
    assert Wishes().apply(log_settings(log())).motion.translation_m == 0.004
    assert Wishes().apply(log_settings(log(motion_sigma=None))) == SlamSettings()
    (tmp_path / "mine.yaml").write_text(
        "method: icp\nparticles: 300\nmotion: {translation_m: 0.002, rotation_rad: 0.05}\n"
    )
    settings = Wishes(settings=tmp_path / "mine.yaml").apply(log_settings(log()))
    assert (settings.method, settings.particles, settings.motion.translation_m) == ("icp", 300, 0.002)
    assert Wishes("odometry", settings=tmp_path / "mine.yaml").apply({}).method == "odometry"


def test_a_motion_that_is_called_exact_keeps_some_play() -> None:
    exact = log(motion_sigma=MotionSigma(translation_m=0.0, rotation_rad=0.0))
    noise = Wishes().apply(log_settings(exact)).motion
    assert 0 < noise.translation_m < 1e-4
    assert 0 < noise.rotation_rad < 1e-3


@pytest.mark.parametrize("wishes", [Wishes("guess"), Wishes(dimension=4)])
def test_wishes_that_can_not_be_met_are_refused(wishes: Wishes) -> None:
    with pytest.raises(ConfigurationError, match="options"):
        wishes.apply({})


def test_the_outline_runs_counter_clockwise_whichever_way_the_log_has_it(tmp_path: Path) -> None:
    reversed_truth = replace_polygon(DATA.outline_m[::-1])
    found = log_truth(log(truth=reversed_truth), tmp_path).outline_m
    assert found is not None
    x, y = found.T
    assert np.sum(x * np.roll(y, -1) - y * np.roll(x, -1)) > 0
    with pytest.raises(ConfigurationError, match="fewer than three different points"):
        log_truth(log(truth=replace_polygon(np.zeros((4, 2)))), tmp_path)
    with pytest.raises(ConfigurationError, match=r"none\.ply: file not found"):
        log_truth(log(truth=ObjectTruth(mesh="none.ply")), tmp_path)


def test_an_outline_that_crosses_itself_is_no_truth(tmp_path: Path) -> None:
    bow = np.array([[0, 0], [0.1, 0.1], [0.1, 0], [0, 0.1]])
    with pytest.raises(ConfigurationError, match=r"object\.polygon_m: crosses itself"):
        log_truth(log(truth=replace_polygon(bow)), tmp_path)


def test_a_link_does_not_lead_out_of_the_folder_either(tmp_path: Path) -> None:
    (tmp_path / "elsewhere").mkdir()
    (tmp_path / "elsewhere" / "truth.ply").write_text("secret")
    (tmp_path / "logs").mkdir()
    (tmp_path / "logs" / "truth.ply").symlink_to(tmp_path / "elsewhere" / "truth.ply")
    with pytest.raises(ConfigurationError, match="leads out of the log's own folder"):
        log_truth(log(truth=ObjectTruth(mesh="truth.ply")), tmp_path / "logs")


def replace_polygon(points_m: np.ndarray) -> ObjectTruth:
    return ObjectTruth(polygon_m=tuple(map(tuple, points_m.tolist())))


def test_results_of_an_earlier_estimation_are_replaced_whole(tmp_path: Path) -> None:
    write_contact_log(tmp_path / "log.json", log())
    first = reconstruct_log(tmp_path / "log.json", Wishes("odometry"), tmp_path / "out")
    assert first.evaluation is not None
    assert (tmp_path / "out" / "contour.csv").is_file()
    thin = tuple(replace(grasp, contacts=grasp.contacts[:2]) for grasp in DATA.grasps)
    write_contact_log(tmp_path / "log.json", log(grasps=thin))
    second = reconstruct_log(tmp_path / "log.json", Wishes("odometry"), tmp_path / "out")
    assert second.evaluation is not None
    assert second.evaluation.status == "lost"
    assert not (tmp_path / "out" / "contour.csv").exists()


def test_a_name_is_looked_for_among_the_sessions(tmp_path: Path) -> None:
    with pytest.raises(ConfigurationError, match="no such session"):
        reconstruct("yesterday", tmp_path, Wishes())


# --- honest results ------------------------------------------------------------------------------------------------


def taken(grasps: tuple[Grasp, ...], **changes: object) -> SlamResult:
    slam = TactileSlam(SlamSettings.model_validate({"contour_resolution_m": 0.002, **changes}))
    for grasp in grasps:
        slam.add_grasp(grasp)
    return slam.finish()


def on_one_face(count: int) -> tuple[Grasp, ...]:
    rng = np.random.default_rng(0)

    def contact(finger: str, x_m: float) -> Contact:
        point = np.array([x_m, 0.03 + rng.normal(0, 0.001), 0.0])
        return Contact(finger, point, np.array([0.0, 1.0, 0.0]), 1e-6 * np.eye(3), 0.0873, 0.0)

    return tuple(
        Grasp(index, index, tuple(map(contact, FINGERS, np.sort(rng.uniform(-0.04, 0.04, 5)))), Pose3())
        for index in range(count)
    )


def largest_sigma_m(result: SlamResult) -> float:
    return np.inf if result.contour is None else float(np.percentile(result.contour.sigma_m, 95))


@pytest.mark.parametrize("method", ["joint", "particle", "icp", "odometry"])
def test_one_face_leaves_the_rest_uncertain(method: str) -> None:
    assert largest_sigma_m(taken(on_one_face(4), method=method, particles=2000)) > 0.005


def test_grasps_repeated_exactly_leave_the_rest_uncertain() -> None:
    again = tuple(replace(DATA.grasps[0], index=index, hand_motion_world=Pose3()) for index in range(4))
    assert largest_sigma_m(taken(again)) > 0.005


def test_grasps_that_are_not_numbers_are_lost_and_said_so() -> None:
    def broken(grasp: Grasp) -> Grasp:
        bad = replace(grasp.contacts[0], point_world_m=np.full(3, np.nan))
        return replace(grasp, contacts=(bad, *grasp.contacts[1:]))

    result = taken((DATA.grasps[0], *map(broken, DATA.grasps[1:])))
    assert result.status == "lost"
    assert all("NaN" in step.reason for step in result.steps[1:])


def test_millimetres_are_lost_and_said_so() -> None:
    def scaled(grasp: Grasp) -> Grasp:
        return replace(grasp, contacts=tuple(replace(c, point_world_m=1000 * c.point_world_m) for c in grasp.contacts))

    result = taken(tuple(map(scaled, DATA.grasps)))
    assert (result.status, result.contour) == ("lost", None)
    assert "m apart" in result.steps[0].reason


def inward(data: PlanarGrasps) -> tuple[Grasp, ...]:
    return tuple(
        replace(grasp, contacts=tuple(replace(one, normal_world=-one.normal_world) for one in grasp.contacts))
        for grasp in data.grasps
    )


@pytest.mark.parametrize("method", [pytest.param("joint", marks=pytest.mark.long), "particle"])
def test_inward_normals_that_reach_the_estimation_give_no_certain_shape(method: str) -> None:
    result = taken(inward(DATA), method=method, particles=2000)
    assert result.status == "lost" or largest_sigma_m(result) > 0.005


@pytest.mark.parametrize("method", ["joint", "particle", "thesis-pf-graph", "icp", "odometry"])
def test_a_single_grasp_and_an_empty_one_at_the_end_are_survived(method: str) -> None:
    assert taken(DATA.grasps[:1], method=method, particles=500).status == "partial"
    empty = replace(DATA.grasps[3], contacts=())
    result = taken((*DATA.grasps[:3], empty), method=method, particles=500)
    assert result.steps[3].verdict == "untracked"


def test_registration_of_a_lone_contact_says_nothing_on_the_terminal(capfd: pytest.CaptureFixture[str]) -> None:
    lone = replace(DATA.grasps[1], contacts=DATA.grasps[1].contacts[:1])
    taken((DATA.grasps[0], lone), method="icp")
    assert capfd.readouterr() == ("", "")
