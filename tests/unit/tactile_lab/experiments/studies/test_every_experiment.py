"""Every experiment in a tiny configuration: it runs, is reported, and repeats itself."""

from __future__ import annotations

import xml.etree.ElementTree as ElementTree
from functools import cache
from pathlib import Path

import pytest

from tactile_lab.experiments.catalogue import EXPERIMENTS, experiment
from tactile_lab.experiments.cells import Row, execute
from tactile_lab.experiments.experiment import Experiment
from tactile_lab.experiments.reporting import write_report

TINY: dict[str, tuple[dict[str, list[str]], int | None]] = {
    "methods-2d": ({"shape": ["rectangle"], "noise": ["50"], "method": ["known-pose", "odometry", "joint"]}, 3),
    "felt-2d": ({"shape": ["rectangle"], "outliers": ["0"]}, 4),
    "contour-limit": ({"shape": ["L"], "noise": ["50"]}, 4),
    "methods-3d": ({"shape": ["l-block"], "method": ["known-pose", "odometry"]}, 4),
    "everyday-3d": ({"shape": ["wedge"], "method": ["known-pose"]}, 4),
    "everyday-2d": ({"shape": ["wedge"], "method": ["known-pose"]}, 4),
    "everyday-shape": ({"shape": ["wedge"], "without": ["nothing"]}, 2),
    "solid-limit": ({"shape": ["triangular-prism"]}, 3),
    "felt-3d": ({"shape": ["l-block"]}, 4),
    "felt-limit": ({"shape": ["triangular-prism"]}, 4),
    "known-shape": ({"shape": ["cylinder"]}, 3),
    "methods-6dof": ({"shape": ["ellipsoid"], "method": ["known-pose", "icp"]}, 4),
    "ablation": ({"shape": ["ellipse"], "condition": ["in the plane"], "without": ["nothing", "faces", "splicing"]}, 4),
    "consistency": ({"shape": ["wedge"], "dimension": ["2"], "wrong": ["0"]}, 3),
    "random-contacts": ({"shape": ["L"], "contacts": ["20"], "model": ["TP, normals", "chosen by evidence"]}, None),
    "figure-2.7": ({"shape": ["ellipse"], "contacts": ["5", "10"], "model": ["SE, normals"]}, None),
    "figure-2.12": ({"contacts": ["20"], "model": ["Matérn, normals"]}, None),
    "figure-3.12": ({"shape": ["ellipse"], "noise": ["0", "100"], "method": ["known-pose", "joint"]}, 4),
    "figure-3.14": ({"shape": ["ellipse"], "noise": ["25"], "particles": ["500", "1000"]}, 4),
    "figure-3.15": ({"shape": ["rectangle"], "constraints": ["0", "4"]}, 6),
    "figure-3.16": ({"shape": ["rectangle"], "noise": ["50"], "method": ["thesis-pf", "particle, no graph"]}, 3),
    "thesis-readings": ({"noise": ["25"], "shape": ["ellipse"], "part": ["likelihood"]}, 3),
    "figure-2.5": ({"contacts": ["10"]}, None),
    "figure-2.8": ({"shape": ["ellipse"], "model": ["prior zero", "prior sphere"]}, None),
    "figure-2.9": ({"model": ["SE kernel", "edge features"]}, None),
    "figure-2.11": ({"shape": ["cube-6"], "contacts": ["5"], "model": ["TP kernel"]}, None),
    "figure-2.14": ({"shape": ["ellipse"]}, None),
    "figure-2.15": ({"shape": ["sphere"], "model": ["TP kernel"]}, None),
    "figure-3.11": ({"shape": ["ellipse"], "after": ["1", "4"], "method": ["joint"]}, None),
    "figure-3.13": ({"shape": ["cylinder"], "after": ["1"]}, None),
    "figure-3.20": ({"object": ["box-10x6x4"], "method": ["thesis-pf"]}, 1),
    "figure-3.21": ({"object": ["cube-6"], "method": ["thesis-pf-graph"]}, 1),
    "figure-4.1": ({}, None),
    "figure-4.3": ({"after": ["1"]}, None),
    "figure-4.4": ({"policy": ["variance"], "after": ["1", "3"]}, None),
    "figure-4.6": ({}, None),
    "shape-models": ({"shape": ["rectangle"], "contacts": ["20"], "model": ["Nagata patches", "edge features"]}, None),
    "shape-models-3d": ({"shape": ["sphere"], "model": ["point cloud"]}, None),
    "table-4.2": ({"candidates": ["10"], "policy": ["information", "clairvoyant"]}, 12),
    "table-4.3": ({"tracking": ["joint"], "policy": ["det"]}, 5),
    "exploration-hand": ({"object": ["cube-6"], "dimension": ["2"], "policy": ["random"]}, 2),
    "exploration-kinematic": ({"object": ["cube-6"], "dimension": ["2"], "policy": ["random"]}, 2),
    "exploration-felt": ({"object": ["cube-6"], "dimension": ["2"], "policy": ["random"], "odometry": ["touch"]}, 2),
    "hands": ({"rig": ["sim-lite"]}, 1),
    "carries": ({"object": ["cube-6"], "mass_kg": ["0.3"]}, 2),
    "carried-3d": ({"object": ["cube-6"]}, 2),
    "weighing": ({"object": ["cube-6"], "mass_kg": ["0.3"]}, 1),
    "everyday-objects": ({"object": ["cube-6"], "dimension": ["2"]}, 1),
    "camera-truth": ({"condition": ["sharp"]}, None),
    "calibrate-forearm": ({"method": ["touch"], "poses": ["20"]}, None),
    "forearm-on-rig": ({"method": ["marker"], "poses": ["10"]}, None),
    "calibrate-fingertip": ({"presses": ["6"]}, None),
    "crash-recovery": ({"fault": ["kill -9"]}, None),
    "graph-stress": ({"solver": ["Cauchy", "ours"]}, None),
}

