"""``tactile-lab reconstruct`` on contact logs and sessions, good data and bad."""

from __future__ import annotations

import copy
import json
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np
import pytest
import trimesh
from gtsam import Pose3

from drivers.core.contacts import FINGERS, Contact, Grasp
from sessions.exchange.contact_log import ContactLog, MotionSigma, ObjectTruth, write_contact_log
from tactile_lab.cli.options import OUR_METHODS
from tactile_lab.evaluation.files.trajectory_file import read_trajectory
from tactile_lab.experiments.data import planar_data, spatial_data
from tactile_lab.slam.shape.selection.models import SHAPE_MODELS
from tests.support.coarse_judging import judged_coarsely

NORMAL_SIGMA_rad = float(np.deg2rad(5.0))
MOTION = MotionSigma(translation_m=0.01, rotation_rad=float(np.deg2rad(20.0)))
IDENTITY = np.eye(4).tolist()


@pytest.fixture(scope="module", autouse=True)
def coarse_judging() -> Iterator[None]:
    with judged_coarsely():
        yield


@pytest.fixture(scope="module")
def planar_log(tmp_path_factory: pytest.TempPathFactory) -> Path:
    data = planar_data.simulate("rectangle", 3, count=6)
    truth = ObjectTruth(name="rectangle", polygon_m=tuple(map(tuple, data.outline_m.tolist())))
    log = ContactLog(2, 0.001, NORMAL_SIGMA_rad, MOTION, data.grasps, truth, data.world_T_body)
    path = tmp_path_factory.mktemp("logs") / "rectangle.json"
    write_contact_log(path, log)
    return path


@pytest.fixture(scope="module")
def spatial_log(tmp_path_factory: pytest.TempPathFactory) -> Path:
    data = spatial_data.simulate("box-12x6x6", 1, count=5)
    path = tmp_path_factory.mktemp("logs") / "box.json"
    data.mesh.export(path.with_name("truth.ply"))
    truth = ObjectTruth(name="box", mesh="truth.ply")
    write_contact_log(path, ContactLog(3, 0.001, NORMAL_SIGMA_rad, MOTION, data.grasps, truth, data.world_T_body))
    return path


def changed(log: Path, folder: Path, change: Callable[[dict], object]) -> Path:
    """A copy of a log with something else in it."""
    document = copy.deepcopy(json.loads(log.read_text()))
    change(document)
    (folder / "changed.json").write_text(json.dumps(document))
    return folder / "changed.json"


def each_contact(document: dict, change: Callable[[int, dict], object]) -> None:
    for index, grasp in enumerate(document["grasps"]):
        for contact in grasp["contacts"]:
            change(index, contact)


def test_a_planar_log_is_reconstructed_and_judged(inside, planar_log, tmp_path):
    answer = inside("reconstruct", planar_log, "--out", tmp_path / "out", "--seed", 4, "--json")
    assert answer.code == 0, answer.err
    document = json.loads(answer.out)
    assert (document["method"], document["seed"], document["object"], document["status"]) == (
        "joint",
        4,
        "rectangle",
        "complete",
    )
    assert document["shape_best_fit"]["hausdorff_mm"] < 10.0
    assert document["shape"]["mean_distance_mm"] >= document["shape_best_fit"]["mean_distance_mm"] - 0.5
    assert document["truth"] == {"seen": 6, "missing": 0, "mesh": True}
    assert json.loads((tmp_path / "out" / "evaluation.json").read_text()) == document
    ring = np.loadtxt(tmp_path / "out" / "contour.csv", delimiter=",", skiprows=1, usecols=(0, 1))
    np.testing.assert_array_equal(ring[0], ring[-1])
    assert len(read_trajectory(tmp_path / "out" / "trajectory.csv").world_T_object) == 6


