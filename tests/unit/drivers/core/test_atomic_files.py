"""Files are written whole or not at all, and a failure says what to do."""

from __future__ import annotations

import errno
import os

import pytest

from drivers.core.atomic_files import refuse_unwritable, refuse_unwritable_folder, write_whole
from drivers.core.errors import ConfigurationError, WriteError


@pytest.fixture
def old(tmp_path):
    path = tmp_path / "record.yaml"
    path.write_text("old")
    return path


def test_text_and_bytes_are_written_with_the_line_ends_they_have_and_folders_are_made(tmp_path):
    write_whole(tmp_path / "a" / "b" / "text", "ä\r\nb\n")
    write_whole(tmp_path / "a" / "bytes", b"\x00\xff")
    assert (tmp_path / "a" / "b" / "text").read_bytes() == b"\xc3\xa4\r\nb\n"
    assert (tmp_path / "a" / "bytes").read_bytes() == b"\x00\xff"


@pytest.mark.parametrize("number", [errno.ENOSPC, errno.EDQUOT])
def test_a_full_disk_is_called_full_and_keeps_the_old_file(old, monkeypatch, number):
    def full(_: int) -> None:
        raise OSError(number, os.strerror(number))

    monkeypatch.setattr("drivers.core.atomic_files.os.fsync", full)
    with pytest.raises(WriteError, match=r"record.yaml: the disk is full\. Free some space") as caught:
        write_whole(old, "new", "Choose another file with --out")
    assert caught.value.exit_code == 1
    assert old.read_text() == "old"
    assert list(old.parent.iterdir()) == [old]


def test_an_interruption_leaves_the_old_file_and_no_other(old, monkeypatch):
    def interrupted(_: int) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr("drivers.core.atomic_files.os.fsync", interrupted)
    with pytest.raises(KeyboardInterrupt):
        write_whole(old, "new")
    assert old.read_text() == "old"
    assert list(old.parent.iterdir()) == [old]


def test_a_folder_one_may_not_write_to_is_named_with_what_to_do(old, monkeypatch):
    def refused(*_: object, **__: object) -> None:
        raise PermissionError(errno.EACCES, os.strerror(errno.EACCES))

    monkeypatch.setattr("pathlib.Path.open", refused)  # the rights of a folder do not stop the root user
    with pytest.raises(WriteError, match=r"cannot be written \(Permission denied\)\. Choose another folder"):
        write_whole(old, "new")


def test_a_file_in_the_place_of_a_folder_is_told(old):
    with pytest.raises(WriteError, match=r"inside: cannot be written \(.*record.yaml is not a folder\)\. Use --out"):
        write_whole(old / "inside", "new", "Use --out")


def test_a_place_that_could_not_be_written_later_is_refused_now(tmp_path):
    (tmp_path / "file").touch()
    with pytest.raises(ConfigurationError, match=r"is a folder\. Name a file"):
        refuse_unwritable(tmp_path)
    for refuse in (refuse_unwritable, refuse_unwritable_folder):
        with pytest.raises(ConfigurationError, match=r"cannot be written \(.*file is not a folder\)"):
            refuse(tmp_path / "file" / "below" / "it")
        refuse(tmp_path / "new" / "place")
    refuse_unwritable(tmp_path / "file")
    refuse_unwritable_folder(tmp_path)
    assert [item.name for item in tmp_path.iterdir()] == ["file"]


@pytest.mark.parametrize("number", [errno.EROFS, errno.EACCES, errno.ENOENT])
def test_a_folder_that_takes_no_file_is_refused_whatever_its_permissions_say(tmp_path, monkeypatch, number):
    def refuse(**where):
        raise OSError(number, os.strerror(number))

    monkeypatch.setattr("drivers.core.atomic_files.TemporaryFile", refuse)
    with pytest.raises(
        ConfigurationError, match=rf"cannot be written \({os.strerror(number)}\). Choose another folder"
    ):
        refuse_unwritable_folder(tmp_path)
