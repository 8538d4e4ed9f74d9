"""What can be asked of the catalogue of experiments."""

from __future__ import annotations

from pathlib import Path

import pytest

from drivers.core.errors import ConfigurationError
from tactile_lab.experiments.catalogue import experiment
from tactile_lab.experiments.experiment import REPORTED_SEEDS
from tactile_lab.experiments.studies.planar import METHODS


def test_all_methods_see_the_same_number_of_runs_with_the_reported_seeds() -> None:
    cells = experiment("methods-2d").cells()
    assert len(cells) == 3 * 8 * len(METHODS) * 30
    assert {cell.seed for cell in cells} == set(REPORTED_SEEDS) == set(range(1000, 1030))
    assert {cell["grasps"] for cell in cells} == {16}


def test_scanned_solids_are_left_out_with_the_reason_where_they_are_absent(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path, lab_data: Path
) -> None:
    study = experiment("methods-3d")
    monkeypatch.setenv("TACTILE_LAB_DATA", str(tmp_path))
    assert "ycb_cracker_box.ply" in study.left_out()
    without = study.cells([0])
    monkeypatch.setenv("TACTILE_LAB_DATA", str(lab_data))
    assert study.left_out() == ""
    assert len(study.cells([0])) == len(without) + 4 * len(METHODS)


def test_unknown_names_are_refused_with_those_there_are() -> None:
    with pytest.raises(ConfigurationError, match=r"figure-9\.9") as caught:
        experiment("figure-9.9")
    assert "methods-2d" in str(caught.value.hint)
    with pytest.raises(ConfigurationError, match="colour"):
        experiment("methods-2d").cells(only={"colour": ["red"]})
    with pytest.raises(ConfigurationError, match="octagon"):
        experiment("methods-2d").cells(only={"shape": ["octagon"]})


def test_values_with_commas_are_offered_as_the_option_takes_them() -> None:
    study = experiment("thesis-readings")
    with pytest.raises(ConfigurationError) as caught:
        study.cells(only={"part": ["gate", "thin plate kernel"]})
    assert "gate, thin plate kernel; " in str(caught.value.hint)
    assert "end them by ;" in str(caught.value.hint)