@pytest.mark.parametrize("method", OUR_METHODS[1:])
def test_every_method_runs_on_the_same_log(inside, planar_log, tmp_path, method):
    (tmp_path / "fast.yaml").write_text("particles: 2000\ncontour_resolution_m: 0.002\n")
    options = ("--settings", tmp_path / "fast.yaml", "--out", tmp_path / "out", "--json")
    answer = inside("reconstruct", planar_log, "--method", method, *options)
    assert answer.code == 0, answer.err
    document = json.loads(answer.out)
    assert document["method"] == method
    if method == "known-pose":
        assert document["registration_rms_mm"] == 0.0
        assert document["pose"]["rmse_mm"] < 1e-3


@pytest.mark.parametrize("shape", list(SHAPE_MODELS))
def test_every_shape_model_is_made_from_the_same_log(inside, planar_log, tmp_path, shape):
    answer = inside("reconstruct", planar_log, "--method", "known-pose", "--shape", shape, "--out", tmp_path, "--json")
    assert answer.code == 0, answer.err
    assert json.loads(answer.out)["shape_best_fit"]["mean_distance_mm"] < 8.0
    assert json.loads((tmp_path / "slam.json").read_text())["settings"]["shape_model"] == shape


def test_results_of_shape_models_lie_beside_each_other(inside, planar_log):
    for shape in ("gpis", "nagata"):
        assert inside("reconstruct", planar_log, "--method", "known-pose", "--shape", shape).code == 0
        assert (planar_log.parent / f"rectangle-known-pose-{shape}" / "contour.csv").exists()


def test_a_spatial_log_gets_a_mesh_with_its_uncertainty(inside, spatial_log, tmp_path):
    (tmp_path / "coarse.yaml").write_text("mesh_resolution_m: 0.01\n")
    settings = ("--settings", tmp_path / "coarse.yaml", "--largest-sigma", 1e6)
    words = ("--method", "known-pose", *settings, "--out", tmp_path / "out", "--json")
    answer = inside("reconstruct", spatial_log, *words)
    assert answer.code == 0, answer.err
    document = json.loads(answer.out)
    assert document["dimension"] == 3
    assert document["shape_best_fit"]["mean_distance_mm"] < 6.0
    assert document["uncertainty"]["sigma_mm_median"] > 0
    mesh = trimesh.load_mesh(tmp_path / "out" / "mesh.ply")
    assert mesh.is_watertight
    assert (tmp_path / "out" / "mesh.glb").stat().st_size > 1000
    assert len(trimesh.load_mesh(tmp_path / "out" / "known.ply").faces) == len(mesh.faces)
    flat = inside(
        "reconstruct", spatial_log, "--method", "odometry", "--dimension", 2, "--out", tmp_path / "flat", "--json"
    )
    assert json.loads(flat.out)["dimension"] == 2


def test_people_get_a_table_on_standard_output(inside, planar_log, tmp_path):
    answer = inside("reconstruct", planar_log, "--method", "known-pose", "--out", tmp_path / "out")
    assert answer.code == 0
    assert "Hausdorff distance" not in answer.err
    assert "Hausdorff distance" in answer.out
    assert f"contact log  {planar_log}" in answer.out


def test_the_same_seed_gives_the_same_files(inside, planar_log, tmp_path):
    (tmp_path / "fast.yaml").write_text("particles: 500\n")
    for name in ("one", "other"):
        options = ("--settings", tmp_path / "fast.yaml", "--out", tmp_path / name, "--seed", 2)
        assert inside("reconstruct", planar_log, "--method", "particle", *options).code == 0
    for file in ("trajectory.csv", "contour.csv", "slam.json", "contacts.csv"):
        assert (tmp_path / "one" / file).read_bytes() == (tmp_path / "other" / file).read_bytes()


