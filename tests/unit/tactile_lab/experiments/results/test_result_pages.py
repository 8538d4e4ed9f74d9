"""The pages of the repository are those that ``make results`` writes; their links lead somewhere."""

from __future__ import annotations

import json
import re
from pathlib import Path

import pytest

from tactile_lab.cli.main import main
from tactile_lab.experiments.results.headlines import BEGIN, front_page
from tactile_lab.experiments.results.page_ages import ASK, OLDER, answer, answer_overview
from tactile_lab.experiments.results.publishing import ages, make_pages, publish, stored_results
from tests.support.repository import REPOSITORY

DOCS = REPOSITORY / "docs"
BY_HAND = {"ablation", "machine", "mutants"}
RENEW = "run 'make results' (tactile-lab experiment pages) and commit what it writes"


@pytest.fixture(scope="module")
def written() -> dict[str, str]:
    return make_pages(DOCS)


def test_the_pages_are_those_that_make_results_writes(written: dict[str, str]) -> None:
    differ = [path for path, text in written.items() if (DOCS / path).read_text(encoding="utf-8") != text]
    assert differ == [], RENEW


def test_the_front_page_has_the_figures_of_the_stored_results() -> None:
    ((file, text),) = front_page(DOCS, stored_results(DOCS)).items()
    assert text == file.read_text(encoding="utf-8"), RENEW
    headlines = [line for line in text.partition(BEGIN)[2].splitlines() if line.startswith("- ")]
    assert len(headlines) >= 4


def test_a_front_page_without_room_for_headlines_stays_as_it_is(tmp_path: Path) -> None:
    (tmp_path / "README.md").write_text("by hand")
    assert front_page(tmp_path / "docs", {}) == {}


def test_every_page_asks_for_the_age_of_all_its_tables(written: dict[str, str]) -> None:
    for name, result in stored_results(DOCS).items():
        text = written[f"results/{name}.md"]
        assert text.count(ASK) == len(result.parts)
        assert answer(text, "another").count(OLDER) == len(result.parts)


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


def test_ages_compare_every_part_with_the_present_sources() -> None:
    found = ages(DOCS, "none of these")
    assert len(found) == sum(len(result.parts) for result in stored_results(DOCS).values())
    assert not any(age.is_current for age in found)
    one = next(age for age in found if len(age.version) == 16)  # a hash of sources, not a commit
    assert next(age for age in ages(DOCS, one.version) if age.version == one.version).is_current


def test_a_command_lists_the_ages(capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit) as ended:
        main(["experiment", "age", "--docs", str(DOCS), "--json"])
    assert not ended.value.code
    assert [entry["name"] for entry in json.loads(capsys.readouterr().out)] == [age.name for age in ages(DOCS, "")]


def test_the_sites_overview_says_so_of_every_figure() -> None:
    text = (DOCS / "results.md").read_text(encoding="utf-8")
    table = [line for line in text.splitlines() if line.startswith("|")][2:]
    told = [line for line in answer_overview(text, "another").splitlines() if line.endswith(" |")]
    assert len([line for line in told if "| older: " in line]) == len(table) > 40
