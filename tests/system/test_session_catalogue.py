"""The catalogue of sessions: read back by another program, with damaged and foreign folders among them."""

from __future__ import annotations

import csv
import json
import shutil
from pathlib import Path

import pytest
from pyarrow import compute, parquet
from typer.testing import CliRunner, Result

from drivers.core.errors import ConfigurationError
from drivers.core.installed import extras
from tactile_lab.cli.app import app
from tactile_lab.workflow.cataloguing import UNITS, check_table


def tactile_lab(*words: object) -> Result:
    return CliRunner().invoke(app, [str(word) for word in words], catch_exceptions=False)


def test_sessions_become_a_table_with_units_that_can_be_asked(recorded: Path, tmp_path: Path) -> None:
    root, table = tmp_path / "lab", tmp_path / "catalogue.parquet"
    for name in ("one", "two", "damaged", "torn", "unevaluated"):
        shutil.copytree(recorded, root / name)
    (root / "damaged" / "session.yaml").write_text("name: [")
    (root / "two" / "results" / "evaluation.json").write_text('{"failed": "perhaps", "shape": 3, "contacts": 7}')
    (root / "torn" / "results" / "evaluation.json").write_text("[" * 50_000)
    shutil.rmtree(root / "unevaluated" / "results")
    (root / "no-session").mkdir()
    answer = tactile_lab("session", "catalogue", root, "--out", table)
    assert answer.exit_code == 3, answer.output
    assert "damaged" in answer.stderr
    found = parquet.read_table(table)
    assert found.column_names == list(UNITS)
    assert found.schema.field("pose_rmse_mm").metadata == {b"unit": b"mm"}
    lines = {Path(line["folder"]).name: line for line in found.to_pylist()}
    assert set(lines) == {"one", "two", "damaged", "torn", "unevaluated"}
    told = json.loads((recorded / "results" / "evaluation.json").read_text())
    assert lines["one"]["hausdorff_best_fit_mm"] == told["shape_best_fit"]["hausdorff_mm"]
    assert (lines["one"]["method"], lines["one"]["rig"], lines["one"]["fingertips"]) == ("joint", "sim", "nano17")
    assert lines["one"]["duration_s"] >= 0
    assert (lines["two"]["contacts"], lines["two"]["failed"], lines["two"]["hausdorff_mm"]) == (7, None, None)
    assert (lines["damaged"]["status"], lines["unevaluated"]["failed"]) == ("damaged", None)
    assert found.filter(compute.field("status") == "damaged").num_rows == 2
    assert "evaluation.json: is not readable JSON" in lines["torn"]["problem"]
    assert "evaluation.json: is not readable JSON" in answer.stderr


def test_a_catalogue_as_csv_and_json_and_on_the_screen(recorded: Path, tmp_path: Path) -> None:
    table = tmp_path / "catalogue.csv"
    answer = tactile_lab("session", "catalogue", recorded.parent, "--out", table, "--json")
    assert answer.exit_code == 0, answer.output
    with table.open(newline="") as file:
        rows = list(csv.DictReader(file))
    listed = json.loads(answer.stdout)
    assert [row["session"] for row in rows] == [line["session"] for line in listed]
    assert rows[0]["grasps"] == str(listed[0]["grasps"])
    assert recorded.name in tactile_lab("session", "catalogue", recorded.parent).stdout
    elsewhere = tactile_lab("session", "catalogue", recorded.parent, "--out", "memory://tables/all.csv")
    assert elsewhere.stdout.endswith(": memory://tables/all.csv\n")


def test_what_cannot_be_made_is_said_before_anything_is_read(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    with pytest.raises(ConfigurationError, match=r"a\.txt: is no table\. Name a \.parquet or \.csv file"):
        check_table(tmp_path / "a.txt")
    with pytest.raises(ConfigurationError, match="there is no such folder"):
        tactile_lab("session", "catalogue", tmp_path / "nowhere")
    monkeypatch.setattr(extras, "find_spec", lambda name: None)
    with pytest.raises(ConfigurationError, match=r"pyarrow of the extra \[export\] is not installed"):
        check_table(tmp_path / "a.parquet")
