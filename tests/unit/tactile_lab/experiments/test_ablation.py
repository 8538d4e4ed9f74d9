"""Mechanisms can be left out one at a time, and the page says what each is worth."""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path
from typing import get_args

import numpy as np
import pytest

from drivers.core.contacts import Grasp
from tactile_lab.benchmarks.import_closure import ALL, JOINT, ROOT, closure
from tactile_lab.evaluation.spread import Interval
from tactile_lab.experiments.ablation_page import ablation_page, with_worth
from tactile_lab.experiments.cells import Cell, Row
from tactile_lab.experiments.data.left_in_place import simulate_thing
from tactile_lab.experiments.data.planar_data import simulate
from tactile_lab.experiments.figure_texts import paired
from tactile_lab.experiments.groups import LEFT_OUT, NOTHING, Column, group_runs
from tactile_lab.experiments.runs.ablation_runs import (
    LEFT,
    PLANE,
    SPACE,
    THINGS,
    WITHOUT,
    WRONG,
    settings,
    track_without,
)
from tactile_lab.experiments.touched_metrics import touched_figures
from tactile_lab.slam.shape.fields.settings import GpisSettings, ShapePart
from tactile_lab.slam.slam_settings import SlamSettings
from tactile_lab.slam.tactile_slam import TactileSlam
from tactile_lab.slam.tracking.contacts.contact_map import ContactMap, PlacedGrasp
from tactile_lab.slam.tracking.contacts.contact_set import ContactSet
from tactile_lab.slam.tracking.contacts.motion import UNHELD, MotionNoise
from tactile_lab.slam.tracking.joint.joint_tracker import JointTracker
from tactile_lab.slam.tracking.joint.mechanisms import Mechanism, Mechanisms

MAP = Path(ROOT / "docs/estimator.md")


def left_out(name: str, *, seed: int = 5, shape: str = "ellipse") -> Cell:
    return Cell((("condition", PLANE), ("shape", shape), ("grasps", 3), (LEFT_OUT, name)), seed)


def test_every_mechanism_has_a_run_without_it() -> None:
    names = {*get_args(Mechanism), *get_args(ShapePart)}
    assert names <= WITHOUT.keys()
    given = [SlamSettings.model_validate(overlay) for overlay in WITHOUT.values()]
    assert given[0] == SlamSettings()
    assert len({str(each) for each in given}) == len(WITHOUT)


def test_a_mechanism_that_is_left_out_gives_back_what_it_is_given() -> None:
    on, off = Mechanisms(), Mechanisms(frozenset({"splicing", "doubts"}))
    assert on.improve("doubts", 1.0, lambda given: given + 1) == 2.0
    assert off.improve("doubts", 1.0, lambda given: given + 1) == 1.0
    assert (on.add("splicing", lambda: [3]), off.add("splicing", lambda: [3])) == ([3], [])
    assert (on.changed, off.changed) == ({"doubts", "splicing"}, set())


def test_a_mechanism_that_proposes_nothing_changes_nothing() -> None:
    on, given = Mechanisms(), object()
    assert on.improve("regular faces", given, lambda same: same) is given
    assert on.add("relocation", list) == []
    assert not on.changed


@pytest.mark.parametrize("name", [pytest.param("relocation", marks=pytest.mark.long), "placing on the object"])
def test_a_run_without_a_mechanism_that_says_it_did_nothing_is_the_same(name: str) -> None:
    """With a seed that is run again all the same."""
    full = track_without(left_out(NOTHING))
    assert name not in full["changed"]
    found = track_without(left_out(name))
    assert (found["rerun"], found["same"]) == (True, True)
    assert not track_without(left_out(name, seed=6))["rerun"]


def test_a_run_without_faces_rounds_the_corners() -> None:
    full, round_one = (track_without(left_out(name, shape="rectangle", seed=1)) for name in (NOTHING, "faces"))
    assert not round_one["same"]
    assert round_one["registration_mm"] != full["registration_mm"]


def test_a_thing_is_judged_where_it_was_touched() -> None:
    cell = Cell((("condition", THINGS), ("shape", "wedge"), ("grasps", 2), (LEFT_OUT, NOTHING)), 7)
    figures, data = track_without(cell), simulate_thing("wedge", 7, count=2)
    slam = TactileSlam(SlamSettings(dimension=3, motion=MotionNoise(unheld=UNHELD)), 7)
    for grasp in data.grasps:
        slam.add_grasp(grasp)
    found = touched_figures(data, slam.finish())
    assert figures["hausdorff_mm"] == pytest.approx(found["touched_hausdorff_mm"])
    assert figures["within_2_sigma"] == pytest.approx(found["touched_within_2_sigma"])


def first_map(grasp: Grasp) -> ContactMap:
    contacts = ContactSet.of_grasp(grasp, 2, 0.0)
    return ContactMap((PlacedGrasp(contacts, np.zeros(3), 1e-10 * np.eye(3), np.zeros(3)),), GpisSettings())


def test_free_space_can_be_left_out_of_everything() -> None:
    grasp = simulate("ellipse", 1, count=1).grasps[0]
    elsewhere = replace(grasp, approach_paths=())
    given = SlamSettings.model_validate(WITHOUT["free space"])
    for each, same in ((given, True), (SlamSettings(), False)):
        trackers = [JointTracker(first_map(one), each.motion, each.joint, 4) for one in (grasp, elsewhere)]
        costs = [tracker.hypotheses[0].intrusion for tracker in trackers]
        assert (costs[0] == costs[1]) == same


