"""Files for people who work on the program or cite it: they agree with each other and with what they name."""

from __future__ import annotations

import re
import tomllib
from datetime import date
from pathlib import Path
from typing import Any

import pytest
import yaml

from tests.support.text_files import check, complaint, main, mended

REPOSITORY = Path(__file__).resolve().parents[2]


def read(name: str) -> str:
    return (REPOSITORY / name).read_text(encoding="utf-8")


def project() -> dict[str, Any]:
    content: dict[str, Any] = tomllib.loads(read("pyproject.toml"))["project"]
    return content


def releases() -> list[tuple[str, str]]:
    """Version and date of every release in the changelog, newest first."""
    return re.findall(r"^## \[(\d+\.\d+\.\d+)\] - (\d{4}-\d\d-\d\d)$", read("CHANGELOG.md"), re.M)


# --- versions ------------------------------------------------------------------------------------------------------


def test_versions_agree() -> None:
    citation = yaml.safe_load(read("CITATION.cff"))
    assert (citation["version"], str(citation["date-released"])) == releases()[0]
    assert project()["version"] == releases()[0][0]


def test_the_changelog_is_in_order() -> None:
    headings = re.findall(r"^## (.+)$", read("CHANGELOG.md"), re.M)
    assert headings[0] == "[Unreleased]"
    assert len(headings) == len(releases()) + 1  # each other heading is a version with its date
    versions = [tuple(map(int, version.split("."))) for version, _ in releases()]
    dates = [date.fromisoformat(day) for _, day in releases()]
    assert versions == sorted(set(versions), reverse=True)
    assert dates == sorted(dates, reverse=True)


# --- citation ------------------------------------------------------------------------------------------------------


def test_the_citation_file_has_what_its_form_requires() -> None:
    citation = yaml.safe_load(read("CITATION.cff"))
    assert {"cff-version", "message", "title", "authors"} <= set(citation)
    assert (citation["cff-version"], citation["type"]) == ("1.2.0", "software")
    assert citation["license"] == project()["license"]
    for each in citation["references"]:
        assert {"type", "title", "authors"} <= set(each)


def test_the_citation_file_and_the_page_name_the_same_thesis() -> None:
    (thesis,) = (each for each in yaml.safe_load(read("CITATION.cff"))["references"] if each["type"] == "thesis")
    assert thesis["title"] in " ".join(read("docs/thesis.md").split())


# --- checks --------------------------------------------------------------------------------------------------------


def test_continuous_integration_runs_the_readmes_command_on_every_python() -> None:
    workflow = yaml.safe_load(read(".github/workflows/ci.yml"))
    (job,) = workflow["jobs"].values()
    assert [step["run"] for step in job["steps"] if "run" in step] == ["make test"]
    assert re.search(r"^make test\b", read("README.md"), re.M)
    oldest = project()["requires-python"].removeprefix(">=")
    assert job["strategy"]["matrix"]["python"] == [oldest, "3.12", "3.13"]


def test_hooks_need_nothing_but_the_projects_environment() -> None:
    configuration = yaml.safe_load(read(".pre-commit-config.yaml"))
    assert [each["repo"] for each in configuration["repos"]] == ["local"]
    needed = " ".join(project()["optional-dependencies"]["dev"])
    tools = {"ruff": "ruff", "mypy": "mypy", "lint-imports": "import-linter", "python": ""}
    for hook in configuration["repos"][0]["hooks"]:
        program, *arguments = hook["entry"].split()
        assert hook["language"] == "system"
        assert tools[program.removeprefix(".venv/bin/")] in needed
        if arguments[:1] == ["-m"]:
            assert (REPOSITORY / f"{arguments[1].replace('.', '/')}.py").is_file()


def test_commands_of_the_guide_for_contributors_exist() -> None:
    guide = read("CONTRIBUTING.md")
    for path, test in re.findall(r"pytest (tests/[\w/.]+\.py)(?:::(\w+))?", guide):
        assert f"def {test}(" in read(path) if test else (REPOSITORY / path).is_file()
    targets = set(re.findall(r"^(\w+):", read("Makefile"), re.M))
    assert set(re.findall(r"`?make (\w+)`?", guide)) <= targets


# --- documents -----------------------------------------------------------------------------------------------------

DOCUMENTS = sorted(path for pattern in ("*.md", "docs/**/*.md") for path in REPOSITORY.glob(pattern))


def anchor(heading: str) -> str:
    """The anchor that a heading gets where Markdown is shown."""
    return re.sub(r"[^\w\- ]", "", heading.lower()).strip().replace(" ", "-")


@pytest.mark.parametrize("page", DOCUMENTS, ids=lambda page: page.relative_to(REPOSITORY).as_posix())
def test_links_of_documents_lead_somewhere(page: Path) -> None:
    for target in re.findall(r"\]\((?!https?:)([^)\s]+)\)", page.read_text(encoding="utf-8")):
        path, _, fragment = target.partition("#")
        linked = (page.parent / path).resolve() if path else page
        assert linked.exists(), target
        if fragment and linked.suffix == ".md":
            headings = re.findall(r"^#+ (.+)$", linked.read_text(encoding="utf-8"), re.M)
            assert fragment in map(anchor, headings), target


# --- text files ----------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("text", "wanted"),
    [("a \t\nb\r\n", "a\nb\n"), ("a\n\n\n", "a\n"), ("a", "a\n"), ("", ""), ("\n", ""), ("a\n\nb\n", "a\n\nb\n")],
)
def test_line_ends_are_mended(text: str, wanted: str) -> None:
    assert mended(text) == wanted
    assert mended(wanted) == wanted


@pytest.mark.parametrize(
    ("text", "suffix", "words"),
    [
        ("a\n<<<<<<< ours\n", ".py", "marks of a conflict"),
        ("Title\n=======\n", ".py", "marks of a conflict"),
        ("{", ".json", "does not parse"),
        ("a: [", ".yaml", "does not parse"),
        ("a = ", ".toml", "does not parse"),
        ("{", ".md", ""),
        ("a: 1\n", ".cff", ""),
    ],
)
def test_what_nobody_else_can_mend_is_told(text: str, suffix: str, words: str) -> None:
    assert complaint(text, suffix).startswith(words)
    assert bool(complaint(text, suffix)) == bool(words)


def test_files_are_mended_in_place_and_told(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    good, bad, foreign = (tmp_path / name for name in ("good.md", "bad.md", "foreign.md"))
    good.write_bytes(b"a\n")
    bad.write_bytes(b"a \r\n\n")
    foreign.write_bytes(b"\xff\n")
    assert main([str(good), str(bad), str(foreign)]) == 1
    told = capsys.readouterr().out
    assert "bad.md: mended" in told
    assert "foreign.md: is not UTF-8" in told
    assert "good" not in told
    assert (bad.read_bytes(), check(bad)) == (b"a\n", "")
