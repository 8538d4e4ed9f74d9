"""Sessions and tables at addresses, here in memory; tests of S3 are beside this file."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pytest
from fsspec.implementations.memory import MemoryFileSystem

from drivers.core.errors import ConfigurationError, SessionError, WriteError
from sessions.exchange.addresses import Place, address_of, checked_name, refuse_unwritable_anywhere
from sessions.exchange.elsewhere import fetch_session, list_elsewhere, store_session
from sessions.recording.listing import list_sessions
from sessions.recording.session import Session
from tactile_lab.workflow.cataloguing import catalogue, write_catalogue
from tests.support.short_session import files, short_session

HERE = "memory://laboratory"


@pytest.fixture(autouse=True)
def empty_memory() -> Iterator[None]:
    yield
    MemoryFileSystem.store.clear()
    MemoryFileSystem.pseudo_dirs[:] = [""]


@pytest.fixture(scope="module")
def closed(tmp_path_factory: pytest.TempPathFactory) -> Session:
    """Only to be read."""
    return short_session(tmp_path_factory.mktemp("runs"))


@pytest.mark.parametrize(
    ("typed", "address"),
    [
        ("s3://lab/a", "s3://lab/a"),
        ("s3:/lab/a", "s3://lab/a"),  # as a path has it
        ("memory:/a.csv", "memory://a.csv"),
        ("file:///tmp/a", "file:///tmp/a"),
        ("runs/s3", None),
        ("/tmp/a", None),
        ("C:/lab", None),
    ],
)
def test_addresses_are_told_from_paths(typed, address):
    assert address_of(Path(typed)) == address


def test_a_session_is_stored_and_fetched_unchanged(closed, tmp_path):
    address = store_session(closed, HERE)
    assert address == f"{HERE}/{closed.manifest.name}"
    assert files(fetch_session(address, tmp_path).folder) == files(closed.folder)
    with pytest.raises(ConfigurationError, match="exists already"):
        store_session(closed, HERE)
    with pytest.raises(ConfigurationError, match="exists already"):
        fetch_session(address, tmp_path)


def test_a_session_is_stored_where_folders_must_be_made(closed, tmp_path):
    address = store_session(closed, f"file://{tmp_path}/there/runs")
    assert files(fetch_session(address, tmp_path / "here").folder) == files(closed.folder)
    (line,) = catalogue([Path(f"file://{tmp_path}/there/runs")])
    assert line["folder"] == address


def test_what_cannot_be_stored_whole_leaves_nothing_there(closed, monkeypatch):
    put = MemoryFileSystem.put_file

    def torn(self: MemoryFileSystem, source: str, target: str, **options: object) -> None:
        if target.endswith("session.yaml"):  # the last one
            raise OSError(5, "the connection is gone")
        put(self, source, target, **options)

    monkeypatch.setattr(MemoryFileSystem, "put_file", torn)
    with pytest.raises(WriteError, match="the connection is gone"):
        store_session(closed, HERE)
    assert Place(HERE).names() == {}


def test_what_is_fetched_in_part_leaves_nothing_here(closed, tmp_path, monkeypatch):
    address = store_session(closed, HERE)

    def torn(self: MemoryFileSystem, source: str, target: str, **options: object) -> None:
        Path(target).write_bytes(b"half")
        raise PermissionError(13, "denied")

    monkeypatch.setattr(MemoryFileSystem, "get_file", torn)
    with pytest.raises(WriteError, match="one may not read or write there"):
        fetch_session(address, tmp_path)
    assert list(tmp_path.iterdir()) == []


def test_a_session_whose_record_is_damaged_elsewhere_is_refused_and_leaves_nothing_here(closed, tmp_path):
    address = store_session(closed, HERE)
    MemoryFileSystem().pipe_file(f"{address.removeprefix('memory:/')}/session.yaml", b"colour: red\n")
    with pytest.raises(SessionError, match="unknown key"):
        fetch_session(address, tmp_path)
    assert list(tmp_path.iterdir()) == []


def test_what_is_no_session_or_leads_elsewhere_is_refused(tmp_path):
    with pytest.raises(ConfigurationError, match="is no session"):
        fetch_session(f"{HERE}/none", tmp_path)
    for name in ("../a", "/a", "a/../../b", "", "a\\b"):
        with pytest.raises(ConfigurationError, match="no name of a file"):
            checked_name(name)


def test_sessions_elsewhere_are_catalogued_by_their_records_alone(closed, tmp_path):
    store_session(closed, HERE)
    (here,), (there,) = catalogue([closed.folder.parent]), catalogue([Path(HERE)])
    assert there == here | {"folder": f"{HERE}/{closed.manifest.name}"}
    assert (there["status"], there["contacts"], there["problem"]) == ("closed", 9, None)
    assert there["traffic_bytes"] == sum(file.stat().st_size for file in closed.folder.glob("*.mcap"))


def test_a_recording_that_was_cut_off_elsewhere_is_damaged(closed, tmp_path):
    address = store_session(closed, HERE)
    place = Place(address)
    place.write("traffic.mcap", place.read("traffic.mcap")[:-10])
    (summary,) = list_sessions(list_elsewhere(HERE, tmp_path))
    assert (summary.status, "truncated" in summary.problem) == ("damaged", True)


@pytest.mark.parametrize("kind", ["csv", "parquet"])
def test_a_catalogue_is_written_to_an_address(closed, tmp_path, kind):
    lines = catalogue([closed.folder.parent])
    write_catalogue(lines, Path(f"{HERE}/all.{kind}"))
    write_catalogue(lines, tmp_path / f"all.{kind}")
    assert Place(HERE).read(f"all.{kind}") == (tmp_path / f"all.{kind}").read_bytes()


def test_a_kind_of_address_that_nobody_knows_is_one_sentence():
    with pytest.raises(ConfigurationError, match="no such kind of address is known"):
        Place("nowhere://lab/a")
    with pytest.raises(ConfigurationError, match="no such kind of address is known"):
        refuse_unwritable_anywhere(Path("nowhere://lab/a.csv"))


def test_that_a_file_can_be_written_is_found_out_before_and_leaves_nothing(tmp_path):
    refuse_unwritable_anywhere(Path(f"{HERE}/a.csv"))
    assert Place(HERE).names() == {}
    refuse_unwritable_anywhere(tmp_path / "a.csv")
    assert not list(tmp_path.iterdir())
    with pytest.raises(ConfigurationError, match="is a folder"):
        refuse_unwritable_anywhere(tmp_path)
