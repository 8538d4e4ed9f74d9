from __future__ import annotations

import errno
import hashlib
import os
import shutil
import signal
from datetime import UTC, datetime

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from drivers.core.errors import ConfigurationError, SessionError
from sessions.recording.listing import find_session, list_sessions, summarize
from sessions.recording.manifest import Manifest, read_manifest, write_manifest
from sessions.recording.running_session import create_session
from sessions.recording.session import Session
from sessions.recording.traffic import disk as traffic_disk
from sessions.recording.traffic.writer import TrafficWriter

START = datetime(2026, 11, 21, 9, 30, 0, tzinfo=UTC)


def create(root, **options):
    arguments = {"rig": "sim", "rig_description": {"cycle_ms": 10}, "object_name": "box-10x6x4", "started": START}
    return create_session(root, **{**arguments, **options})


def test_a_new_session_is_open_until_it_is_closed(tmp_path):
    session = create(tmp_path, seeds={"world": 3}, settings={"kernel": "se"}, notes="first try")
    assert session.folder.name == "20261121-093000-sim-box-10x6x4"
    manifest = read_manifest(session.folder)
    assert manifest.status == "open"
    assert manifest.ended_utc is None
    assert manifest.started_utc == "2026-11-21T09:30:00+00:00"
    assert manifest.seeds == {"world": 3}
    assert {"tactile-lab", "python", "numpy", "gtsam", "mujoco", "opencv"} <= set(manifest.versions)
    session.recorder.on_received("hand", b"bytes", 1)
    session.close(counts={"grasps": 16}, data_loss={"lost_cycles": 2, "dropped": 0})
    session.close("failed")
    closed = read_manifest(session.folder)
    assert closed.status == "closed"
    assert closed.counts == {"/link/hand/rx": 1, "grasps": 16}
    assert closed.data_loss == {"lost_cycles": 2}
    assert closed.ended_utc is not None


def test_a_session_is_never_overwritten(tmp_path):
    names = []
    for _ in range(3):
        with create(tmp_path) as session:
            names.append(session.folder.name)
    assert names == [f"20261121-093000-sim-box-10x6x4{end}" for end in ("", "-2", "-3")]


@pytest.mark.parametrize(
    ("error", "status"), [(KeyboardInterrupt(), "interrupted"), (SessionError("disk gone"), "failed"), (None, "closed")]
)
def test_the_status_tells_how_a_session_ended(tmp_path, error, status):
    def run():
        with create(tmp_path):
            if error:
                raise error

    if error:
        with pytest.raises(type(error)):
            run()
    else:
        run()
    (summary,) = list_sessions(tmp_path)
    assert summary.status == status
    assert summary.problem == ("disk gone" if status == "failed" else "")


def test_calibration_files_are_copied_with_their_hashes(tmp_path):
    source = tmp_path / "joints.yaml"
    source.write_text("a: 1\n")
    with create(tmp_path / "sessions", calibration_files={"hand/joints": source}) as session:
        folder = session.folder
    source.write_text("a: 2\n")
    again = Session.open(folder)
    copy = again.calibration_file("hand/joints")
    assert copy.read_text() == "a: 1\n"
    assert again.manifest.calibration["hand/joints"].sha256 == hashlib.sha256(b"a: 1\n").hexdigest()
    copy.write_text("a: 3\n")
    with pytest.raises(SessionError, match="changed since the recording"):
        again.calibration_file("hand/joints")
    with pytest.raises(SessionError, match="no calibration called 'camera'"):
        again.calibration_file("camera")


def test_a_missing_calibration_file_is_named(tmp_path):
    with pytest.raises(SessionError, match=r"nowhere\.yaml"):
        create(tmp_path, calibration_files={"joints": tmp_path / "nowhere.yaml"})


def test_the_true_mesh_is_kept_apart(tmp_path):
    with create(tmp_path, truth_mesh_ply=b"ply\n") as session:
        assert session.truth_mesh == session.folder / "truth" / "object.ply"
        assert session.truth_mesh.read_bytes() == b"ply\n"
    with create(tmp_path) as session:
        assert session.truth_mesh is None


