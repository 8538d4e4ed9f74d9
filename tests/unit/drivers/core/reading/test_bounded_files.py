"""Files that would fill the memory or never end are refused, by their size and kind alone."""

from __future__ import annotations

import os
from pathlib import Path

import pytest

from drivers.core.errors import ConfigurationError
from drivers.core.reading.bounded_files import check_size, read_bounded, read_input


def test_a_file_is_read_up_to_its_limit(tmp_path: Path) -> None:
    (tmp_path / "file").write_bytes(b"12345")
    assert read_bounded(tmp_path / "file", 5) == b"12345"
    for check in (read_bounded, check_size):
        with pytest.raises(ConfigurationError, match=r"file: is too large: .* bytes, and at most 4 are read"):
            check(tmp_path / "file", 4)


def test_pipes_and_devices_are_not_waited_for(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "pipe")
    for place in (tmp_path / "pipe", Path("/dev/zero")):
        for check in (read_bounded, check_size):
            with pytest.raises(ConfigurationError, match="is a pipe or device"):
                check(place, 1000)


def test_what_is_missing_or_a_folder_is_the_system_s_to_tell(tmp_path: Path) -> None:
    with pytest.raises(FileNotFoundError):
        read_bounded(tmp_path / "none", 10)
    with pytest.raises(IsADirectoryError):
        read_bounded(tmp_path, 10)


def test_a_file_that_a_person_names_and_that_is_not_there_is_told(tmp_path: Path) -> None:
    (tmp_path / "file").write_bytes(b"12345")
    assert read_input(tmp_path / "file", 5) == b"12345"
    with pytest.raises(
        ConfigurationError, match=r"none: cannot be read \(No such file or directory\)\. Check the path"
    ):
        read_input(tmp_path / "none", 5)