def test_a_log_without_truth_is_reconstructed_and_known_pose_says_what_it_lacks(inside, planar_log, tmp_path):
    def strip(document: dict) -> None:
        document.pop("object")
        for grasp in document["grasps"]:
            grasp.pop("world_T_object")

    log = changed(planar_log, tmp_path, strip)
    answer = inside("reconstruct", log, "--method", "odometry", "--json")
    assert answer.code == 0
    document = json.loads(answer.out)
    assert (document["shape"], document["pose"], document["failed"]) == (None, None, None)
    assert document["object"] == "changed"
    assert (tmp_path / "changed-odometry" / "contour.csv").is_file()  # beside the log, named after the method
    answer = inside("reconstruct", log, "--method", "known-pose")
    assert (answer.code, answer.out) == (2, "")
    assert "known-pose: needs the object's true poses, and there are none" in answer.err


def test_the_truth_changes_nothing_but_the_evaluation(inside, planar_log, tmp_path):
    def lie(document: dict) -> None:
        document["object"]["polygon_m"] = [[0, 0], [0.01, 0], [0, 0.01]]
        for grasp in document["grasps"]:
            grasp["world_T_object"] = IDENTITY

    (tmp_path / "fast.yaml").write_text("particles: 500\n")
    for name, log in (("true", planar_log), ("false", changed(planar_log, tmp_path, lie))):
        options = ("--method", "particle", "--settings", tmp_path / "fast.yaml", "--out", tmp_path / name)
        assert inside("reconstruct", log, *options).code == 0
    for file in ("trajectory.csv", "contour.csv", "slam.json"):
        assert (tmp_path / "true" / file).read_bytes() == (tmp_path / "false" / file).read_bytes()


def test_a_session_is_reconstructed_exported_and_the_log_tells_the_same(inside, recorded, recorded_root, tmp_path):
    own = inside("reconstruct", recorded, "--method", "known-pose", "--out", tmp_path / "session", "--json")
    assert own.code == 0, own.err
    assert (tmp_path / "session" / "report.html").is_file()
    exported = inside(
        "session", "export", "last", "--root", recorded_root, "--contacts", tmp_path / "log.json", "--json"
    )
    assert exported.code == 0, exported.err
    assert json.loads(exported.out)["grasps"] == 2
    assert (tmp_path / "log.ply").is_file()
    log = inside("reconstruct", tmp_path / "log.json", "--method", "known-pose", "--out", tmp_path / "log", "--json")
    assert log.code == 0, log.err
    found, expected = json.loads(log.out), json.loads(own.out)
    assert found["contacts"] == expected["contacts"]
    assert found["object"] == expected["object"]
    shape = (found["shape_best_fit"]["mean_distance_mm"], expected["shape_best_fit"]["mean_distance_mm"])
    assert shape[0] == pytest.approx(shape[1], abs=0.05)
    assert len(json.loads((tmp_path / "log.json").read_text())["grasps"][0]["closing_lines"]) >= 3


def test_a_running_session_can_not_use_the_truth(inside, tmp_path):
    for command in ("run", "sweep"):
        answer = inside(command, "--method", "known-pose", "--out", tmp_path / "runs")
        assert (answer.code, answer.out) == (2, "")
        assert "known-pose" in answer.err
        assert "tactile-lab reconstruct" in answer.err
    assert not (tmp_path / "runs").exists()


# --- bad input -----------------------------------------------------------------------------------------------------


def refused(answer, code: int, *words: str) -> None:
    assert (answer.code, answer.out) == (code, ""), answer.err
    errors = [line for line in answer.err.splitlines() if line.startswith("error: ")]
    assert len(errors) == 1, answer.err
    for word in words:
        assert word in errors[0]


def negate(index: int, contact: dict) -> None:
    contact["normal_world"] = [-x for x in contact["normal_world"]]


