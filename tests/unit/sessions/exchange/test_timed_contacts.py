"""Contacts that others recorded, as tables."""

from __future__ import annotations

import json
import math

import numpy as np
import pytest
import trimesh

from drivers.core.errors import ConfigurationError
from sessions.exchange.contact_log import read_contact_log
from sessions.exchange.timed_contacts import ImportSettings, read_timed_contacts
from sessions.exchange.timed_table import FORMAT
from tactile_lab.workflow.importing import import_contacts

PLANAR = """time_s,finger,x_m,y_m,nx,ny
0.00,FF,0.05,0.0,1,0
0.01,TH,-0.05,0.0,-1,0
2.00,FF,0.0,0.03,0,1
2.01,TH,0.0,-0.03,0,-1
"""


def table(tmp_path, text):
    path = tmp_path / "contacts.csv"
    path.write_text(text)
    return path


def test_a_planar_table_becomes_grasps_by_their_times(tmp_path):
    log = read_timed_contacts(table(tmp_path, PLANAR))
    assert log.dimension == 2
    assert [len(grasp.contacts) for grasp in log.grasps] == [2, 2]
    assert log.grasps[1].stamp_ns == 2_000_000_000
    assert log.grasps[0].contacts[1].normal_world.tolist() == [-1.0, 0.0, 0.0]
    assert (log.point_sigma_m, log.normal_sigma_rad) == (0.002, 0.1)


def test_forces_give_normals_and_how_hard(tmp_path):
    text = "time_s,x_m,y_m,z_m,fx_N,fy_N,fz_N\n0,0.05,0,0.02,3,0,4\n"
    (contact,) = read_timed_contacts(table(tmp_path, text)).grasps[0].contacts
    assert contact.normal_world.tolist() == [0.6, 0.0, 0.8]
    assert (contact.force_N, contact.normal_sigma_rad) == (5.0, 0.35)


def test_an_object_held_by_the_tool_moves_with_it(tmp_path):
    text = (
        "time_s,grasp,held,x_m,y_m,nx,ny,tool_x_m,tool_y_m,tool_yaw_rad,object_x_m,object_y_m,object_yaw_rad\n"
        "0,0,0,0.05,0,1,0,0,0,0,0,0,0\n"
        f"1,1,1,0,0.15,0,1,0,0.1,{math.pi / 2},0,0.1,{math.pi / 2}\n"
        f"2,2,0,0,0.15,0,1,0.3,0.1,0,0,0.1,{math.pi / 2}\n"
    )
    first, turned, let_go = read_timed_contacts(table(tmp_path, text)).grasps
    assert first.hand_motion_world.matrix().tolist() == np.eye(4).tolist()
    moved = turned.hand_motion_world.transformFrom(np.array([0.05, 0.0, 0.0]))
    assert moved == pytest.approx([0.0, 0.15, 0.0])
    assert let_go.hand_motion_world.matrix().tolist() == np.eye(4).tolist()
    assert read_timed_contacts(table(tmp_path, text)).true_poses[1].x() == pytest.approx(0.0)


def test_json_says_the_same_as_the_table(tmp_path):
    rows = [{"time_s": 0.0, "x_m": 0.05, "y_m": 0.0, "nx": 1.0, "ny": 0.0, "finger": "FF"}]
    document = {"format": FORMAT, "point_sigma_m": 0.004, "contacts": rows, "object": {"name": "box"}}
    path = tmp_path / "c.json"
    path.write_text(json.dumps(document))
    log = read_timed_contacts(path)
    assert (log.point_sigma_m, log.truth.name, len(log.grasps)) == (0.004, "box", 1)


