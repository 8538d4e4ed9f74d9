"""Several sessions and several methods judged beside one another, as a command."""

from __future__ import annotations

import csv
import json
import shutil
import xml.etree.ElementTree as ElementTree
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml
from scipy.stats import t as student

from calibration.store.store import read_record, write_record
from tactile_lab.evaluation.files.trajectory_file import COLUMNS
from tactile_lab.rigs.description import load_rig
from tests.system.conftest import call_inside

POSITION = ("pose", "rmse_mm")


@pytest.fixture(scope="module")
def laboratory(recorded: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with three sessions, results of two methods in each; only to be read.

    They are one recording; in the second and third the first method's last pose is off by another 4 and 9 mm.
    """
    root = tmp_path_factory.mktemp("laboratory")
    first = shutil.copytree(recorded, root / "first")
    replayed = call_inside("session", "replay", first, "--method", "odometry", "--into", first / "odometry")
    assert replayed.code in (0, 3), replayed.err
    for name, off_m in (("second", 0.004), ("third", 0.009)):
        move_last_pose(Path(shutil.copytree(first, root / name)), off_m)
    for folder in root.iterdir():
        manifest = yaml.safe_load((folder / "session.yaml").read_text())
        (folder / "session.yaml").write_text(yaml.safe_dump({**manifest, "name": folder.name}))
    return root


def move_last_pose(session: Path, off_m: float) -> None:
    path = session / "results" / "trajectory.csv"
    *lines, last = path.read_text().splitlines()
    cells, column = last.split(","), COLUMNS.index("world_T_object_03")
    cells[column] = repr(float(cells[column]) + off_m)
    path.write_text("\n".join([*lines, ",".join(cells)]) + "\n")


def contents(root: Path) -> dict[Path, bytes]:
    return {path: path.read_bytes() for path in root.rglob("*") if path.is_file()}


def test_methods_over_sessions_give_tables_rows_everything_and_a_plot(
    inside: Any, laboratory: Path, tmp_path: Path
) -> None:
    before, out = contents(laboratory), tmp_path / "comparison"
    words = ("--root", laboratory, "--results", "results", "--results", "odometry", "--out", out)
    answer = inside("evaluate", "first", "second", "third", *words, "--json")
    assert answer.code == 0, answer.err
    document = json.loads(answer.out)
    assert contents(laboratory) == before
    assert {path.name for path in out.iterdir()} == {f"comparison.{end}" for end in ("md", "csv", "json", "svg")}
    assert json.loads((out / "comparison.json").read_text()) == document
    with (out / "comparison.csv").open() as file:
        rows = list(csv.DictReader(file))
    assert [(row["session"], row["results"]) for row in rows] == [
        (session, results) for session in ("first", "second", "third") for results in ("results", "odometry")
    ]
    values = [evaluation["pose"]["rmse_mm"] for evaluation in document["evaluations"]]
    np.testing.assert_allclose([float(row["pose.rmse_mm"]) for row in rows], values, rtol=1e-5)
    intervals_are_students(document, np.array(values).reshape(3, 2))
    lines = (out / "comparison.md").read_text().splitlines()
    assert sum(line.startswith("| odometry, 2-D | position RMSE, mm | 3 |") for line in lines) == 1
    drawn = "".join(ElementTree.parse(out / "comparison.svg").getroot().itertext())
    assert all(words in drawn for words in ("joint, 2-D", "odometry, 2-D", "position RMSE"))


def intervals_are_students(document: dict[str, Any], values: np.ndarray) -> None:
    """The intervals of the position's error and of the difference between the methods, by the textbook."""
    joint, odometry = document["summaries"]
    assert (joint["method"], odometry["method"]) == ("joint, 2-D", "odometry, 2-D")
    for summary, key, sample in (
        (joint, "mean", values[:, 0]),
        (odometry, "mean", values[:, 1]),
        (odometry, "against_first", values[:, 1] - values[:, 0]),
    ):
        (figure,) = (each for each in summary["figures"] if each["title"] == "position RMSE, mm")
        half = student.ppf(0.975, 2) * sample.std(ddof=1) / np.sqrt(3)
        expected = [sample.mean(), sample.mean() - half, sample.mean() + half]
        found = [figure[key][name] for name in ("mean", "low", "high")]
        np.testing.assert_allclose(found, expected, rtol=1e-9, atol=1e-9)
    assert np.ptp(values[:, 0]) > 0.5


def test_all_results_of_one_session_are_compared_when_it_is_judged_elsewhere(
    inside: Any, laboratory: Path, tmp_path: Path
) -> None:
    answer = inside("evaluate", laboratory / "first", "--out", tmp_path / "out")
    assert answer.code == 0, answer.err
    assert "2 evaluations" in answer.out
    assert "joint, 2-D" in answer.out
    assert "odometry, 2-D" in answer.out
    assert "truth    first: from corners" in answer.err
    assert "clocks   first: camera to hand" in answer.err


@pytest.mark.parametrize(
    ("spoil", "told"),
    [
        (
            lambda lens: write_record(lens, read_record(lens).model_copy(update={"rig": "another"})),
            "belongs to rig another",
        ),
        (lambda lens: lens.write_text(lens.read_text().replace("focal_px: [", "focal_px: [1")), "changed"),
    ],
    ids=["another rig", "by hand"],
)
def test_a_lens_of_another_rig_or_changed_by_hand_gives_no_truth(
    inside: Any, laboratory: Path, tmp_path: Path, spoil: Any, told: str
) -> None:
    lens = Path(shutil.copy(load_rig("sim").files["camera"], tmp_path / "lens.yaml"))
    spoil(lens)
    answer = inside("evaluate", "first", "--root", laboratory, "--results", "results", "--lens", lens)
    assert (answer.code, told in answer.err) == (2, True), answer.err


@pytest.mark.parametrize(
    ("words", "told"),
    [
        (("first", "nowhere"), "no such session"),
        (("first", "first"), "first: is given twice"),
        (("first", "second", "--results", "magic"), "has no results called 'magic'"),
        (("first", "--lens", "nowhere.yaml"), "nowhere.yaml: cannot be read"),
        (("first", "--results", "results", "--out", "{file}"), "is not a folder). Choose another folder"),
    ],
)
def test_comparisons_that_can_not_be_made_are_refused(
    inside: Any, laboratory: Path, tmp_path: Path, words: tuple[str, ...], told: str
) -> None:
    file = tmp_path / "file"
    file.write_text("mine")
    answer = inside("evaluate", *(word.format(file=file) for word in words), "--root", laboratory)
    assert answer.code != 0
    assert told in answer.err, answer.err
    assert (answer.out, file.read_text()) == ("", "mine")
