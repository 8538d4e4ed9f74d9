"""Extensions in files of their own, forgotten after each test."""

from __future__ import annotations

import os
from collections.abc import Iterator
from pathlib import Path

import pytest

from drivers.core.extensions import VARIABLE, unload_extension
from tests.support.extending_page import Written, code


@pytest.fixture
def written(tmp_path: Path) -> Iterator[Written]:
    """Writes an extension into the test's folder: a block of the page by its name, or a text of its own."""
    before, made = os.environ.get(VARIABLE), list[Path]()

    def write(file: str, text: str | None = None) -> Path:
        path = tmp_path / file
        path.write_text(code(file) if text is None else text)
        made.append(path)
        return path

    yield write
    for path in made:
        unload_extension(path)
    assert os.environ.get(VARIABLE) == before
