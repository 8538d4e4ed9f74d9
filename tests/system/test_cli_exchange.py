"""``tactile-lab session import|export|extract|recover``: other people's contacts in, sessions out and in again."""

from __future__ import annotations

import csv
import json
import shutil
import zipfile
from collections.abc import Iterable, Iterator, Sequence
from contextlib import nullcontext
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest
import trimesh
import yaml
from gtsam import Pose3
from mcap.reader import make_reader
from pyarrow import parquet
from rosbags.highlevel import AnyReader

from drivers.core.contacts import Grasp
from sessions.exchange.extracting import Piece, extract
from sessions.exchange.timed_table import FORMAT
from sessions.recording.session import Session
from tactile_lab.experiments.data import planar_data, spatial_data


def pose_columns(prefix: str, pose: Pose3) -> dict[str, float]:
    quaternion = pose.rotation().toQuaternion()
    turn = {name: getattr(quaternion, name[1])() for name in ("qx", "qy", "qz", "qw")}
    place = dict(zip(("x_m", "y_m", "z_m"), pose.translation().tolist(), strict=True))
    return {f"{prefix}_{name}": value for name, value in {**place, **turn}.items()}


def timed(grasps: Sequence[Grasp], world_T_object: Iterable[Pose3]) -> Iterator[dict[str, Any]]:
    """Contacts as another laboratory would write them down: the tool carries the object between two grasps."""
    tool = Pose3()
    for grasp, true_pose in zip(grasps, world_T_object, strict=True):
        tool = grasp.hand_motion_world * tool
        for number, contact in enumerate(grasp.contacts):
            point, normal = contact.point_world_m.tolist(), contact.normal_world.tolist()
            yield {
                "time_s": grasp.index + 0.01 * number,
                "grasp": grasp.index,
                "held": int(grasp.index > 0),
                "finger": contact.finger,
                **dict(zip(("x_m", "y_m", "z_m"), point, strict=True)),
                **dict(zip(("nx", "ny", "nz"), normal, strict=True)),
                **pose_columns("tool", tool),
                **pose_columns("object", true_pose),
            }


def write_csv(path: Path, rows: Sequence[dict[str, Any]]) -> Path:
    with path.open("w", newline="") as file:
        table = csv.DictWriter(file, list(rows[0]))
        table.writeheader()
        table.writerows(rows)
    return path


def refused(answer, code: int, *words: str) -> None:
    assert (answer.code, answer.out) == (code, ""), answer
    errors = [line for line in answer.err.splitlines() if line.startswith("error: ")]
    assert len(errors) == 1, answer.err
    for word in words:
        assert word in errors[0]


# --- other people's contacts ---------------------------------------------------------------------------------------


def test_planar_contacts_with_a_known_outline_are_imported_estimated_and_judged(inside, tmp_path):
    data = planar_data.simulate("rectangle", 3, count=7)
    rows = [
        {name: value for name, value in row.items() if name not in ("z_m", "nz")}
        for row in timed(data.grasps, data.world_T_body)
    ]
    outline = {"name": "rectangle", "polygon_m": data.outline_m.tolist()}
    document = {"format": FORMAT, "point_sigma_m": 0.001, "normal_sigma_rad": 0.09, "object": outline, "contacts": rows}
    (tmp_path / "other.json").write_text(json.dumps(document))
    imported = inside("session", "import", tmp_path / "other.json", "--json")
    assert imported.code == 0, imported.err
    log = json.loads(imported.out)
    assert (log["dimension"], log["grasps"], log["contacts"]) == (2, 7, len(rows))
    answer = inside("reconstruct", log["log"], "--out", tmp_path / "out", "--seed", 1, "--json")
    assert answer.code == 0, answer.err
    judged = json.loads(answer.out)
    assert (judged["object"], judged["status"]) == ("rectangle", "complete")
    assert judged["truth"] == {"seen": 7, "missing": 0, "mesh": True}
    assert judged["shape_best_fit"]["hausdorff_mm"] < 10.0
    assert judged["pose"]["rmse_mm"] < 15.0