def to_millimetres(index: int, contact: dict) -> None:
    contact["point_world_m"] = [1000 * x for x in contact["point_world_m"]]


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (lambda log: log.update(grasps=[]), ("grasps",)),
        (lambda log: [grasp.update(contacts=[]) for grasp in log["grasps"]], ("no grasp has a contact",)),
        (lambda log: log.update(colour="red"), ("colour: unknown key",)),
        (lambda log: log.update(grasp=[]), ("grasp: unknown key (did you mean grasps?)",)),
        (lambda log: log["grasps"][2].pop("hand_motion_world"), ("grasps.2.hand_motion_world: is missing",)),
        (lambda log: log["grasps"][1]["contacts"][0]["point_world_m"].__setitem__(0, float("nan")), ("finite number",)),
        (lambda log: each_contact(log, to_millimetres), ("millimetres",)),
        (lambda log: each_contact(log, negate), ("normals point into the object", "negate them")),
        (lambda log: log.update(format="tactile-contacts/9"), ("'tactile-contacts/9'",)),
        (lambda log: log["grasps"][0]["contacts"][0].update(normal_world=[0, 0, 0]), ("a normal must have length 1",)),
    ],
)
def test_a_log_that_makes_no_sense_is_explained(inside, planar_log, tmp_path, change, words):
    log = changed(planar_log, tmp_path, change)
    refused(inside("reconstruct", log, "--out", tmp_path / "out", "--json"), 2, "changed.json", *words)
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize("keep", [0, 1, 400])
def test_a_log_that_was_cut_off_is_named(inside, planar_log, tmp_path, keep):
    (tmp_path / "cut.json").write_bytes(planar_log.read_bytes()[:keep])
    refused(inside("reconstruct", tmp_path / "cut.json"), 2, "cut.json: is not JSON")


def test_what_is_neither_log_nor_session_is_named(inside, tmp_path):
    (tmp_path / "photo.json").write_bytes(b"\xff\xd8\xff\xe0")
    refused(inside("reconstruct", tmp_path / "photo.json"), 2, "photo.json: is not JSON")
    refused(inside("reconstruct", tmp_path / "none.json"), 2, "none.json: cannot be read")
    refused(inside("reconstruct", tmp_path / "hits.csv"), 2, "is a table", "tactile-lab session import")
    refused(inside("reconstruct", tmp_path), 2, str(tmp_path))
    refused(inside("reconstruct", "nowhere", "--root", tmp_path), 2, "nowhere: no such session")


def test_a_true_mesh_that_is_missing_or_in_millimetres_is_named_before_anything_is_estimated(
    inside, spatial_log, tmp_path
):
    log = changed(spatial_log, tmp_path, lambda document: None)
    refused(inside("reconstruct", log), 2, "truth.ply: file not found")
    trimesh.creation.box((120.0, 60.0, 60.0)).export(tmp_path / "truth.ply")
    refused(inside("reconstruct", log), 2, "truth.ply", "millimetres?")


def test_a_planar_log_has_no_surface(inside, planar_log, tmp_path):
    refused(inside("reconstruct", planar_log, "--dimension", 3), 2, "a log of dimension 2 has no heights")


@pytest.mark.parametrize(
    ("settings", "words"),
    [
        ("particle: 3\n", ("particle: unknown key (did you mean particles?)",)),
        ("particles: 3\n", ("particles: must be greater than or equal to 100",)),
        ("- 1\n", ("must be keys with values",)),
        ("particles: [1\n", ("is not valid YAML",)),
    ],
)
def test_settings_that_do_not_fit_are_explained(inside, planar_log, tmp_path, settings, words):
    (tmp_path / "mine.yaml").write_text(settings)
    refused(inside("reconstruct", planar_log, "--settings", tmp_path / "mine.yaml"), 2, "mine.yaml", *words)


def test_other_files_in_the_folder_of_results_are_left_alone(inside, planar_log, tmp_path):
    (tmp_path / "thesis.docx").write_text("years of work")
    answer = inside("reconstruct", planar_log, "--method", "odometry", "--out", tmp_path)
    refused(answer, 2, "contains files that are not results, such as thesis.docx")
    assert [path.name for path in tmp_path.iterdir()] == ["thesis.docx"]