@pytest.mark.parametrize(
    ("given_name", "slug"),
    [("mesh:/some where/Part No.7.STL", "part-no-7"), ("../../etc", "etc"), ("", "unnamed"), ("L Block", "l-block")],
)
def test_names_are_safe_in_a_path(tmp_path, given_name, slug):
    with create(tmp_path, object_name=given_name) as session:
        assert session.folder.parent == tmp_path
        assert session.folder.name == f"20261121-093000-sim-{slug}"
        assert session.manifest.object_name == given_name


plain = st.recursive(
    st.none()
    | st.booleans()
    | st.integers(-(2**60), 2**60)
    | st.floats(allow_nan=False, allow_infinity=False)
    # what YAML cannot carry: control characters and surrogates
    | st.text(st.characters(codec="utf-8", exclude_categories=["C", "Zl", "Zp"]) | st.sampled_from("\n\t"))
    | st.sampled_from(
        ["1e-3", "no", "true", "2026-11-21", "0x10", "1_000", "~", "", "null", ".inf", "- a", "a: b", "=", "12:30:45"]
    ),
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(st.text("ab1e-.", max_size=4), inner, max_size=3),
    max_leaves=8,
)


@settings(max_examples=150, deadline=None, derandomize=True)
@given(content=plain, notes=st.sampled_from(["", "1e-3", "two\nlines\n", "a: 'b' # c", "no", "  led by blanks\nx"]))
def test_every_value_survives_the_manifest(tmp_path_factory, content, notes):
    folder = tmp_path_factory.getbasetemp()
    manifest = Manifest(
        name="n",
        status="open",
        rig="sim",
        rig_description={"value": content},
        object_name="1e-3",
        notes=notes,
        started_utc="2026-11-21T09:30:00+00:00",
    )
    write_manifest(folder, manifest)
    assert read_manifest(folder) == manifest


def test_values_that_yaml_can_not_hold_are_refused(tmp_path):
    with pytest.raises(SessionError, match="cannot be written as YAML"):
        create(tmp_path, rig_description={"clock": object()})


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("format: tactile-session/9\n", "a newer version of the program"),
        ("format: shopping-list/1\n", "does not know"),
        ("name: [\n", "not valid YAML"),
        ("", "must be keys with values"),
        ("surprise: 1\n", "surprise"),
    ],
)
def test_a_bad_manifest_is_explained_and_does_not_hide_the_others(tmp_path, text, message):
    with create(tmp_path) as session:
        folder = session.folder
    with create(tmp_path, object_name="sphere"):
        pass
    (folder / "session.yaml").write_text(text)
    with pytest.raises(SessionError, match=message):
        Session.open(folder)
    by_name = {summary.name: summary for summary in list_sessions(tmp_path)}
    assert by_name[folder.name].status == "damaged"
    assert by_name["20261121-093000-sim-sphere"].status == "closed"
    assert find_session(tmp_path, "last").folder.name == "20261121-093000-sim-sphere"


def test_a_calibration_copy_can_not_point_outside_the_session(tmp_path):
    with create(tmp_path) as session:
        folder = session.folder
    text = (folder / "session.yaml").read_text()
    evil = "calibration: {joints: {file: ../../secret, sha256: '00'}}"
    (folder / "session.yaml").write_text(text.replace("calibration: {}", evil))
    with pytest.raises(SessionError, match=r"calibration\.joints\.file"):
        Session.open(folder)


def test_sessions_are_found_by_path_name_and_last(tmp_path):
    assert list_sessions(tmp_path / "none") == []
    with pytest.raises(ConfigurationError, match="no session yet"):
        find_session(tmp_path, "last")
    with create(tmp_path) as session:
        pass
    assert find_session(tmp_path, session.folder.name).folder == session.folder
    assert find_session(tmp_path / "elsewhere", str(session.folder)).folder == session.folder
    with pytest.raises(ConfigurationError, match="no such session"):
        find_session(tmp_path, "nothing")