def test_an_imported_log_is_read_back_as_it_was(tmp_path):
    log = import_contacts(table(tmp_path, PLANAR), tmp_path / "log.json", ImportSettings())
    again = read_contact_log(tmp_path / "log.json")
    assert [grasp.points_world_m.tolist() for grasp in again.grasps] == [
        grasp.points_world_m.tolist() for grasp in log.grasps
    ]
    with pytest.raises(ConfigurationError, match="exists already"):
        import_contacts(table(tmp_path, PLANAR), tmp_path / "log.json", ImportSettings())


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("time_s,x_mm,y_mm,nx,ny\n0,50,0,1,0\n", "column 'x_mm' is in another unit.*name it x_m"),
        ("time_ms,x_m,y_m,nx,ny\n0,0.05,0,1,0\n", "column 'time_ms' is in another unit"),
        ("time_s,x_m,y_m,nx,ny,tool_yaw_deg\n0,0.05,0,1,0,90\n", "name it tool_yaw_rad"),
        ("time_s,x_m,y_m,nx,ny,colour\n0,0.05,0,1,0,1\n", "unknown column 'colour'"),
        ("time_s,x_m,nx,ny\n0,0.05,1,0\n", "no column 'y_m'"),
        ("time_s,x_m,y_m,nx,ny\n1,0,0,1,0\n0,0,0,1,0\n", "contact 2: its time 0 s is earlier.*Sort"),
        ("time_s,grasp,x_m,y_m,nx,ny\n0,1,0,0,1,0\n1,0,0,0,1,0\n", "contact 2: its grasp number is lower"),
        ("time_s,x_m,y_m,nx,ny\n0,wide,0,1,0\n", "contact 1: x_m is 'wide', not a number"),
        ("time_s,x_m,y_m,nx,ny\n0,nan,0,1,0\n", "not a finite number"),
        ("time_s,x_m,y_m,nx,ny\n0,,0,1,0\n", "contact 1: has no x_m"),
        ("time_s,x_m,y_m,nx,ny\n0,0,0\n", "does not have 5 values"),
        ("time_s,x_m,y_m,nx,ny\n0,0,0,3,0\n", "a normal must have length 1, not 3"),
        ("time_s,x_m,y_m,fx_N\n0,0,0,0\n", "its force is 0 N"),
        ("time_s,x_m,y_m,fx_N\n0,0,0,2500\n", "the force in newtons"),
        ("time_s,x_m,y_m,nx,ny,held\n0,0,0,1,0,1\n", "the tool's pose is missing"),
        ("time_s,x_m,y_m,nx,ny,tool_x_m\n0,0,0,1,0,1\n", "incomplete pose"),
        ("time_s,x_m,y_m,nx,ny,tool_x_m,tool_y_m,tool_yaw_rad\n0,0,0,1,0,0,0,90\n", "radians, not degrees"),
        (
            "time_s,x_m,y_m,nx,ny,tool_x_m,tool_y_m,tool_qx,tool_qy,tool_qz,tool_qw\n0,0,0,1,0,0,0,0,0,0,1.02\n",
            "a quaternion must have length 1, not 1.02",
        ),
        ('time_s,x_m,y_m,nx,ny\n0,"0,0,1,0\n' + 14_000 * "0,0,0,1,0\n", "a quotation does not end"),
        ("time_s,x_m,y_m,x_m,nx,ny\n0,0,0,0,1,0\n", "two columns have the same name"),
        ("time_s,x_m,y_m,nx,ny\n", "contains no contact"),
        ("time_s;x_m;y_m;nx;ny\n0;0,05;0;1;0\n", "Separate the columns by commas"),
        ("time_s,x_m,y_m,nx,ny,point_sigma_m\n0,0,0,1,0,-1\n", "contact 1: point_sigma_m is -1"),
        ("time_s,x_m,y_m,nx,ny\n0,50,0,1,0\n9,-50,0,-1,0\n", "millimetres"),
    ],
)
def test_a_table_that_does_not_fit_is_refused_by_line_or_column(tmp_path, text, words):
    with pytest.raises(ConfigurationError, match=words) as told:
        import_contacts(table(tmp_path, text), tmp_path / "log.json", ImportSettings())
    assert "contacts.csv" in told.value.where
    assert not (tmp_path / "log.json").exists()


def test_nothing_is_left_of_contacts_that_make_no_sense(tmp_path):
    trimesh.creation.box((0.1, 0.06, 0.04)).export(tmp_path / "box.ply")
    source = table(tmp_path, "time_s,x_m,y_m,nx,ny\n0,50,0,1,0\n9,-50,0,-1,0\n")
    with pytest.raises(ConfigurationError, match="are lengths in millimetres"):
        import_contacts(source, tmp_path / "log.json", ImportSettings(), tmp_path / "box.ply")
    assert {path.name for path in tmp_path.iterdir()} == {"box.ply", "contacts.csv"}


@pytest.mark.parametrize(
    ("content", "words"),
    [
        ("[]", "its format is None"),
        ('{"format": "tactile-contacts/1"}', "needs no import"),
        (f'{{"format": "{FORMAT}", "contacts": 3}}', "must be a list"),
        (f'{{"format": "{FORMAT}", "contacts": [], "x": 1}}', "unknown key 'x'"),
        (f'{{"format": "{FORMAT}", "contacts": [], "point_sigma_m": "two"}}', "point_sigma_m is 'two'"),
        (f'{{"format": "{FORMAT}", "contacts": [], "normal_sigma_rad": 0}}', "Give a number above 0"),
        ("{", "is not JSON"),
    ],
)
def test_json_that_does_not_fit_is_refused(tmp_path, content, words):
    (tmp_path / "c.json").write_text(content)
    with pytest.raises(ConfigurationError, match=words):
        read_timed_contacts(tmp_path / "c.json")


def test_a_file_that_can_not_be_read_is_told(tmp_path):
    with pytest.raises(ConfigurationError, match="No such file"):
        read_timed_contacts(tmp_path / "none.csv")
    (tmp_path / "c.csv").write_bytes(b"\xff\xfe\x00")
    with pytest.raises(ConfigurationError, match="is not a text file"):
        read_timed_contacts(tmp_path / "c.csv")


def test_a_table_of_more_lines_than_a_person_brings_in_is_refused_before_it_is_read(tmp_path):
    (tmp_path / "table.csv").write_text("time_s,x_m,y_m\n" + "0,1,2\n" * 50_001)
    with pytest.raises(ConfigurationError, match="has 50002 lines, more than the 50000"):
        read_timed_contacts(tmp_path / "table.csv", ImportSettings())