def test_contacts_in_space_with_a_true_mesh_are_imported_estimated_and_judged(inside, tmp_path):
    data = spatial_data.simulate("box-12x6x6", 1, count=4)
    data.mesh.export(tmp_path / "box.ply")
    rows = list(timed(data.grasps, data.world_T_body))
    table = write_csv(tmp_path / "other.csv", rows)
    options = ("--mesh", tmp_path / "box.ply", "--point-sigma-mm", 1, "--out", tmp_path / "log.json", "--json")
    imported = inside("session", "import", table, *options)
    assert imported.code == 0, imported.err
    log = json.loads(imported.out)
    assert (log["dimension"], log["grasps"], log["contacts"]) == (3, 4, len(rows))
    out = tmp_path / "out"
    answer = inside("reconstruct", tmp_path / "log.json", "--method", "known-pose", "--out", out, "--json")
    assert answer.code == 0, answer.err
    judged = json.loads(answer.out)
    assert (judged["object"], judged["truth"]) == ("box", {"seen": 4, "missing": 0, "mesh": True})
    assert json.loads((out / "evaluation.json").read_text()) == judged
    assert judged["shape_best_fit"]["mean_distance_mm"] < 8.0
    assert judged["pose"]["rmse_mm"] == pytest.approx(0.0, abs=1e-6)


GOOD = "time_s,x_m,y_m,nx,ny\n0,0.05,0,1,0\n1,-0.05,0,-1,0\n"


@pytest.mark.parametrize(
    ("text", "words"),
    [
        (GOOD.replace("x_m", "x_mm"), ("'x_mm' is in another unit", "name it x_m")),
        (GOOD.replace("0.05", "50"), ("millimetres",)),
        (
            GOOD.replace("0,0.05", "3,0.05"),
            ("contact 2", "earlier than that of the previous contact", "Sort the lines"),
        ),
        ("", ("no column",)),
    ],
)
def test_a_table_that_does_not_fit_is_refused_and_no_log_is_made(inside, tmp_path, text, words):
    (tmp_path / "other.csv").write_text(text)
    refused(inside("session", "import", tmp_path / "other.csv", "--json"), 2, "other.csv", *words)
    assert [path.name for path in tmp_path.iterdir()] == ["other.csv"]


def test_a_true_mesh_in_millimetres_or_that_is_missing_is_named(inside, tmp_path):
    (tmp_path / "other.csv").write_text("time_s,x_m,y_m,z_m,nx,ny,nz\n0,0.05,0,0,1,0,0\n1,-0.05,0,0,-1,0,0\n")
    refused(inside("session", "import", tmp_path / "other.csv", "--mesh", tmp_path / "no.ply"), 2, "no.ply")
    trimesh.creation.box((120.0, 60.0, 60.0)).export(tmp_path / "mm.ply")
    refused(inside("session", "import", tmp_path / "other.csv", "--mesh", tmp_path / "mm.ply"), 2, "millimetres?")
    assert not (tmp_path / "other-log.json").exists()


# --- sessions for other programs -----------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def piece(recorded: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Half a second of a session; only to be read."""
    folder = tmp_path_factory.mktemp("pieces") / "piece-1"
    extract(Session.open(recorded), folder, Piece(3.0, 3.5))
    return folder