def test_a_summary_says_what_a_list_needs(tmp_path):
    with create(tmp_path) as session:
        session.close(counts={"grasps": 4}, data_loss={"lost_cycles": 1})
    summary = summarize(session.folder)
    assert (summary.rig, summary.object_name, summary.grasps, summary.data_loss) == ("sim", "box-10x6x4", 4, True)
    assert summary.traffic_bytes > 0


def test_a_root_that_can_not_be_made_is_told(tmp_path):
    (tmp_path / "file").write_text("")
    with pytest.raises(ConfigurationError, match="is not a folder"):
        create(tmp_path / "file" / "sessions")


def test_a_recording_that_was_broken_off_is_told_as_data_loss(tmp_path, monkeypatch):
    def fill(descriptor, data):
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    def run():
        with create(tmp_path) as session:
            session.recorder.on_received("hand", b"kept", 0)
            session.recorder.on_received("hand", b"kept", 10**9)
            session.settle()
            monkeypatch.setattr(traffic_disk.os, "write", fill)
            session.recorder.on_received("hand", b"not kept", 2 * 10**9)
            session.settle()
            session.recorder.on_received("hand", b"not kept", 3 * 10**9)

    with pytest.raises(SessionError, match="the disk is full"):
        run()
    (summary,) = list_sessions(tmp_path)
    manifest = read_manifest(summary.folder)
    assert manifest.status == "failed"
    assert "the disk is full" in manifest.problem
    assert manifest.data_loss == {
        "unwritten /link/hand/rx": 1,
        "unwritten /recorder/streams": 1,
        "traffic_cut_short": 1,
    }
    assert summary.data_loss
    assert next(Session.open(summary.folder).traffic().messages()).data == b"kept"


@pytest.mark.parametrize(
    ("error", "told"),
    [
        (SystemExit(1), "the program was ended with exit code 1"),
        (MemoryError(), "the memory was exhausted"),
        (KeyError("FF"), "KeyError: 'FF'"),
        (ValueError(), "ValueError"),
    ],
)
def test_the_reason_of_a_failure_is_told_in_words(tmp_path, error, told):
    def run():
        with create(tmp_path):
            raise error

    with pytest.raises(type(error)):
        run()
    assert list_sessions(tmp_path)[0].problem == told


@pytest.mark.parametrize("removed", [True, False])
def test_a_folder_that_goes_while_it_is_recorded_is_told_and_not_made_again(tmp_path, removed):
    session = create(tmp_path)
    session.recorder.on_received("hand", b"bytes", 1)
    session.settle()
    if removed:
        shutil.rmtree(session.folder)
    else:
        session.folder.rename(tmp_path / "elsewhere")
    with pytest.raises(
        SessionError, match=r"was removed or renamed while it was recorded.* session recover .*/NEW-NAME"
    ):
        session.close()
    assert not session.folder.exists()
    if not removed:
        assert next(Session.open(tmp_path / "elsewhere").traffic().messages()).data == b"bytes"


@pytest.mark.parametrize("times", [1, 2])
def test_an_interruption_while_a_session_is_closed_waits_until_its_status_is_written(tmp_path, monkeypatch, times):
    finish = TrafficWriter.close

    def interrupted_while_the_disk_is_slow(writer, end):
        for _ in range(times):
            signal.raise_signal(signal.SIGINT)
        finish(writer, end)

    session = create(tmp_path)
    monkeypatch.setattr(TrafficWriter, "close", interrupted_while_the_disk_is_slow)
    with pytest.raises(KeyboardInterrupt):
        session.close("interrupted")
    monkeypatch.undo()
    assert read_manifest(session.folder).status == ("interrupted" if times == 1 else "open")  # twice: at once
    session.close("interrupted")
    assert read_manifest(session.folder).status == "interrupted"