# Whole sessions on the simulated rig, and whole surfaces.
LENGTHY = (
    "ablation",
    "carries",
    "carried-3d",
    "weighing",
    "figure-3.12",
    "known-shape",
    "methods-3d",
    "methods-6dof",
    "crash-recovery",
    "everyday-2d",
    "everyday-3d",
    "everyday-objects",
    "exploration-hand",
    "felt-3d",
    "figure-3.20",
    "figure-3.21",
    "forearm-on-rig",
    "hands",
)


def marked(study: Experiment) -> object:
    """The experiment as a parameter of a test, of a long one if it takes seconds."""
    return pytest.param(study, id=study.name, marks=[pytest.mark.long] if study.name in LENGTHY else [])


@cache
def tiny_rows(name: str) -> list[Row]:
    """An experiment's tiny configuration with one seed, run once for all tests here."""
    study, (only, grasps) = EXPERIMENTS[name], TINY[name]
    return [execute(cell, study.work) for cell in study.cells([0], only, grasps)]


@pytest.mark.parametrize("study", [marked(study) for study in EXPERIMENTS.values()])
def test_every_experiment_runs_and_is_reported(study: Experiment, tmp_path: Path) -> None:
    rows = tiny_rows(study.name)
    assert 0 < len(rows) <= 6
    assert [row.problem for row in rows] == [""] * len(rows)
    for column in study.columns:
        assert any(column.key in (row.figures or {}) for row in rows)
    write_report(study, rows, tmp_path, jobs=1)
    ElementTree.fromstring((tmp_path / "plot.svg").read_text())
    assert (tmp_path / "results.md").read_text().count("| --- ") >= 1


@pytest.mark.long
def test_the_forearms_wizard_finds_a_displaced_mount_through_the_physics() -> None:
    (row,) = tiny_rows("forearm-on-rig")
    assert row.figures is not None
    assert row.figures["left_out"] == 0
    assert row.figures["error_mm"] < 1.0
    assert row.figures["errors_deg"][0] < 0.3
    assert row.figures["inside"] == 1.0
    assert 0.5 < row.figures["noise"] < 1.5


def test_the_same_cell_gives_the_same_figures() -> None:
    study = experiment("methods-2d")
    cell = study.cells([1], {"shape": ["ellipse"], "noise": ["100"], "outliers": ["10"], "method": ["particle"]}, 4)[0]
    first, second = execute(cell, study.work).figures, execute(cell, study.work).figures
    assert first is not None
    assert second is not None
    times = {"step_ms", "finish_ms"}
    assert {k: v for k, v in first.items() if k not in times} == {k: v for k, v in second.items() if k not in times}
