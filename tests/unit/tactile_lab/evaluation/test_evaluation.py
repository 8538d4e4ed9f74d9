"""The evaluation of a session: figures, nulls, status."""

from __future__ import annotations

import json
import shutil
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import trimesh
from gtsam import Pose3, Rot3

from drivers.core.contacts import Grasp
from drivers.core.errors import SessionError, ShapeError
from sessions.recording.session_events import EventKind, SessionEvent
from sessions.recording.traffic.reader import TrafficMessage
from tactile_lab.evaluation.estimate_with_truth import Truth, true_outline
from tactile_lab.evaluation.evaluation import Evaluation, evaluate
from tactile_lab.evaluation.files.result_files import write_results
from tactile_lab.evaluation.files.results import read_results
from tactile_lab.evaluation.shape import horizontal_outline
from tactile_lab.evaluation.table import evaluation_rows
from tactile_lab.evaluation.truth.session_truth import marked_pictures
from tactile_lab.experiments.data.planar_data import PlanarGrasps, simulate
from tactile_lab.slam.slam_settings import SlamSettings
from tactile_lab.slam.tactile_slam import TactileSlam
from tests.support.synthetic_grasps import GRASPS, Recorded, SIZE_m, box_grasps, result_of


@pytest.fixture(scope="module")
def recorded() -> Recorded:
    return box_grasps()


