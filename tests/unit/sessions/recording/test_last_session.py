"""The word ``last``: the newest recording, whatever was made of recordings since, and wherever they came from."""

from __future__ import annotations

from datetime import UTC, datetime

import pytest

from drivers.core.clock import utc_text
from drivers.core.errors import ConfigurationError
from sessions.exchange.archives import export_archive, import_archive
from sessions.exchange.extracting import Piece, extract
from sessions.recording.listing import find_session, list_sessions
from sessions.recording.manifest import read_manifest
from sessions.recording.recovery import recover
from sessions.recording.running_session import create_session


def recorded(root, minute, object_name="box"):
    started = datetime(2026, 11, 21, 9, minute, tzinfo=UTC)
    with create_session(root, rig="sim", rig_description={}, object_name=object_name, started=started) as session:
        session.recorder.on_received("hand", b"bytes", 1)
    return session


def last(root):
    return find_session(root, "last").folder


@pytest.fixture
def archive(tmp_path):
    """A session of another laboratory, whose clock is ahead."""
    export_archive(recorded(tmp_path / "other", 59), tmp_path / "other.zip")
    return tmp_path / "other.zip"


def test_the_newest_recording_is_the_last_session_whatever_its_name(tmp_path):
    newest = recorded(tmp_path, 31, "a")
    recorded(tmp_path, 30, "z")
    assert last(tmp_path) == newest.folder


def test_neither_a_piece_nor_an_import_becomes_the_last_session(tmp_path, archive):
    root = tmp_path / "runs"
    newest = recorded(root, 31)
    extract(newest, root / "zz-piece", Piece())
    import_archive(archive, root)
    assert last(root) == newest.folder
    made = {item.folder.name: item.derived for item in list_sessions(root)}
    assert sorted(made.values()) == [(), ("import",), ("piece",)]
    assert made["zz-piece"] == ("piece",)


def test_a_recovery_stands_in_for_the_torn_session_and_not_for_a_later_one(tmp_path):
    torn = recorded(tmp_path, 31).folder
    manifest = torn / "session.yaml"
    manifest.write_text(manifest.read_text().replace("status: closed", "status: open"))
    assert last(tmp_path) == torn
    assert recover(torn).folder == last(tmp_path)
    later = recorded(tmp_path, 32)
    assert last(tmp_path) == later.folder


def test_an_older_session_is_not_the_last_one_where_the_newest_cannot_be_read(tmp_path):
    older, newest = recorded(tmp_path, 31), recorded(tmp_path, 32)
    (newest.folder / "session.yaml").write_text("status: [")
    with pytest.raises(ConfigurationError, match=rf"{newest.folder.name}: is the last session.*session recover"):
        last(tmp_path)
    older.folder.rename(tmp_path / "29991231-235959-box")
    assert last(tmp_path).name == "29991231-235959-box"


def test_no_session_is_called_last(tmp_path, archive):
    with pytest.raises(ConfigurationError, match="means the newest session"):
        import_archive(archive, tmp_path / "runs", "last")
    recorded(tmp_path / "runs", 31).folder.rename(tmp_path / "runs" / "last")
    with pytest.raises(ConfigurationError, match=r"is the name of a session here.*give a path"):
        last(tmp_path / "runs")


def test_where_nothing_was_recorded_last_names_what_there_is(tmp_path, archive):
    session = import_archive(archive, tmp_path / "runs")
    with pytest.raises(ConfigurationError, match=rf"only extracts and imports.*give a name: {session.folder.name}"):
        last(tmp_path / "runs")


def test_each_step_from_a_recording_is_kept_with_its_own_time(tmp_path, archive):
    before = utc_text(datetime.now(UTC))
    imported = import_archive(archive, tmp_path / "runs", "theirs")
    extract(imported, tmp_path / "runs" / "piece", Piece())
    manifest = read_manifest(tmp_path / "runs" / "piece")
    assert [(step.how, step.source) for step in manifest.derived] == [("import", "other.zip"), ("piece", "theirs")]
    assert manifest.started_utc == "2026-11-21T09:59:00+00:00"
    times = [step.made_utc for step in manifest.derived]
    assert times == sorted([before, *times, utc_text(datetime.now(UTC))])[1:-1]
    assert manifest.derived[1].words == f"a piece of theirs, {times[1]}"
