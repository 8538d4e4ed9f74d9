"""The pages of the repository are those that ``make results`` writes; their links lead somewhere."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from tactile_lab.experiments.results.publishing import make_pages, publish, stored_results

DOCS = Path(__file__).resolve().parents[4] / "docs"
BY_HAND = {"ablation", "machine", "mutants"}
RENEW = "run 'make results' (tactile-lab experiment pages) and commit what it writes"
VERDICT = re.compile(
    r"Made by this version of the code|\*\*Made by an older version of the code\*\*|this version|older: "
)


@pytest.fixture(scope="module")
def written() -> dict[str, str]:
    return make_pages(DOCS)


def test_the_pages_are_those_that_make_results_writes(written: dict[str, str]) -> None:
    """Whether a result is older is left to the next test: it changes with any source."""
    differ = [path for path, text in written.items() if _as_it_stands(path) != VERDICT.sub("", text)]
    assert differ == [], RENEW


def test_no_page_says_that_an_older_result_is_of_this_version(written: dict[str, str]) -> None:
    differ = [path for path, text in written.items() if (DOCS / path).read_text(encoding="utf-8") != text]
    assert differ == [], f"sources have changed since a result was stored: {RENEW}"


def test_there_are_no_other_pages_and_notes() -> None:
    names = set(stored_results(DOCS))
    assert {path.stem for path in (DOCS / "results").glob("*.md")} == names | BY_HAND
    assert {path.stem for path in (DOCS / "results" / "notes").glob("*.md")} <= names


def test_publishing_writes_only_what_has_changed(tmp_path: Path, written: dict[str, str]) -> None:
    for path in (DOCS / "results").rglob("*"):
        if path.suffix in {".json", ".yaml"} or path.parent.name == "notes":
            copy = tmp_path / path.relative_to(DOCS)
            copy.parent.mkdir(parents=True, exist_ok=True)
            copy.write_bytes(path.read_bytes())
    assert {path.relative_to(tmp_path).as_posix() for path in publish(tmp_path)} == set(written)
    assert publish(tmp_path) == []
    (tmp_path / "results.md").write_text("by hand")
    assert publish(tmp_path) == [tmp_path / "results.md"]


def test_the_overview_is_short_and_has_a_plot_for_each_claim() -> None:
    lines = (DOCS / "results.md").read_text(encoding="utf-8").splitlines()
    assert len(lines) <= 200
    claims = [line for line in lines if line.startswith("## ")][:-1]  # the last says where figures come from
    assert len([line for line in lines if line.startswith("![")]) == len(claims) >= 12


def test_links_of_the_overview_lead_to_files() -> None:
    text = (DOCS / "results.md").read_text(encoding="utf-8")
    found = re.findall(r"\]\(([^)\s#]+)", text)
    assert {f"results/{name}.md" for name in stored_results(DOCS)} <= set(found)
    assert [transport for transport in found if "://" not in transport and not (DOCS / transport).is_file()] == []


def _as_it_stands(path: str) -> str:
    file = DOCS / path
    return VERDICT.sub("", file.read_text(encoding="utf-8")) if file.is_file() else ""
