"""All pages and pictures of the stored results, as ``make results`` writes them."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

from drivers.core.atomic_files import write_whole
from tactile_lab.experiments.execution.source_version import version
from tactile_lab.experiments.plots import draw
from tactile_lab.experiments.results.overview import overview
from tactile_lab.experiments.results.pages import merge_plots, page
from tactile_lab.experiments.results.stored_result import StoredResult
from tactile_lab.experiments.results.storing import DATA, NOTES, PICTURES, RESULTS

MARK = "<!-- `make results` writes this page from data/{name}.json and notes/{name}.md. -->\n"


def stored_results(docs: Path) -> dict[str, StoredResult]:
    """All stored results by name. Raises SessionError for a file that is not a stored result."""
    files = sorted((docs / RESULTS / DATA).glob("*.json"))
    return {file.stem: StoredResult.read(file) for file in files}


def make_pages(docs: Path, sources: str | None = None) -> dict[str, str]:
    """Every page and picture, by its path in the folder of documents.

    Args:
        docs: folder of the documents.
        sources: hash of the sources to compare results with; None for those of this program.

    Raises:
        SessionError: a file is not a stored result.
        ConfigurationError: the claims do not fit the stored results.
    """
    sources, results = sources or version(), stored_results(docs)
    texts: dict[str, str] = {}
    for name, result in results.items():
        plot, notes = merge_plots(result.parts), docs / RESULTS / NOTES / f"{name}.md"
        if plot is not None:
            texts[f"{PICTURES}/{name}.svg"] = draw(result.sentence.rstrip("."), plot)
        written = notes.read_text(encoding="utf-8").replace("](../", "](") if notes.is_file() else ""  # one folder up
        picture = f"../{PICTURES}/{name}.svg" if plot is not None else ""
        texts[f"{RESULTS}/{name}.md"] = MARK.format(name=name) + page(result, sources, written, picture)
    return {**texts, **overview(docs, results, sources)}


def publish(docs: Path) -> list[Path]:
    """Write what has changed, and return it. Raises as :func:`make_pages`, and WriteError."""
    changed = _changed(docs, make_pages(docs))
    for path, text in changed.items():
        write_whole(path, text)
    return list(changed)


def _changed(docs: Path, texts: Mapping[str, str]) -> dict[Path, str]:
    files = {docs / path: text for path, text in texts.items()}
    return {
        path: text for path, text in files.items() if not path.is_file() or path.read_text(encoding="utf-8") != text
    }
