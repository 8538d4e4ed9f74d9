"""Archives from elsewhere: what they hold comes out, or nothing does."""

from __future__ import annotations

import errno
import io
import os
import re
import stat
import zipfile

import pytest

from drivers.core.errors import ConfigurationError, WriteError
from sessions.exchange import archives
from sessions.exchange.archives import ArchiveLimits, export_archive, import_archive
from sessions.recording.running_session import create_session


@pytest.fixture
def session(tmp_path):
    joints = tmp_path / "joints.yaml"
    joints.write_text("a: 1\n")
    arguments = {"rig": "sim", "rig_description": {}, "object_name": "box", "calibration_files": {"joints": joints}}
    with create_session(tmp_path / "runs", **arguments) as session:
        session.recorder.on_received("hand", b"bytes", 1)
    return session


def archive_of(path, files):
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, content in files.items():
            archive.writestr(name, content)
    return path


def files_of(session):
    files = (item for item in session.folder.rglob("*") if item.is_file())
    return {f"s/{item.relative_to(session.folder).as_posix()}": item.read_bytes() for item in files}


def repacked(session, path, changes):
    return archive_of(path, {**files_of(session), **changes})


def test_a_session_comes_back_out_of_its_archive(session, tmp_path):
    files = export_archive(session, tmp_path / "s.zip")
    found = import_archive(tmp_path / "s.zip", tmp_path / "elsewhere")
    assert found.folder == tmp_path / "elsewhere" / session.folder.name
    assert sum(item.is_file() for item in found.folder.rglob("*")) == files
    assert next(found.traffic().messages()).data == b"bytes"
    with pytest.raises(ConfigurationError, match="exists already"):
        import_archive(tmp_path / "s.zip", tmp_path / "elsewhere")
    renamed = import_archive(tmp_path / "s.zip", tmp_path / "elsewhere", "mine-2")
    assert renamed.manifest.name == "mine-2"
    with pytest.raises(ConfigurationError, match="exists already"):
        export_archive(session, tmp_path / "s.zip")


def of_a_mac(files):
    return {**files, "__MACOSX/s/._session.yaml": b"x", "s/.DS_Store": b"x", ".DS_Store": b"x"}


def without_a_folder(files):
    return {name.removeprefix("s/"): content for name, content in files.items()}


def in_folders(files):
    return {f"downloads/new/{name}": content for name, content in files.items()}


def of_windows(files):
    return {name.replace("/", "\\"): content for name, content in files.items()}


@pytest.mark.parametrize(
    ("pack", "name"), [(of_a_mac, "s"), (without_a_folder, "mine-2"), (in_folders, "s"), (of_windows, "s")]
)
def test_a_session_is_found_however_it_was_packed(session, tmp_path, pack, name):
    files = files_of(session)
    found = import_archive(archive_of(tmp_path / "Mine (2).zip", pack(files)), tmp_path / "in")
    assert found.manifest.name == name
    held = {item.relative_to(found.folder).as_posix() for item in found.folder.rglob("*") if item.is_file()}
    assert held == {file.removeprefix("s/") for file in files}


@pytest.mark.parametrize(
    "name", ["../evil.txt", "s/../../evil.txt", "/etc/evil", "C:/evil", "s\\..\\evil", "//s/evil", "s/a/b/c/d/e/f/evil"]
)
def test_unsafe_names_are_refused_and_nothing_is_left(session, tmp_path, name):
    path = repacked(session, tmp_path / "bad.zip", {name: "evil"})
    with pytest.raises(ConfigurationError, match="unsafe name"):
        import_archive(path, tmp_path / "in")
    assert not (tmp_path / "in").exists()
    assert not list(tmp_path.rglob("evil*"))


def test_links_are_refused(session, tmp_path):
    path = repacked(session, tmp_path / "bad.zip", {})
    link = zipfile.ZipInfo("s/notes.txt")
    link.external_attr = (stat.S_IFLNK | 0o777) << 16
    with zipfile.ZipFile(path, "a") as archive:
        archive.writestr(link, "/etc/passwd")
    with pytest.raises(ConfigurationError, match="is a link"):
        import_archive(path, tmp_path / "in")


def test_what_is_encrypted_is_refused_by_name(session, tmp_path):
    path = repacked(session, tmp_path / "bad.zip", {})
    content = bytearray(path.read_bytes())
    for entry in re.finditer(rb"PK\x01\x02", bytes(content)):
        content[entry.start() + 8] |= 1
    path.write_bytes(content)
    with pytest.raises(ConfigurationError, match="is encrypted"):
        import_archive(path, tmp_path / "in")
    assert not (tmp_path / "in").exists()


