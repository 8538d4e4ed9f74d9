"""What is said about an object before the hand moves."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import pytest
import trimesh

from drivers.camera.aruco import ObjectTracker
from drivers.core.errors import ConfigurationError
from drivers.simulation.settings import ObjectStart
from sessions.recording.recorder import NullRecorder
from tactile_lab.rigs.description import Rig, load_rig
from tactile_lab.rigs.laboratory import open_laboratory
from tactile_lab.workflow.object_check import check_fits, marker_problem


def mesh(folder: Path, size_m: tuple[float, float, float]) -> str:
    trimesh.creation.box(size_m).export(folder / "box.ply")
    return f"mesh:{folder / 'box.ply'}"


def low_rig() -> Rig:
    """An arm that travels 120 mm above the table."""
    rig = load_rig("sim")
    conductor = rig.description.conductor
    low = conductor.model_copy(update={"probing": conductor.probing.model_copy(update={"highest_m": 0.12})})
    return replace(rig, description=rig.description.model_copy(update={"conductor": low}))


def test_what_is_taller_than_the_arm_clears_is_refused_with_both_heights(tmp_path: Path) -> None:
    carton = mesh(tmp_path, (0.05, 0.08, 0.15))
    with pytest.raises(ConfigurationError, match=r"stands 150 mm high, and the hand travels no higher than 120 mm"):
        check_fits(low_rig(), carton)
    check_fits(low_rig(), f"{carton}@lying")
    check_fits(load_rig("sim"), carton)


def test_what_is_lower_than_fingertips_feel_is_refused_with_both_heights(tmp_path: Path) -> None:
    card = mesh(tmp_path, (0.06, 0.06, 0.004))
    with pytest.raises(ConfigurationError, match=r"only 4 mm high as it lies, .* lower than 12 mm"):
        check_fits(load_rig("sim"), card)


def problem_at(x_m: float) -> str:
    rig = load_rig("sim")
    start = ObjectStart(x_m=x_m, y_m=0.0, yaw_rad=0.0)
    simulation = rig.description.simulation.model_copy(update={"start": start})
    rig = replace(rig, description=rig.description.model_copy(update={"simulation": simulation}))
    with open_laboratory(rig, 0, "cube-6") as laboratory:
        runtime = laboratory.runtime(NullRecorder())
        runtime.connect()
        try:
            return marker_problem(runtime, laboratory.rig, laboratory.markers)
        finally:
            runtime.close()


def test_a_marker_outside_the_picture_is_told_before_the_session() -> None:
    assert problem_at(0.0) == ""
    assert "marker 7 is not visible" in (said := problem_at(0.4))
    assert "side of 35 mm" in said


def test_a_marker_that_is_seen_now_and_then_is_told_as_such(monkeypatch: pytest.MonkeyPatch) -> None:
    problem = "its marker 7 is not visible"
    answers = iter([problem, "", problem, "", problem])
    monkeypatch.setattr(ObjectTracker, "observe", lambda tracker, frame: SimpleNamespace(problem=next(answers)))
    assert f"locates the object in 2 of 5 pictures: {problem} in the others" in problem_at(0.0)
