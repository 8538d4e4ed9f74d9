"""``tactile-lab experiment``: results, resumption, words for people and errors of use."""

from __future__ import annotations

import json
import shutil
import sys
from pathlib import Path

import pytest
from typer.testing import CliRunner

from drivers.core.errors import ConfigurationError, SessionError
from tactile_lab.cli.app import app
from tactile_lab.experiments.execution.source_version import version

DOCS = Path(__file__).parents[2] / "docs"
TINY = ["--seeds", "0-1", "--jobs", "1", "--only", "solver=Cauchy;ours"]


def invoke(*words):
    return CliRunner().invoke(app, ["experiment", *map(str, words)])


def test_the_list_has_a_sentence_for_every_experiment():
    answer = invoke("list", "--json")
    found = json.loads(answer.stdout)
    assert {"figure-2.7", "figure-3.16", "methods-2d", "graph-stress"} <= {entry["name"] for entry in found}
    assert all(entry["sentence"].endswith(".") for entry in found)
    assert "methods-3d" in invoke("list").output


def test_an_experiment_writes_its_results_and_goes_on_where_it_stopped(tmp_path):
    first = invoke("graph-stress", "--out", tmp_path / "x", *TINY, "--json")
    assert first.exit_code == 0
    outcome = json.loads(first.stdout)
    assert outcome["seeds"] == [0, 1]
    assert len(outcome["runs"]) == 4
    assert {path.name for path in (tmp_path / "x").iterdir()} == {
        "runs.jsonl",
        "results.json",
        "results.md",
        "plot.svg",
    }
    again = json.loads(invoke("graph-stress", "--out", tmp_path / "x", *TINY, "--json").stdout)
    assert again["runs"] == outcome["runs"]


def test_one_command_stores_an_outcome_and_writes_its_page(tmp_path):
    docs = tmp_path / "docs"
    shutil.copytree(DOCS / "results", docs / "results")
    answer = invoke("graph-stress", "--out", tmp_path / "x", *TINY, "--store", "--docs", docs)
    assert answer.exit_code == 0
    page = (docs / "results" / "graph-stress.md").read_text()
    fresh, older = page.split("## Made earlier")
    assert f"by sources {version()}" in fresh
    assert "| ours | 2 |" in fresh
    assert "tactile-lab experiment graph-stress --seeds 0-1 --only 'solver=Cauchy;ours' --jobs 1" in fresh
    assert version() not in older
    assert "| ours |" not in older
    assert "| GNC |" in older
    assert (docs / "pictures" / "graph-stress.svg").is_file()
    assert "experiment graph-stress --seeds 0-1" in invoke("commands", "--docs", docs).stdout
    forgetful = invoke("graph-stress", "--out", tmp_path / "x", *TINY, "--store", "--forget", "--docs", docs)
    assert "solver GNC" in str(forgetful.exception)  # which the claims show


@pytest.mark.parametrize("option", ["--out", "--merge"])
def test_a_damaged_file_of_results_is_told_before_the_studies_are_loaded(tmp_path, monkeypatch, option):
    (tmp_path / "runs.jsonl").write_text("hello\n")
    monkeypatch.setitem(sys.modules, "tactile_lab.experiments.catalogue", None)  # whoever loads it now fails
    answer = invoke("graph-stress", option, tmp_path, *TINY)
    assert isinstance(answer.exception, ConfigurationError)
    assert "not a results file" in str(answer.exception)


def test_nothing_is_stored_that_several_versions_made_or_beside_no_repository(tmp_path):
    answer = invoke("graph-stress", "--out", tmp_path, *TINY, "--store", "--keep")
    assert answer.exit_code == 2
    assert "--keep" in answer.output
    lost = invoke("graph-stress", "--out", tmp_path / "x", *TINY, "--store", "--docs", tmp_path)
    assert isinstance(lost.exception, SessionError)
    assert "no stored results" in str(lost.exception)


@pytest.mark.parametrize(
    ("words", "told"),
    [
        (["graph-stress", "--seeds", "1-x"], "--seeds"),
        (["graph-stress", "--seeds", "5-2"], "--seeds"),
        (["graph-stress", "--only", "solver"], "--only"),
        (["graph-stress", "--jobs", "-1"], "--jobs"),
        ([], "Missing argument"),
    ],
)
def test_a_usage_error_names_the_option(words, told, tmp_path):
    answer = invoke(*words)
    assert answer.exit_code == 2
    assert told in answer.output


def test_an_unknown_experiment_is_an_error_of_ours(tmp_path):
    assert isinstance(invoke("figure-9", "--out", tmp_path).exception, ConfigurationError)


@pytest.mark.long
def test_a_sweep_stores_its_table_and_writes_its_page(tmp_path):
    docs = tmp_path / "docs"
    shutil.copytree(DOCS / "results", docs / "results")
    few = ("--objects", "box-10x6x4", "--seeds", "1", "--dimensions", "2", "--grasps", "1", "--jobs", "1")
    words = ["sweep", *few, "--out", str(tmp_path / "sweep"), "--store", "--docs", str(docs)]
    answer = CliRunner().invoke(app, words)
    assert answer.exit_code == 0
    fresh, older = (docs / "results" / "rig-contour.md").read_text().split("## Made earlier")
    assert "| box-10x6x4 | 2 | 1 |" in fresh
    assert "| box-10x6x4 |" not in older
    assert "| cube-6 |" in older


def test_tables_of_two_dimensions_together_are_not_stored(tmp_path):
    answer = CliRunner().invoke(app, ["sweep", "--out", str(tmp_path / "sweep"), "--store"])
    assert answer.exit_code == 2
    assert "--store" in answer.output
