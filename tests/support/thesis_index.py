"""Finds where the code cites the thesis, and updates the links of the index in ``docs/thesis.md``.

python -m tests.support.thesis_index            # brings the index's line numbers up to date
python -m tests.support.thesis_index --list     # every citation in the code
"""

from __future__ import annotations

import argparse
import re
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

REPOSITORY = Path(__file__).resolve().parents[2]
PAGE = REPOSITORY / "docs" / "thesis.md"
CODE = ("tactile_lab", "drivers", "calibration", "sessions")

LAST_EQUATIONS = {"2": 24, "3": 26, "4": 21, "A": 0, "B": 0, "C": 3}
"""Number of the last equation of each chapter and appendix."""

_NUMBER = r"[2-5ABC]\.\d+(?:\.\d+)*"
_NUMBERS = rf"{_NUMBER}(?:(?:\s*,|\s+and|\s+to|\s*-)\s*{_NUMBER})*"
_KINDS = {"eq": "equation", "section": "section", "algorithm": "algorithm", "figure": "figure", "table": "table"}
_NAMED = re.compile(rf"(?<!protocols )\b(equation|eq|section|algorithm|figure|table)(?:s|\.)?[\s-]+({_NUMBERS})", re.I)
_APPENDIX = re.compile(r"\bappendix\s+([ABC])\b(?!\.)", re.I)
_IN_PARENTHESES = re.compile(rf"(?<![\w.])\(({_NUMBERS})\)")
_HEADS = {*_KINDS.values(), "appendix"}
_LINK = re.compile(r"\[([^\]]+)\]\(\.\./([\w/]+\.py)(?:#L(\d+))?\)")


@dataclass(frozen=True)
class Citation:
    """One place where the code cites the thesis.

    Attributes:
        item: what is cited, such as ``equation 3.9``.
        path: file, from the root of the repository.
        line: number of the line, from 1.
        weight: how likely the line implements the item: 2 for a comment beside a statement, 1 for the first line of a
            docstring, 0 elsewhere.
    """

    item: str
    path: str
    line: int
    weight: int


def citations(root: Path = REPOSITORY) -> Iterator[Citation]:
    """Every citation in the code."""
    for folder in CODE:
        for path in sorted((root / folder).rglob("*.py")):
            yield from cited_in(path.read_text(encoding="utf-8"), path.relative_to(root).as_posix())


def cited_in(text: str, path: str) -> Iterator[Citation]:
    """Every citation in a file's text."""
    lines = text.splitlines()
    for kind, numbers, at in _places(text):
        number = text.count("\n", 0, at) + 1
        line = lines[number - 1]
        weight = 2 if "# " in line[: at - text.rfind("\n", 0, at)] else int(line.lstrip().startswith('"""'))
        for each in expand(numbers):
            if kind != "equation" or _is_equation(each):
                yield Citation(f"{kind} {each}", path, number, weight)


def _places(text: str) -> Iterator[tuple[str, str, int]]:
    for match in _NAMED.finditer(text):
        yield _KINDS.get(match[1].lower(), match[1].lower()), match[2], match.start()
    for match in _APPENDIX.finditer(text):
        yield "appendix", match[1].upper(), match.start()
    for match in _IN_PARENTHESES.finditer(text):
        yield "equation", match[1], match.start()


def expand(numbers: str) -> list[str]:
    """Single numbers of a list: ``3.7 and 3.8``, ``3.19 to 3.25`` or ``3.10-3.15``; the letter of an appendix."""
    words = re.findall(rf"{_NUMBER}|\bto\b|-|^[ABC]$", numbers)
    found: list[str] = []
    for before, word in zip([None, *words], words, strict=False):
        if before in ("to", "-") and found:
            chapter, first = found[-1].rsplit(".", 1)
            found += [f"{chapter}.{number}" for number in range(int(first) + 1, int(word.rsplit(".", 1)[1]) + 1)]
        elif word not in ("to", "-"):
            found.append(word)
    return found


def _is_equation(number: str) -> bool:
    chapter, _, count = number.partition(".")
    return count.isdigit() and 1 <= int(count) <= LAST_EQUATIONS.get(chapter, 0)


@dataclass(frozen=True)
class Row:
    """One row of the index.

    Attributes:
        place: line of the page, from 0.
        items: the items of the row, such as ``equation 3.17`` and ``equation 3.18``.
        links: files that it names, with the line to which each link leads (0 if it has none).
    """

    place: int
    items: tuple[str, ...]
    links: tuple[tuple[str, int], ...]


def rows(page: str) -> Iterator[Row]:
    """The rows of all tables of the page whose first column has a kind of item as its title, such as ``Equation``."""
    kind = ""
    for place, line in enumerate(page.splitlines()):
        first = line.strip("| ").split("|")[0].strip() if line.startswith("|") else ""
        if not first or first.lower() in _HEADS:
            kind = first.lower()
        elif kind and not set(first) <= set("-:"):
            links = ((path, int(number or 0)) for _, path, number in _LINK.findall(line))
            yield Row(place, tuple(f"{kind} {each}" for each in expand(first)), tuple(links))


def best_line(row: Row, path: str, cited: list[Citation]) -> int | None:
    """The line of a file to which a row's link must lead; None if the file cites none of the row's items."""
    places = [each for each in cited if each.path == path and each.item in row.items]
    return min(places, key=lambda each: (-each.weight, each.line)).line if places else None


def refreshed(page: str, cited: list[Citation]) -> str:
    """The page with links to the right lines."""
    lines = page.splitlines()
    for row in rows(page):
        for path, _ in row.links:
            anchor = f"#L{number}" if (number := best_line(row, path, cited)) else ""
            link = re.compile(rf"\(\.\./{re.escape(path)}(?:#L\d+)?\)")
            lines[row.place] = link.sub(f"(../{path}{anchor})", lines[row.place])
    return "\n".join(lines) + "\n"


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--list", action="store_true", help="print every citation instead")
    found = sorted(citations(), key=lambda each: (each.item, each.path, each.line))
    if parser.parse_args().list:
        for each in found:
            print(f"{each.item:16} {each.path}:{each.line}")
        return
    PAGE.write_text(refreshed(PAGE.read_text(encoding="utf-8"), found), encoding="utf-8")


if __name__ == "__main__":
    main()