def test_no_more_bytes_come_out_than_an_archive_may_have(tmp_path):
    with pytest.raises(ConfigurationError, match="unpacks to more bytes than it declares"):
        archives._copy(io.BytesIO(bytes(11)), io.BytesIO(), 10, tmp_path / "s.zip")
    out = io.BytesIO()
    assert archives._copy(io.BytesIO(b"0123456789"), out, 10, tmp_path / "s.zip") == 10
    assert out.getvalue() == b"0123456789"


def test_sizes_are_bounded(session, tmp_path):
    bomb = repacked(session, tmp_path / "bomb.zip", {"s/zeros": bytes(20_000_000)})
    with pytest.raises(ConfigurationError, match="which is implausible"):
        import_archive(bomb, tmp_path / "in")
    small = repacked(session, tmp_path / "small.zip", {})
    with pytest.raises(ConfigurationError, match="more than 100"):
        import_archive(small, tmp_path / "in", limits=ArchiveLimits(total_bytes=100))
    with pytest.raises(ConfigurationError, match="files, more than 2"):
        import_archive(small, tmp_path / "in", limits=ArchiveLimits(files=2))
    assert not (tmp_path / "in").exists()


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"other/session.yaml": ""}, r"2 sessions \(other, s\), not one"),
        ({"other/notes.txt": ""}, r"1 files beside the session s, such as other/notes\.txt"),
        ({"s/session.yaml": "colour: red\n"}, "unknown key"),
        ({"s/calibration/joints.yaml": "a: 2\n"}, "changed since the recording"),
        ({"s/traffic.mcap": b"hello"}, "not an MCAP file"),
    ],
)
def test_an_archive_that_is_no_whole_session_is_refused_and_nothing_is_left(session, tmp_path, changes, words):
    path = repacked(session, tmp_path / "bad.zip", changes)
    with pytest.raises(ConfigurationError, match=words):
        import_archive(path, tmp_path / "in")
    assert not (tmp_path / "in").exists() or not list((tmp_path / "in").iterdir())


def test_a_session_without_its_recording_is_none(session, tmp_path):
    files = {name: content for name, content in files_of(session).items() if not name.endswith("traffic.mcap")}
    with pytest.raises(ConfigurationError, match=r"contains no session \(a folder with session\.yaml and traffic"):
        import_archive(archive_of(tmp_path / "bad.zip", files), tmp_path / "in")


def test_half_an_archive_on_a_full_disk_is_taken_away(session, tmp_path, monkeypatch):
    def fill(*arguments):
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    monkeypatch.setattr(zipfile.ZipFile, "write", fill)
    with pytest.raises(WriteError, match=r"cannot be written .*Check the disk"):
        export_archive(session, tmp_path / "s.zip")
    assert not (tmp_path / "s.zip").exists()


def test_many_small_files_are_weighed_together(tmp_path):
    path = archive_of(tmp_path / "many.zip", {f"s/{number}": bytes(1 << 20) for number in range(40)})
    with pytest.raises(ConfigurationError, match="to 41943040, out of all proportion"):
        import_archive(path, tmp_path / "in")
    assert not (tmp_path / "in").exists()


@pytest.mark.parametrize("name", ["Big", "a b", "x" * 65, "", "../up", "ä"])
def test_names_that_are_no_ids_are_refused(session, tmp_path, name):
    export_archive(session, tmp_path / "s.zip")
    archive = zipfile.ZipFile(tmp_path / "s.zip")
    archive.close()
    if name:
        with pytest.raises(ConfigurationError, match="cannot be the name of a session"):
            import_archive(tmp_path / "s.zip", tmp_path / "in", name)
    assert not (tmp_path / "in").exists()


def test_what_is_no_archive_is_told(tmp_path):
    (tmp_path / "a.zip").write_bytes(b"hello")
    with pytest.raises(ConfigurationError, match="not a ZIP archive"):
        import_archive(tmp_path / "a.zip", tmp_path)
    with pytest.raises(ConfigurationError, match="No such file"):
        import_archive(tmp_path / "none.zip", tmp_path)
    with pytest.raises(ConfigurationError, match="contains no session"):
        import_archive(archive_of(tmp_path / "empty.zip", {}), tmp_path)


def test_a_full_disk_is_not_the_archive_s_fault_and_nothing_is_left(session, tmp_path, monkeypatch):
    def fill(*arguments):
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    export_archive(session, tmp_path / "s.zip")
    monkeypatch.setattr(archives, "_copy", fill)
    with pytest.raises(WriteError, match="the disk is full"):
        import_archive(tmp_path / "s.zip", tmp_path / "in")
    assert not list((tmp_path / "in").iterdir())
