"""The pages on protocols: what the code cites exists there, and their tables say what the codecs do."""

from __future__ import annotations

import importlib
import re
from collections import Counter
from collections.abc import Callable, Iterator
from enum import IntEnum, IntFlag
from functools import cache
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pytest

REPOSITORY = Path(__file__).resolve().parents[2]
PAGES = (REPOSITORY / "docs" / "protocols.md", *sorted((REPOSITORY / "docs" / "protocols").glob("*.md")))
CODE = ("drivers", "calibration", "sessions", "tactile_lab", "tests")
CITATION = re.compile(r"\bprotocols:\s+([^)]*)\)")
CHECKED = re.compile(r"<!-- checked: (\w+) ([\w.]+) -->\n((?:\|.*\n)+)")


def anchor(heading: str) -> str:
    """The anchor that a heading gets where Markdown is shown."""
    return re.sub(r"[^\w\- ]", "", heading.lower()).strip().replace(" ", "-")


@cache
def sections() -> list[str]:
    return [title for page in PAGES for title in re.findall(r"^## (.+)$", page.read_text(encoding="utf-8"), re.M)]


def citations() -> Iterator[tuple[str, str]]:
    """File and section of every citation in the code."""
    for folder in CODE:
        for path in sorted((REPOSITORY / folder).rglob("*.py")):
            if path == Path(__file__):
                continue
            for cited in CITATION.findall(path.read_text(encoding="utf-8")):
                for section in cited.split(";"):
                    yield path.relative_to(REPOSITORY).as_posix(), " ".join(section.split())


def checked_tables(kind: str) -> list[Any]:
    """Name of the thing in the code, and rows of cells, of every table that is said to be checked so."""
    return [
        pytest.param(name, [re.split(r"\s*\|\s*", row.strip("| ")) for row in table.splitlines()[2:]], id=name)
        for page in PAGES
        for found, name, table in CHECKED.findall(page.read_text(encoding="utf-8"))
        if found == kind
    ]


def thing(name: str) -> Any:
    module, _, attribute = name.rpartition(".")
    return getattr(importlib.import_module(module), attribute)


# --- citations -----------------------------------------------------------------------------------------------------


def test_every_section_that_the_code_cites_exists() -> None:
    cited = list(citations())
    assert len(cited) > 50  # else the pattern finds nothing any more
    unknown = [f"{path}: {section}" for path, section in cited if section not in sections()]
    assert not unknown


def test_sections_have_one_name_each() -> None:
    assert [name for name, count in Counter(map(anchor, sections())).items() if count > 1] == []


def test_no_docstring_cites_sections_by_numbers_of_another_document() -> None:
    old = re.compile(r"[Pp]rotocols (?:section )?[A-F]\.\d")
    files = (path for folder in CODE for path in (REPOSITORY / folder).rglob("*.py"))
    assert [str(path) for path in files if old.search(path.read_text(encoding="utf-8"))] == []


def test_files_that_the_pages_name_exist() -> None:
    for page in PAGES:
        for name in re.findall(r"`((?:drivers|tests)/[\w/]+\.py)`", page.read_text(encoding="utf-8")):
            assert (REPOSITORY / name).is_file(), f"{page.name}: {name}"


# --- tables against codecs -----------------------------------------------------------------------------------------


@pytest.mark.parametrize(("name", "rows"), checked_tables("codes"))
def test_codes_are_those_of_the_code(name: str, rows: list[list[str]]) -> None:
    cells = (pair for row in rows for pair in pairwise(row))
    written = {words.strip("`"): int(code, 0) for code, words in cells if re.fullmatch(r"`\w+`", words)}
    kind: type[IntEnum] | type[IntFlag] = thing(name)
    assert written == {member: each.value for member, each in kind.__members__.items()}


@pytest.mark.parametrize(("name", "rows"), checked_tables("layout"))
def test_layouts_are_those_of_the_codec(name: str, rows: list[list[str]]) -> None:
    record: np.dtype[Any] = thing(name)
    assert record.names is not None
    fields = [(record.fields[field][1], record.fields[field][0].itemsize, field) for field in record.names]
    assert [(int(offset), int(size), field.strip("`")) for offset, size, field, *_ in rows] == fields


@pytest.mark.parametrize(("name", "rows"), checked_tables("words"))
def test_status_words_are_those_of_the_code(name: str, rows: list[list[str]]) -> None:
    by_value = name.startswith("drivers.ati.wires.digital_wire")
    written = {int(row[at]): row[at + 1] for row in rows for at in (0, 2) if at + 1 < len(row) and row[at]}
    told = {word if by_value else 1 << word: text for word, text in written.items()}
    assert told == {1 << bit: text for bit in range(31) if (text := _meaning(thing(name), 1 << bit))}


def _meaning(describe: Callable[[int], Any], status: int) -> str:
    """What the code says of one bit; empty for a bit without a name, as is the one that sums up the others."""
    report = describe(status)
    (text,) = getattr(report, "messages", report)
    return "" if re.search(r"undocumented|without naming it", text) else text


def test_there_are_tables_of_every_kind() -> None:
    assert [len(checked_tables(kind)) >= least for kind, least in (("codes", 12), ("layout", 4), ("words", 3))] == [
        True,
        True,
        True,
    ]
