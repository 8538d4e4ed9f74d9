"""The page of all claims: goals, what is reached, a plot for each claim, and links to the pages of the results."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from textwrap import fill

from drivers.core.configuration import load_model
from tactile_lab.experiments.plots import draw
from tactile_lab.experiments.results.claims import MET, Claim, Claims, Goal, judge_goal, plot
from tactile_lab.experiments.results.stored_result import StoredResult
from tactile_lab.experiments.results.storing import PICTURES, RESULTS
from tactile_lab.experiments.summary import markdown

OVERVIEW, CLAIMS = "results.md", "claims.yaml"
_FIGURE = "figure-"
_WIDTH = 190
"""Of a line of text: the whole page is to have at most 200 lines."""


def overview(docs: Path, results: Mapping[str, StoredResult]) -> dict[str, str]:
    """The page and the pictures of the claims, by their paths in the folder of documents.

    Raises:
        ConfigurationError: the claims are invalid, or name something that no stored result has.
    """
    written = load_model(docs / RESULTS / CLAIMS, Claims)
    texts = {_picture(claim): draw(claim.title, plot(claim, results)) for claim in written.claims}
    sections = [_section(claim, results) for claim in written.claims]
    pages = [written.intro.strip(), _glance(written, results), *sections, written.outro.strip()]
    texts[OVERVIEW] = "\n\n".join([*pages, _index(written, results)]).rstrip() + "\n"
    return texts


def _picture(claim: Claim) -> str:
    return f"{PICTURES}/claim-{claim.name}.svg"


def _glance(claims: Claims, results: Mapping[str, StoredResult]) -> str:
    """All goals in one table."""
    rows = [["", "asked", "reached", "", "made by"]]
    for claim in claims.claims:
        for goal in claim.goals:
            found = judge_goal(goal, results)
            rows.append([goal.what, _limit(goal), found.text, found.verdict, found.part.made_by.version])
    return markdown(rows).rstrip("\n")


def _limit(goal: Goal) -> str:
    if goal.asked is None:
        return "–"
    if goal.asked == 0.0 and not goal.at_least:
        return "none"
    return f"{'≥' if goal.at_least else '≤'} {goal.asked:g} {goal.unit}".strip()


def _section(claim: Claim, results: Mapping[str, StoredResult]) -> str:
    links = ", ".join(_link(name, name) for name in claim.pages)
    text = f"{_balance(claim, results)} {claim.text.strip()} More: {links}."
    return f"## {claim.title}\n\n{_fill(text)}\n![{claim.title}]({_picture(claim)})"


def _balance(claim: Claim, results: Mapping[str, StoredResult]) -> str:
    """The number of the claim's goals that are met, as a sentence."""
    verdicts = [verdict for goal in claim.goals if (verdict := judge_goal(goal, results).verdict)]
    missed = len(verdicts) - verdicts.count(MET)
    if not verdicts:
        return "*Nothing was asked.*"
    return f"*Missed: {missed} of {len(verdicts)} goals.*" if missed else "*Every goal is met.*"


def _index(claims: Claims, results: Mapping[str, StoredResult]) -> str:
    """Links to the pages that no claim leads to."""
    linked = {name for claim in claims.claims for name in claim.pages}
    others = [name for name in results if name not in linked]
    figures = [_link(name, name.removeprefix(_FIGURE)) for name in others if name.startswith(_FIGURE)]
    rest = [_link(name, name) for name in others if not name.startswith(_FIGURE)]
    sentences = (("Figures of the thesis", figures), ("More pages", rest))
    return _fill(" ".join(f"{begin}: {', '.join(links)}." for begin, links in sentences if links))


def _link(name: str, words: str) -> str:
    return f"[{words}]({RESULTS}/{name}.md)"


def _fill(text: str) -> str:
    return fill(text, _WIDTH, break_long_words=False, break_on_hyphens=False)
