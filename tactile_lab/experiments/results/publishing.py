"""All pages and pictures of the stored results, as ``make results`` writes them."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

from drivers.core.atomic_files import write_whole
from tactile_lab.experiments.plots import draw
from tactile_lab.experiments.results.headlines import front_page
from tactile_lab.experiments.results.overview import overview
from tactile_lab.experiments.results.pages import merge_plots, page
from tactile_lab.experiments.results.stored_result import StoredResult
from tactile_lab.experiments.results.storing import DATA, NOTES, PICTURES, RESULTS

MARK = "<!-- `make results` writes this page from data/{name}.json and notes/{name}.md. -->\n"


def stored_results(docs: Path) -> dict[str, StoredResult]:
    """All stored results by name. Raises SessionError for a file that is not a stored result."""
    files = sorted((docs / RESULTS / DATA).glob("*.json"))
    return {file.stem: StoredResult.read(file) for file in files}


@dataclass(frozen=True)
class Age:
    """Whether a part of a stored result was made by the present code.

    Attributes:
        name: of the result.
        date: day on which the part was made.
        version: hash of the sources that made it, or a commit.
        is_current: whether these are the present sources.
    """

    name: str
    date: str
    version: str
    is_current: bool


def ages(docs: Path, sources: str) -> list[Age]:
    """The age of every part of every stored result, compared with a hash of sources. Raises SessionError."""
    return [
        Age(name, made.date, made.version, made.is_of(sources))
        for name, result in stored_results(docs).items()
        for made in (part.made_by for part in result.parts)
    ]


def make_pages(docs: Path) -> dict[str, str]:
    """Every page and picture, by its path in the folder of documents.

    Raises:
        SessionError: a file is not a stored result.
        ConfigurationError: the claims do not fit the stored results.
    """
    results = stored_results(docs)
    texts: dict[str, str] = {}
    for name, result in results.items():
        plot, notes = merge_plots(result.parts), docs / RESULTS / NOTES / f"{name}.md"
        if plot is not None:
            texts[f"{PICTURES}/{name}.svg"] = draw(result.sentence.rstrip("."), plot)
        written = notes.read_text(encoding="utf-8").replace("](../", "](") if notes.is_file() else ""  # one folder up
        picture = f"../{PICTURES}/{name}.svg" if plot is not None else ""
        texts[f"{RESULTS}/{name}.md"] = MARK.format(name=name) + page(result, written, picture)
    return {**texts, **overview(docs, results)}


def publish(docs: Path) -> list[Path]:
    """Write what has changed, and return it. Raises as :func:`make_pages`, and WriteError."""
    pages = {docs / path: text for path, text in make_pages(docs).items()}
    changed = _changed({**pages, **front_page(docs, stored_results(docs))})
    for path, text in changed.items():
        write_whole(path, text)
    return list(changed)


def _changed(files: Mapping[Path, str]) -> dict[Path, str]:
    return {
        path: text for path, text in files.items() if not path.is_file() or path.read_text(encoding="utf-8") != text
    }