def test_a_session_is_exported_in_every_form_and_opens_in_programs_that_are_not_ours(inside, piece, tmp_path):
    forms = {
        "csv": "tables", "hdf5": "all.h5", "rosbag": "bag", "foxglove": "all.mcap", "rerun": "all.rrd",
        "archive": "all.zip", "parquet": "columns", "lerobot": "dataset",
    }  # fmt: skip
    options = [word for form, name in forms.items() for word in (f"--{form}", tmp_path / name)]
    answer = inside("session", "export", piece, *options, "--json")
    assert answer.code == 0, answer.err
    told = json.loads(answer.out)
    assert all(told[form] == str(tmp_path / name) for form, name in forms.items())
    assert told["rosbag_written"] > told["csv_written"] == told["hdf5_written"] == told["parquet_written"] > 300
    assert 4 <= told["lerobot_written"] <= 6  # ten a second
    wrenches = parquet.read_table(tmp_path / "columns" / "wrench_FF.parquet")
    assert wrenches.schema.field("tx_Nm").metadata == {b"unit": b"N m"}
    for file in (tmp_path / "columns").glob("*.parquet"):
        assert parquet.read_schema(file).field("stamp_ns").metadata == {b"unit": b"ns"}, file.name
    with (tmp_path / "tables" / "joints.csv").open(newline="") as file:
        lines = sum(1 for _ in csv.DictReader(file))
    with h5py.File(tmp_path / "all.h5") as file:
        assert len(file["joints/stamp_ns"]) == lines
    with AnyReader([tmp_path / "bag"]) as bag:
        kinds = {c.topic: c.msgcount for c in bag.connections}
        assert kinds["/joint_states"] == lines + (len((tmp_path / "tables" / "base.csv").read_text().splitlines()) - 1)
        assert {"/tf", "/tf_static", "/robot_description"} <= set(kinds)
    with (tmp_path / "all.mcap").open("rb") as file:
        found = make_reader(file, validate_crcs=True).get_summary()
    states = {c.topic: found.statistics.channel_message_counts[number] for number, c in found.channels.items()}
    assert states["/joint_states"] == states["/tf"] == 7  # an extract keeps bytes only: they come from those
    with zipfile.ZipFile(tmp_path / "all.zip") as archive:
        assert archive.testzip() is None
    for form, name in forms.items():
        refused(inside("session", "export", piece, f"--{form}", tmp_path / name), 2, name, "exists already")


def test_trajectories_are_exported_as_other_programs_read_them(inside, recorded, piece, tmp_path):
    answer = inside("session", "export", recorded, "--tum", tmp_path / "tum")
    assert answer.code == 0, answer.err
    estimate, truth = (np.loadtxt(tmp_path / "tum" / f"{name}.tum") for name in ("estimate", "truth"))
    assert estimate.shape == truth.shape == (2, 8)
    assert np.linalg.norm(estimate[:, 4:], axis=1) == pytest.approx([1.0, 1.0])
    assert estimate[0] == pytest.approx(truth[0], abs=1e-6)  # the object frames are tied there
    refused(inside("session", "export", recorded, "--tum", tmp_path / "tum"), 2, "exists")
    refused(inside("session", "export", piece, "--tum", tmp_path / "none"), 2, "trajectory cannot be read")


def test_an_export_of_nothing_is_refused(inside, piece):
    answer = inside("session", "export", piece)
    assert (answer.code, answer.out) == (2, "")
    assert "give at least one of --contacts, --csv" in answer.err


def test_a_piece_of_a_session_is_cut_out_and_lists_like_any_other(inside, recorded, tmp_path):
    into = tmp_path / "runs" / "piece-1"
    options = ("--from", 3, "--to", 3.5, "--links", "hand,ft/FF", "--json")
    answer = inside("session", "extract", recorded, "--into", into, *options)
    assert answer.code == 0, answer.err
    assert json.loads(answer.out)["messages"]["/link/ft/FF/rx"] in (50, 51)
    listed = json.loads(inside("session", "list", "--root", into.parent, "--json").out)
    assert [(item["name"], item["status"]) for item in listed] == [("piece-1", "closed")]
    for words, told in (
        (("--links", "elbow"), "no transport called elbow"),
        (("--from", 5, "--to", 4), "nothing was recorded in that part"),
    ):
        answer = inside("session", "extract", recorded, "--into", tmp_path / "runs" / "piece-2", *words)
        assert answer.code == 2
        assert told in answer.err
    assert [path.name for path in into.parent.iterdir()] == ["piece-1"]
    refused(inside("session", "extract", recorded, "--into", into), 2, "exists already")
    refused(inside("session", "extract", recorded, "--into", tmp_path / "A Piece"), 2, "cannot be the name")


