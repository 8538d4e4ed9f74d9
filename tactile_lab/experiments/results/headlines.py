"""What the repository's front page says of the results: words of the claims, figures of the stored results."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from textwrap import fill

from drivers.core.configuration import load_model
from tactile_lab.experiments.results.claims import Claims, Headline, judge_goal
from tactile_lab.experiments.results.overview import CLAIMS
from tactile_lab.experiments.results.stored_result import StoredResult
from tactile_lab.experiments.results.storing import RESULTS

FRONT_PAGE = "README.md"
BEGIN, END = "<!-- headlines: `make results` writes them -->\n", "<!-- end of headlines -->\n"
_WIDTH = 127


def front_page(docs: Path, results: Mapping[str, StoredResult]) -> dict[Path, str]:
    """The front page beside the folder of documents with its headlines, by its path; nothing if it has no room for any.

    Raises:
        ConfigurationError: the claims do not fit the stored results.
    """
    file = docs.parent / FRONT_PAGE
    text = file.read_text(encoding="utf-8") if file.is_file() else ""
    before, begin, rest = text.partition(BEGIN)
    _, end, after = rest.partition(END)
    if not end:
        return {}
    written = load_model(docs / RESULTS / CLAIMS, Claims)
    lines = "".join(_line(headline, results) for headline in written.headlines)
    return {file: before + begin + lines + end + after}


def _line(headline: Headline, results: Mapping[str, StoredResult]) -> str:
    figures = [judge_goal(goal, results).text for goal in headline.goals]
    text = f"- {headline.text.strip().format(*figures)}"
    return fill(text, _WIDTH, subsequent_indent="  ", break_long_words=False, break_on_hyphens=False) + "\n"
