"""Whether the tables of a page are older than the code: asked on the page, answered where the page is read.

A page cannot know what is changed after it was written. The documentation's site is generated from the code, so that
it has the answer; it runs this file alone, without the packages.
"""

from __future__ import annotations

import re

ASK = "Has the code changed since? `tactile-lab experiment age` says."
"""Behind the version of every table."""

CURRENT, OLDER = "The code has not changed since.", "**The code has changed since.**"
_MADE = re.compile(rf"(?P<made>by (?:sources (?P<sources>\w+)|commit)[^|]*?) {re.escape(ASK)}")
_CELL = re.compile(r"\| (?P<version>[0-9a-f]{7,16}(?: to [0-9a-f]{7,16})?) \|$", re.MULTILINE)


def answer(markdown: str, sources: str) -> str:
    """A page of a stored result with the question of each table answered.

    Args:
        markdown: the page.
        sources: hash of the present sources.
    """
    return _MADE.sub(lambda made: f"{made['made']} {CURRENT if made['sources'] == sources else OLDER}", markdown)


def answer_overview(markdown: str, sources: str) -> str:
    """The page of all claims, with the same said behind the version of each figure."""
    return _CELL.sub(
        lambda cell: "| this version |" if cell["version"] == sources else f"| older: {cell['version']} |", markdown
    )