def one_face(count: int = 5) -> tuple[Grasp, ...]:
    rng = np.random.default_rng(0)
    grasps = []
    for index in range(count):
        places = np.sort(rng.uniform(-0.04, 0.04, 5))
        contacts = tuple(
            Contact(
                finger,
                np.array([x, 0.03 + rng.normal(0, 0.001), 0.0]),
                np.array([0.0, 1.0, 0.0]),
                1e-6 * np.eye(3),
                0.0873,
                0.0,
            )
            for finger, x in zip(FINGERS, places, strict=True)
        )
        grasps.append(Grasp(index, index, contacts, Pose3()))
    return tuple(grasps)


def honest(document: dict) -> None:
    """Lost, or without a shape, or far from certain of it, and saying so in words."""
    uncertain = document["uncertainty"] is None or document["uncertainty"]["sigma_mm_p95"] > 5.0
    assert document["status"] == "lost" or uncertain
    assert document["warnings"]


def reconstructed(inside, log: Path, *options: object) -> dict:
    answer = inside("reconstruct", log, "--out", log.with_name("out"), "--json", *options)
    document = json.loads(answer.out)
    assert answer.code == (3 if document["status"] == "lost" else 0), answer.err
    for warning in document["warnings"]:
        assert f"warning: {warning}" in answer.err
    return document


def test_contacts_on_one_face_leave_the_others_unknown(inside, tmp_path):
    write_contact_log(tmp_path / "log.json", ContactLog(2, 0.001, 0.0873, MOTION, one_face()))
    document = reconstructed(inside, tmp_path / "log.json")
    honest(document)
    assert "only one side of the object" in document["warnings"][0]


@pytest.mark.long
def test_contacts_repeated_at_one_place_make_no_certain_shape(inside, planar_log, tmp_path):
    def repeat(document: dict) -> None:
        for grasp in document["grasps"]:
            grasp["contacts"] = [{**grasp["contacts"][0], "finger": finger} for finger in FINGERS]
            grasp["closing_lines"] = []

    honest(reconstructed(inside, changed(planar_log, tmp_path, repeat)))


def test_one_grasp_repeated_leaves_what_it_did_not_touch_uncertain(inside, planar_log, tmp_path):
    def repeat(document: dict) -> None:
        first = document["grasps"][0]
        document["grasps"] = [{**first, "stamp_s": float(index)} for index in range(6)]

    honest(reconstructed(inside, changed(planar_log, tmp_path, repeat)))


def test_grasps_of_two_contacts_only_are_lost(inside, planar_log, tmp_path):
    def thin(document: dict) -> None:
        for grasp in document["grasps"]:
            grasp["contacts"] = grasp["contacts"][:2]

    document = reconstructed(inside, changed(planar_log, tmp_path, thin))
    assert document["status"] == "lost"
    assert document["shape"] is None
    assert "the object is lost: 6 of 6 grasps could not be registered" in document["warnings"]


@pytest.mark.parametrize(
    "method",
    [pytest.param("joint", marks=pytest.mark.long), "particle", "thesis-pf", "icp"],  # joint: test_tactile_slam
)
def test_a_jump_of_ten_centimetres_is_not_built_into_the_shape(inside, planar_log, tmp_path, method):
    def jump(index: int, contact: dict) -> None:
        if index >= 3:
            contact["point_world_m"][0] += 0.1

    def jumped(document: dict) -> None:
        each_contact(document, jump)
        for grasp in document["grasps"][3:]:
            grasp["closing_lines"] = []

    (tmp_path / "fast.yaml").write_text("particles: 5000\n")
    options = ("--method", method, "--settings", tmp_path / "fast.yaml")
    document = reconstructed(inside, changed(planar_log, tmp_path, jumped), *options)
    steps = json.loads((tmp_path / "out" / "slam.json").read_text())["steps"]
    assert steps[3]["verdict"] in {"uncertain", "untracked"}
    ring = np.loadtxt(tmp_path / "out" / "contour.csv", delimiter=",", skiprows=1, usecols=(0, 1))
    if np.ptp(ring, axis=0).max() > 0.16:  # the thesis's own shape model from three grasps
        honest(document)
