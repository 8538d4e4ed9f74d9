"""``tactile-lab experiment``: results, resumption, words for people and errors of use."""

from __future__ import annotations

import json

import pytest
from typer.testing import CliRunner

from tactile_lab.cli.app import app
from tactile_lab.errors import ConfigurationError

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


def test_the_section_of_a_document_is_replaced(tmp_path):
    page = tmp_path / "page.md"
    page.write_text("<!-- experiment graph-stress -->\n<!-- end graph-stress -->\n")
    answer = invoke("graph-stress", "--out", tmp_path / "x", *TINY, "--into", page)
    assert answer.exit_code == 0
    assert "| ours |" in page.read_text()
    assert "(pictures/graph-stress.svg)" in page.read_text()


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