# --- archives ------------------------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def packed(recorded: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A session's archive; only to be read."""
    path = tmp_path_factory.mktemp("archive") / "s.zip"
    with zipfile.ZipFile(path, "w") as archive:
        for item in recorded.rglob("*"):
            if item.is_file() and item.parent.name != "results":
                archive.write(item, f"s/{item.relative_to(recorded).as_posix()}")
    return path


def test_an_archive_becomes_a_session_that_lists_and_shows(inside, packed, tmp_path):
    answer = inside("session", "import", packed, "--root", tmp_path / "runs", "--name", "from-afar", "--json")
    assert answer.code == 0, answer.err
    assert json.loads(answer.out) == {"session": str(tmp_path / "runs" / "from-afar"), "status": "closed"}
    shown = json.loads(inside("session", "show", "from-afar", "--root", tmp_path / "runs", "--json").out)
    assert (shown["name"], shown["counts"]["grasps"]) == ("from-afar", 2)
    refused(
        inside("session", "import", packed, "--root", tmp_path / "runs", "--name", "from-afar"), 2, "exists already"
    )
    refused(inside("session", "import", packed, "--root", tmp_path / "runs", "--name", "../up"), 2, "cannot be the")


@pytest.mark.parametrize(
    ("name", "content", "words"),
    [
        ("../evil.txt", b"evil", "unsafe name"),
        ("s/../../evil.txt", b"evil", "unsafe name"),
        ("/tmp/evil.txt", b"evil", "unsafe name"),
        ("s/calibration/joints.yaml", b"# another\n", "contains two files of the same name"),
        ("s/zeros", bytes(20_000_000), "which is implausible"),
        ("t/session.yaml", b"", "contains 2 sessions"),
    ],
)
def test_an_archive_that_can_not_be_trusted_leaves_nothing_behind(inside, packed, tmp_path, name, content, words):
    bad = Path(shutil.copy(packed, tmp_path / "bad.zip"))
    duplicate = pytest.warns(UserWarning, match="Duplicate") if "joints" in name else nullcontext()
    with duplicate, zipfile.ZipFile(bad, "a", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr(name, content)
    refused(inside("session", "import", bad, "--root", tmp_path / "runs"), 2, "bad.zip", words, "Nothing was imported")
    assert not (tmp_path / "runs").exists()
    assert not list(tmp_path.rglob("evil*"))


def test_what_is_no_archive_or_a_torn_one_is_told(inside, packed, tmp_path):
    (tmp_path / "torn.zip").write_bytes(packed.read_bytes()[:-200])
    (tmp_path / "empty.zip").write_bytes(b"")
    for name in ("torn.zip", "empty.zip"):
        refused(inside("session", "import", tmp_path / name, "--root", tmp_path / "runs"), 2, name, "not a ZIP archive")
    refused(inside("session", "import", tmp_path / "none.zip", "--root", tmp_path / "runs"), 2, "No such file")
    (tmp_path / "s.tar.gz").write_bytes(b"\x1f\x8b")
    refused(inside("session", "import", tmp_path / "s.tar.gz"), 2, "is an archive, but no ZIP", "Unpack it")
    refused(
        inside("session", "import", tmp_path / "mug" / "traffic.mcap"), 2, "is a recording", "its folder, such as mug"
    )
    assert not (tmp_path / "runs").exists()


# --- sessions that are not as they were ----------------------------------------------------------------------------


def test_a_torn_session_is_recovered_and_the_torn_one_is_kept(inside, session_copy, tmp_path):
    traffic = session_copy / "traffic.mcap"
    whole = traffic.read_bytes()
    traffic.write_bytes(whole[: int(0.7 * len(whole))])
    (session_copy / "session.yaml").write_text(
        (session_copy / "session.yaml").read_text().replace("status: closed", "status: open")
    )
    answer = inside("session", "recover", session_copy, "--json")
    assert answer.code == 3
    told = json.loads(answer.out)
    assert "/link/hand/rx" in json.dumps(told)
    assert told["left_out"] == ["results"]
    assert f"(results); make new ones with: tactile-lab session replay {told['session']}" in answer.err
    answer = inside("session", "list", "--root", tmp_path, "--json")
    assert answer.code == 0, answer.err
    assert sorted(item["status"] for item in json.loads(answer.out)) == ["damaged", "recovered"]
    assert traffic.stat().st_size == int(0.7 * len(whole))
    shown = json.loads(inside("session", "show", "session-recovered", "--root", tmp_path, "--json").out)
    assert "recovered with loss" in shown["problem"]


def test_a_whole_session_needs_no_recovery(inside, session_copy, tmp_path):
    answer = inside("session", "recover", session_copy)
    assert answer.code == 0
    assert [path.name for path in tmp_path.iterdir()] == ["session"]


@pytest.mark.parametrize("content", [b"", b"hello", b"\x89MCAP0\r\n"])
def test_a_recording_that_holds_nothing_can_not_be_recovered(inside, session_copy, tmp_path, content):
    (session_copy / "traffic.mcap").write_bytes(content)
    refused(inside("session", "recover", session_copy), 2, "traffic.mcap")
    assert [path.name for path in tmp_path.iterdir()] == ["session"]


@pytest.mark.parametrize("command", ["show", "replay", "recover", "extract", "export"])
def test_a_session_of_a_newer_version_is_refused_by_name(inside, session_copy, command):
    manifest = session_copy / "session.yaml"
    content = yaml.safe_load(manifest.read_text())
    manifest.write_text(yaml.safe_dump({**content, "format": "tactile-session/9"}))
    more = {"extract": ("--into", session_copy.parent / "p"), "export": ("--csv", session_copy.parent / "p")}
    if command == "recover":  # the description inside the recording is still the old one
        (session_copy / "traffic.mcap").write_bytes(b"")
    answer = inside("session", command, session_copy, *more.get(command, ()))
    refused(answer, 2, "session.yaml", "'tactile-session/9'", "a newer version of the program")
    assert not (session_copy.parent / "p").exists()


def test_a_calibration_that_is_not_the_recorded_one_is_refused_wherever_bytes_are_understood(
    inside, session_copy, tmp_path
):
    joints = session_copy / "calibration" / "joints.yaml"
    joints.write_text(joints.read_text().replace("22.5", "23.5"))
    for command in ("replay", "export"):
        more = ("--csv", tmp_path / "tables") if command == "export" else ()
        refused(inside("session", command, session_copy, *more), 2, "joints.yaml", "changed since the recording")
    assert "joints" in inside("session", "show", session_copy).out
    assert inside("session", "export", session_copy, "--archive", tmp_path / "a.zip").code == 0
    refused(inside("session", "import", tmp_path / "a.zip", "--root", tmp_path / "in"), 2, "changed since")
    assert not (tmp_path / "tables").exists()


@pytest.mark.long
def test_a_trajectory_edited_by_hand_shows_in_the_replay(inside, session_copy):
    trajectory = session_copy / "results" / "trajectory.csv"
    lines = trajectory.read_text().splitlines()
    lines[-1] = lines[-1].replace("0.", "0.9", 1)
    trajectory.write_text("\n".join(lines) + "\n")
    answer = inside("session", "replay", session_copy, "--json")
    assert json.loads(answer.out)["identical"] is False
    assert "differs from the recorded results: trajectory.csv" in answer.err


def test_points_are_where_the_table_says(inside, tmp_path):
    (tmp_path / "other.csv").write_text(GOOD)
    assert inside("session", "import", tmp_path / "other.csv").code == 0
    log = json.loads((tmp_path / "other-log.json").read_text())
    points = [contact["point_world_m"] for grasp in log["grasps"] for contact in grasp["contacts"]]
    np.testing.assert_allclose(points, [[0.05, 0.0, 0.0], [-0.05, 0.0, 0.0]])
