"""The documentation's site has every page; ``make docs`` builds it strictly, which needs packages of its own."""

from __future__ import annotations

import re

from tests.support.repository import REPOSITORY

BESIDE = {"index.md", "CONTRIBUTING.md", "CHANGELOG.md", "library-code.md"}
"""Pages that docs/site_hooks.py adds."""


def test_every_page_has_a_place_in_the_site() -> None:
    listed = re.findall(r"^ +- .+: (\S+\.md)$|^  - tactile-lab: (\S+)$", (REPOSITORY / "mkdocs.yml").read_text(), re.M)
    pages = {page.name for page in (REPOSITORY / "docs").glob("*.md")}
    assert {first or second for first, second in listed} == pages | BESIDE | {"decisions/README.md"}


def test_the_sites_packages_are_locked_with_hashes() -> None:
    lock = (REPOSITORY / "docs" / "requirements.lock").read_text()
    assert {"mkdocs", "mkdocs-material", "mkdocstrings-python"} <= set(re.findall(r"^([\w-]+)==", lock, re.M))
    assert len(re.findall(r"--hash=sha256", lock)) >= len(re.findall(r"^[\w-]+==", lock, re.M))