def row(name: str, shape: str, hausdorff_mm: float | None, *, condition: str = PLANE, same: bool = False) -> Row:
    figures = {
        "hausdorff_mm": hausdorff_mm,
        "registration_mm": 1.0,
        "within_2_sigma": 1.0,
        "failed": 0.0,
        "step_ms": [10.0, 20.0],
        "finish_ms": 500.0 if name == NOTHING else 250.0,
        "same": same,
        "rerun": True,
    }
    return Row(Cell((("condition", condition), ("shape", shape), ("grasps", 4), (LEFT_OUT, name)), 1), figures)


def table_of(*losses: float | None, condition: str = PLANE) -> list[Row]:
    """Runs with all mechanisms, 1 mm off, and the same without splicing."""
    shapes = [f"shape {number}" for number in range(len(losses))]
    return [row(NOTHING, shape, 1.0, condition=condition) for shape in shapes] + [
        row("splicing", shape, None if loss is None else 1.0 + loss, condition=condition)
        for shape, loss in zip(shapes, losses, strict=True)
    ]


def test_differences_are_taken_between_runs_of_the_same_grasps() -> None:
    groups = group_runs(table_of(1.0, 2.0, 2.0, 2.0, 3.0), over=("shape",))
    found = paired(groups[1], Column("", "hausdorff_mm", kind="paired"), groups)
    assert found is not None
    assert found.mean == pytest.approx(2.0)
    assert found.excludes_zero()
    assert paired(groups[0], Column("", "hausdorff_mm", kind="paired"), groups) is None


def test_a_run_without_a_shape_counts_as_the_largest_error() -> None:
    groups = group_runs(table_of(None, None, None, None, None), over=("shape",))
    found = paired(groups[1], Column("", "hausdorff_mm", kind="paired", most=20.0), groups)
    assert found == Interval(19.0, 19.0, 19.0)


def test_the_bootstrap_holds_zero_where_one_run_of_many_differs() -> None:
    found = Interval.resampled([0.0] * 9 + [5.0])
    assert found.mean == pytest.approx(0.5)
    assert found.low == 0.0
    assert not found.excludes_zero()
    assert Interval.resampled([2.0, 4.0]) == Interval(3.0, None, None)


def test_the_page_marks_what_is_clear() -> None:
    page = ablation_page(table_of(1.0, 2.0, 2.0, 2.0, 3.0), "abc")
    (line,) = [line for line in page.splitlines() if line.startswith("| splicing")]
    assert "**2.00 [" in line
    assert "100 %" in line
    assert "50 %" in line
    assert "`abc`" in page
    assert "(60 in\nthe long session)" in page


def test_the_map_of_the_estimator_is_given_its_column() -> None:
    text = "| mechanism | worth |\n| --- | --- |\n| splicing | does | – |\n| other | does | – |"
    filled = with_worth(text, [*table_of(1.0, 2.0, 2.0, 2.0, 3.0), row(NOTHING, "a", 1.0, condition=WRONG)])
    assert "| splicing | does | **+2.00** / – / – |" in filled
    assert filled.endswith("| other | does | – |")


def test_a_mechanism_that_the_usual_conditions_do_not_exercise_is_told_with_its_own() -> None:
    rows = table_of(0.5, 0.5, 0.5, 0.5, 0.5, condition=LEFT)
    filled = with_worth("| splicing | does | – |", rows)
    assert filled == "| splicing | does | **+0.50** left in place |"


def test_the_map_of_the_estimator_names_every_mechanism_and_files_that_are_there() -> None:
    text = MAP.read_text(encoding="utf-8")
    for name in set(WITHOUT) - {NOTHING}:
        assert f"\n| {name} | " in text
    folder, previous = ROOT / "tactile_lab/slam", ROOT
    for path in re.findall(r"`([\w/]+\.py)`", text):
        previous = folder / path if "/" in path or (folder / path).exists() else previous.parent / path
        assert previous.is_file(), path


def test_the_map_of_the_estimator_states_what_the_method_rests_on() -> None:
    text = MAP.read_text(encoding="utf-8")
    stated = re.findall(r"now \| (\d+) files, (\d+) lines \| (\d+) files, (\d+) lines", text)
    found = closure(JOINT), closure(ALL)
    (numbers,) = [[int(each) for each in group] for group in stated]
    for (files, lines), each in zip((numbers[:2], numbers[2:]), found, strict=True):
        assert len(each.files) == pytest.approx(files, abs=3)
        assert each.lines == pytest.approx(lines, rel=0.05)


def test_imports_are_followed_inside_of_a_package_only(tmp_path: Path) -> None:
    texts = {
        "a/__init__.py": "",
        "a/one.py": "import os\nfrom a import two\n",
        "a/two.py": "def late():\n    from a.three import x\n",
        "a/three.py": "from b.far import y\nx = 1\n",
        "b/far.py": "y = 1\n",
    }
    for name, text in texts.items():
        (tmp_path / name).parent.mkdir(exist_ok=True)
        (tmp_path / name).write_text(text)
    found = closure(["a.one"], "a", tmp_path)
    assert [file.name for file in found.files] == ["one.py", "three.py", "two.py"]
    assert found.lines == 6
    with pytest.raises(ModuleNotFoundError, match="four"):
        closure(["a.four"], "a", tmp_path)


def test_spatial_parts_are_left_out_in_space() -> None:
    found = {dict(setting)["condition"] for setting in settings(0) if dict(setting)[LEFT_OUT] == "prism"}
    assert found == {SPACE, THINGS}