@pytest.fixture(scope="module", params=[2, 3])
def results(request: pytest.FixtureRequest, recorded: Recorded, tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("results")
    write_results(folder, result_of(request.param), recorded.grasps)
    return folder


def full_truth(recorded: Recorded) -> Truth:
    return Truth(recorded.truth, trimesh.creation.box(SIZE_m))


@pytest.fixture(scope="module")
def evaluation(results: Path, recorded: Recorded) -> Evaluation:
    return evaluate(results, full_truth(recorded), "box")


def test_keys_are_those_of_the_design(evaluation: Evaluation) -> None:
    content = evaluation.as_json()
    assert {"schema_version", "method", "seed", "object", "grasps", "contacts", "shape", "pose"} <= set(content)
    assert {"loops", "time", "status", "aligned", "shape_best_fit", "registration_rms_mm", "failed"} <= set(content)
    figures = {"hausdorff_mm", "mean_distance_mm", "chamfer_mm", "fscore_1mm", "fscore_2mm", "iou"}
    assert set(content["shape"]) == set(content["shape_best_fit"]) == figures
    assert {"rmse_mm", "rmse_deg", "final_mm", "final_deg", "per_grasp"} <= set(content["pose"])
    assert set(content["loops"]) == {"tested", "accepted", "wrong"}
    assert set(content["time"]) == {"total_s", "step_ms_median", "step_ms_p95"}
    assert content["aligned"] == "first_grasp"


def test_figures_of_a_gentle_session_are_small(evaluation: Evaluation) -> None:
    assert evaluation.status in ("complete", "partial", "ambiguous")
    assert evaluation.pose is not None
    assert evaluation.pose.rmse_mm < 6.0
    assert evaluation.shape_best_fit is not None
    assert evaluation.shape_best_fit.mean_distance_mm < 12.0
    assert evaluation.registration_rms_mm is not None
    assert evaluation.failed is (evaluation.registration_rms_mm > 5.0)
    assert (evaluation.grasps, evaluation.contacts) == (GRASPS, 5 * GRASPS)


def test_contacts_with_half_a_millimetre_of_noise_are_that_far_from_the_true_surface(evaluation: Evaluation) -> None:
    assert evaluation.sensing is not None
    assert 0.1 < evaluation.sensing.median_mm < 0.6
    assert evaluation.sensing.median_mm < evaluation.sensing.p95_mm < 1.6


def test_best_fit_is_no_worse_on_average_than_the_first_grasp(evaluation: Evaluation) -> None:
    assert evaluation.shape is not None
    assert evaluation.shape_best_fit is not None
    assert evaluation.shape_best_fit.mean_distance_mm <= evaluation.shape.mean_distance_mm + 0.2


def test_file_is_strict_json_and_repeatable(results: Path, recorded: Recorded, evaluation: Evaluation) -> None:
    def refuse(word: str) -> None:
        raise AssertionError(word)

    assert json.loads(evaluation.as_text(), parse_constant=refuse) == evaluation.as_json()
    assert evaluate(results, full_truth(recorded), "box").as_text() == evaluation.as_text()


def test_unseen_grasps_are_counted_and_null(results: Path, recorded: Recorded) -> None:
    seen = (recorded.truth[0], None, *recorded.truth[2:])
    content = evaluate(results, Truth(seen), "box").as_json()
    assert content["truth"] == {"seen": GRASPS - 1, "missing": 1, "mesh": False}
    assert content["pose"]["per_grasp"][1] is None
    assert content["shape"] is None
    assert content["shape_best_fit"] is None
    assert content["sensing"] is None


def test_without_any_truth_everything_that_needs_it_is_null(results: Path) -> None:
    content = evaluate(results, Truth((None,) * GRASPS), "box").as_json()
    assert content["pose"] is None
    assert content["registration_rms_mm"] is None
    assert content["failed"] is None
    assert content["status"] in ("complete", "partial", "ambiguous")


def test_mesh_without_sightings_gives_the_best_fit_alone(results: Path, recorded: Recorded) -> None:
    content = evaluate(results, Truth((None,) * GRASPS, trimesh.creation.box(SIZE_m)), "box").as_json()
    assert content["shape"] is None
    assert content["shape_best_fit"]["hausdorff_mm"] > 0.0


def test_truth_of_another_session_is_refused(results: Path, recorded: Recorded) -> None:
    with pytest.raises(SessionError, match="5 grasps in the results, 4 in the session"):
        evaluate(results, Truth(recorded.truth[:4]), "box")


def test_lost_object_is_a_failure_whatever_the_registration(results: Path, recorded: Recorded, tmp_path: Path) -> None:
    for path in results.iterdir():
        (tmp_path / path.name).write_bytes(path.read_bytes())
    slam = tmp_path / "slam.json"
    slam.write_text(json.dumps({**json.loads(slam.read_text()), "status": "lost"}))
    assert evaluate(tmp_path, Truth(recorded.truth), "box").failed is True


def test_section_is_at_the_contacts_height_in_the_object(results: Path, recorded: Recorded) -> None:
    cone = trimesh.creation.cone(radius=0.05, height=0.06, sections=64)
    cone.apply_translation([0.0, 0.0, -0.03])
    outline = true_outline(read_results(results), Truth(recorded.truth, cone))
    assert outline is not None
    points = np.concatenate([grasp.points_world_m for grasp in recorded.grasps])
    radius = 0.05 * (1 - (points[:, 2].mean() - 0.02 + 0.03) / 0.06)
    assert np.linalg.norm(outline, axis=1).max() == pytest.approx(radius, rel=0.02)


def test_section_beyond_the_mesh_is_taken_at_its_end_and_an_open_mesh_is_told() -> None:
    box = trimesh.creation.box(SIZE_m)
    assert np.ptp(horizontal_outline(box, 1.0), axis=0) == pytest.approx(SIZE_m[:2])
    sheet = trimesh.Trimesh([[0, 0, 0], [1, 0, 0], [0, 0, 1]], [[0, 1, 2]])
    with pytest.raises(ShapeError, match="no closed section"):
        horizontal_outline(sheet, 0.5)


def test_rows_for_people_show_dashes_for_what_is_unknown(results: Path) -> None:
    content = evaluate(results, Truth((None,) * GRASPS), "box").as_json()
    rows = {row.label: row for row in evaluation_rows(content)}
    assert rows["Hausdorff distance"].value == "\u2013"
    assert rows["Registration error"].note == "needs the true pose at two grasps"
    assert rows["Contacts"].value == str(5 * GRASPS)
    assert rows["Marker sightings"].note == f"{GRASPS} grasps without one"


@pytest.mark.parametrize(
    ("shared_mm", "said"), [(0.44, "0.44 of the 0.52 mm of sigma is one error a finger"), (0.2, ""), (None, "")]
)
def test_a_surface_whose_sigma_fingers_share_is_called_one_draw(shared_mm: float | None, said: str) -> None:
    surface = {"inside": [1.0, 1.0, 1.0], "log_score": 6.6, "signed_mm": 0.07}
    content = {
        "consistency": {"levels": [0.5, 0.68, 0.95], "surface": surface},
        "uncertainty": {"sigma_mm_median": 0.52, "sigma_mm_p95": 0.55, "shared_sigma_mm": shared_mm},
    }
    (row,) = (row for row in evaluation_rows(content) if row.label == "Surface inside")
    assert said in row.note
    assert ("one draw" in row.note) is bool(said)


def message(topic: str, data: bytes, number: int) -> TrafficMessage:
    return TrafficMessage(topic, data, 1000 * number, number)


def traffic(*events: EventKind | bytes) -> list[TrafficMessage]:
    found = []
    for number, event in enumerate(events):
        if isinstance(event, bytes):
            found.append(message("/link/camera/rx", event, number))
        else:
            found.append(message("/marks", SessionEvent(event, 1000 * number).to_bytes(), number))
    return found


def test_marked_picture_belongs_to_the_open_or_else_the_last_grasp() -> None:
    begin, end, event = EventKind.CAPTURE_BEGIN, EventKind.CAPTURE_END, EventKind.TRUTH_FRAME
    events = traffic(b"early", event, begin, end, b"old", b"first", event, begin, b"second", event, end, begin, end)
    found = marked_pictures(events)
    assert {index: picture.payload for index, picture in found.items()} == {0: b"first", 1: b"second"}


def test_mark_without_a_new_picture_and_second_pictures_count_for_nothing() -> None:
    begin, end, event = EventKind.CAPTURE_BEGIN, EventKind.CAPTURE_END, EventKind.TRUTH_FRAME
    events = traffic(begin, end, b"first", event, b"after release", event, begin, end, event)
    assert {index: picture.payload for index, picture in marked_pictures(events).items()} == {0: b"first"}


def test_aligned_error_is_independent_of_where_the_truths_frame_lies(results: Path, recorded: Recorded) -> None:
    offset = Pose3(Rot3.Yaw(1.1), np.array([0.02, -0.01, 0.005]))
    moved = Truth(tuple(pose * offset.inverse() for pose in recorded.truth))
    first, second = evaluate(results, Truth(recorded.truth), "box"), evaluate(results, moved, "box")
    assert first.registration_rms_mm == pytest.approx(second.registration_rms_mm, abs=1e-6)
    assert first.pose is not None
    assert second.pose is not None
    assert first.pose.rmse_deg == pytest.approx(second.pose.rmse_deg, abs=1e-4)


def planar_results(folder: Path, change: Callable[[Grasp], Grasp] = lambda grasp: grasp) -> PlanarGrasps:
    data = simulate("rectangle", 3, count=5)
    slam = TactileSlam(SlamSettings(method="odometry"))
    for grasp in data.grasps:
        slam.add_grasp(change(grasp))
    write_results(folder, slam.finish(), [change(grasp) for grasp in data.grasps])
    return data


def test_an_outline_is_truth_enough_in_the_plane(tmp_path: Path) -> None:
    data = planar_results(tmp_path)
    found = evaluate(tmp_path, Truth(data.world_T_body, outline_m=data.outline_m), "rectangle")
    assert found.shape is not None
    assert found.truth.mesh
    assert found.sensing is not None
    assert 0.3 < found.sensing.median_mm < 1.5
    assert not (tmp_path / "mesh.ply").exists()  # contacts of the plane have no heights


def test_a_shape_states_its_own_uncertainty(tmp_path: Path) -> None:
    data = planar_results(tmp_path)
    found = evaluate(tmp_path, Truth((None,) * len(data.grasps)), "rectangle")
    assert found.uncertainty is not None
    assert 0 < found.uncertainty.sigma_mm_median <= found.uncertainty.sigma_mm_p95


def test_a_lost_object_without_a_shape_is_said_in_words(tmp_path: Path) -> None:
    data = planar_results(tmp_path, lambda grasp: replace(grasp, contacts=grasp.contacts[:2]))
    found = evaluate(tmp_path, Truth(data.world_T_body, outline_m=data.outline_m), "rectangle")
    assert (found.status, found.failed, found.shape, found.uncertainty) == ("lost", True, None, None)
    assert found.warnings[0] == "the object is lost: 5 of 5 grasps could not be registered"
    assert "no closed shape could be estimated from the contacts" in found.warnings


def test_a_surface_that_can_not_be_compared_is_said_in_words(tmp_path: Path, recorded: Recorded, results: Path) -> None:
    shutil.copytree(results, tmp_path / "results")
    if not (results / "mesh.ply").exists() or read_results(results).dimension == 2:
        return
    trimesh.creation.box((3.0, 3.0, 3.0)).export(tmp_path / "results" / "mesh.ply")
    found = evaluate(tmp_path / "results", full_truth(recorded), "box")
    assert found.shape is None
    assert any("cannot be compared" in warning for warning in found.warnings)


def test_the_verdict_says_that_rotations_of_symmetry_are_ignored() -> None:
    def verdict(evaluation):
        (row,) = (row for row in evaluation_rows(evaluation) if row.label == "Registration error")
        return row.note

    assert verdict({"registration_rms_mm": 2.0, "symmetry_turns": None}) == "passed: at most 5 mm"
    told = verdict({"registration_rms_mm": 9.0, "symmetry_turns": 6})
    assert told == "failed: above 5 mm, ignoring rotations about its axis of symmetry"


def test_the_outline_of_a_hollow_object_is_its_outer_wall() -> None:
    tube = trimesh.creation.annulus(r_min=0.02, r_max=0.03, height=0.05)
    radii_m = np.linalg.norm(horizontal_outline(tube, 0.0), axis=1)
    assert radii_m == pytest.approx(0.03, abs=1e-3)
