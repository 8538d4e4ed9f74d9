"""A short session from end to end: its files, its evaluation, its report, and the same again from its bytes."""

from __future__ import annotations

import json
import re
from pathlib import Path

import pytest

from tests.support.low_rig import low_rig

EVALUATION_KEYS = {
    "schema_version", "method", "seed", "object", "grasps", "contacts", "shape", "pose", "loops", "time", "status",
    "aligned", "shape_best_fit",
}  # fmt: skip
SHAPE_KEYS = {"hausdorff_mm", "mean_distance_mm", "chamfer_mm", "fscore_1mm", "fscore_2mm", "iou"}
POSE_KEYS = {"rmse_mm", "rmse_deg", "final_mm", "final_deg", "per_grasp"}
REPLAYABLE = ("trajectory.csv", "contacts.csv", "contour.csv", "mesh.ply", "mesh.glb", "slam.json")


def same_bytes(one: Path, other: Path) -> None:
    for name in REPLAYABLE:
        assert (one / name).read_bytes() == (other / name).read_bytes(), name


def test_run_prints_one_json_document_and_tells_people_the_rest(recorded_root, recorded):
    document = json.loads((recorded_root.parent / "run.json").read_text())
    assert document == json.loads((recorded / "results" / "evaluation.json").read_text())
    told = (recorded_root.parent / "run.err").read_text()
    assert "\x1b" not in told
    assert re.search(r"^ +1/2 ", told, re.M)
    assert "session ended as asked: 2 grasps done; the estimate is partial" in told
    assert str(recorded / "results" / "report.html") in told


def test_the_evaluation_has_the_documented_keys(recorded):
    document = json.loads((recorded / "results" / "evaluation.json").read_text())
    assert set(document) >= EVALUATION_KEYS
    assert set(document["shape"]) == set(document["shape_best_fit"]) == SHAPE_KEYS
    assert set(document["pose"]) >= POSE_KEYS
    assert len(document["pose"]["per_grasp"]) == document["grasps"] == 2
    assert set(document["loops"]) == {"tested", "accepted", "wrong"}
    assert set(document["time"]) == {"total_s", "step_ms_median", "step_ms_p95"}
    assert (document["object"], document["seed"], document["aligned"]) == ("box-10x6x4", 1, "first_grasp")


def test_the_session_folder_is_complete(recorded):
    files = {path.relative_to(recorded).as_posix() for path in recorded.rglob("*") if path.is_file()}
    results = {f"results/{name}" for name in (*REPLAYABLE, "evaluation.json", "report.html")}
    assert files >= {"session.yaml", "traffic.mcap", "truth/object.ply", "calibration/joints.yaml"} | results
    lines = (recorded / "results" / "trajectory.csv").read_text().splitlines()
    assert len(lines) == 1 + 2
    assert not [name for name in files if name.endswith(".part")]


def test_the_report_shows_the_cameras_picture_with_the_estimate(recorded):
    page = (recorded / "results" / "report.html").read_text()
    assert "picture of grasp 2" in page
    assert 'href="data:image/jpeg;base64,' in page
    assert page.count("estimate-seen") >= 2  # the outline, and its legend


def test_the_report_fetches_nothing(recorded):
    page = (recorded / "results" / "report.html").read_text()
    addresses = set(re.findall(r"https?://[^\s\"'<>)]+", page)) - {"http://www.w3.org/2000/svg"}
    assert not {address for address in addresses if "w3.org" not in address}
    assert not re.findall(r"""<(?:script|img|transport|iframe)[^>]+(?:src|href)=["'](?!data:|#)""", page)


@pytest.mark.long
def test_a_replay_in_another_process_is_identical(tactile_lab, session_copy):
    answer = tactile_lab("session", "replay", session_copy, "--json")
    assert answer.code == 0
    assert json.loads(answer.out)["identical"] is True
    assert "identical" in answer.err + answer.out
    same_bytes(session_copy / "results", session_copy / "replay")


@pytest.mark.long
def test_a_second_run_with_the_same_seed_gives_the_same_files(inside, recorded, tmp_path):
    assert inside("run", "--rig", low_rig(tmp_path.parent), "--grasps", 2, "--seed", 1, "--out", tmp_path).code == 0
    (again,) = tmp_path.iterdir()
    same_bytes(recorded / "results", again / "results")


@pytest.mark.long
def test_another_seed_of_the_estimation_gives_another_result_in_the_replay_folder(inside, session_copy):
    answer = inside("session", "replay", session_copy, "--seed", 5, "--dimension", 3, "--json")
    assert answer.code == 0
    document = json.loads(answer.out)
    assert (document["seed"], document["dimension"], document["identical"]) == (5, 3, None)
    assert not (session_copy / "replay" / "contour.csv").exists()
    original = json.loads((session_copy / "results" / "evaluation.json").read_text())
    assert original["seed"] == 1


@pytest.mark.long
def test_a_replay_removes_what_an_earlier_one_left(inside, session_copy):
    (session_copy / "replay").mkdir()
    (session_copy / "replay" / "contour.csv").write_text("of another estimation")
    assert inside("session", "replay", session_copy, "--method", "odometry", "--dimension", 3).code == 0
    assert not (session_copy / "replay" / "contour.csv").exists()


def test_a_replay_never_writes_over_other_files(inside, session_copy, tmp_path):
    mine = tmp_path / "mine"
    mine.mkdir()
    (mine / "thesis.tex").write_text("years of work")
    for folder in (mine, session_copy / "results", mine / "thesis.tex"):
        before = {path: path.read_bytes() for path in session_copy.rglob("*") if path.is_file()}
        answer = inside("session", "replay", session_copy, "--into", folder)
        assert answer.code == 2
        assert "--into" in answer.err or f"{folder} is not a folder" in answer.err
        assert before == {path: path.read_bytes() for path in session_copy.rglob("*") if path.is_file()}
    assert [path.name for path in mine.iterdir()] == ["thesis.tex"]


def test_evaluate_and_report_give_the_same_again(inside, session_copy):
    evaluation = session_copy / "results" / "evaluation.json"
    before = evaluation.read_bytes()
    answer = inside("evaluate", session_copy, "--json")
    assert answer.code == 0
    assert json.loads(answer.out) == json.loads(before)
    assert evaluation.read_bytes() == before
    (session_copy / "results" / "report.html").unlink()
    answer = inside("report", session_copy, "--json")
    assert Path(json.loads(answer.out)["report"]) == session_copy / "results" / "report.html"
    assert (session_copy / "results" / "report.html").is_file()


def test_the_evaluation_table_fits_eighty_columns(inside, session_copy):
    answer = inside("evaluate", session_copy)
    table = answer.out[: answer.out.index("session ")]
    assert all(len(line) <= 80 for line in table.splitlines())
    assert all(words in table for words in ("Hausdorff distance", "best fit", "Position error", "Registration error"))


def test_sessions_are_found_by_folder_by_name_and_as_the_last(inside, recorded_root, recorded):
    listed = json.loads(inside("session", "list", "--root", recorded_root, "--json").out)
    assert [(item["name"], item["status"], item["grasps"]) for item in listed] == [(recorded.name, "closed", 2)]
    shown = [
        json.loads(inside("session", "show", name, "--root", recorded_root, "--json").out)
        for name in (recorded, recorded.name, "last")
    ]
    assert shown[0] == shown[1] == shown[2]
    assert shown[0]["notes"] == "for the tests"
    people = inside("session", "show", "last", "--root", recorded_root)
    assert people.err == f"last  {recorded}\n"
    assert "2 of 2" in people.out
