"""``tactile-lab model export``, of a session out of the simulated rig."""

from __future__ import annotations

import json

import mujoco
import pytest


def test_a_session_becomes_a_body_that_mujoco_loads(inside, recorded, tmp_path):
    answer = inside("model", "export", recorded, "--out", tmp_path / "box", "--mass-kg", 0.3, "--json")
    assert answer.code == 0, answer.err
    told = json.loads(answer.out)
    assert {file.rpartition(".")[2] for file in told["files"]} == {
        "glb", "json", "obj", "sdf", "stl", "urdf", "usda", "xml",
    }  # fmt: skip
    assert "guess between contacts" in answer.err  # two grasps touch little
    physics = mujoco.MjModel.from_xml_path(str(tmp_path / "box" / "box-10x6x4.xml"))
    assert physics.body("box-10x6x4").mass[0] == pytest.approx(0.3)


def test_only_the_formats_asked_for_and_never_over_a_folder(inside, recorded, tmp_path):
    words = ("model", "export", recorded, "--out", tmp_path / "box", "--format", "stl", "--name", "A box")
    assert inside(*words).code == 0
    assert {file.name for file in (tmp_path / "box").iterdir()} == {"surface.stl", "model.json"}
    again = inside(*words)
    assert again.code == 2
    assert "exists already" in again.err


def test_an_unknown_format_is_refused_with_those_there_are(inside, recorded, tmp_path):
    answer = inside("model", "export", recorded, "--out", tmp_path / "box", "--format", "stl,step")
    assert answer.code == 2
    assert "'step'" in answer.err
    assert "urdf" in answer.err
    assert list(tmp_path.iterdir()) == []


def test_a_session_without_a_shape_says_so(inside, session_copy, tmp_path):
    (session_copy / "results" / "mesh.ply").unlink()
    answer = inside("model", "export", session_copy, "--out", tmp_path / "box")
    assert answer.code == 2
    assert "there is no estimated surface" in answer.err
    assert "touch the object more often" in answer.err
    (session_copy / "results" / "trajectory.csv").unlink()  # as of a session that was interrupted
    answer = inside("model", "export", session_copy, "--out", tmp_path / "box")
    assert "Replay the session" in answer.err
    assert not (tmp_path / "box").exists()
