"""Contact logs and tables of contacts, entry by entry: what is taken and what is refused, as before."""

from __future__ import annotations

import copy
import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from sessions.exchange.contact_log import ContactLog, read_contact_log, write_contact_log
from sessions.exchange.timed_contacts import ImportSettings, read_timed_contacts
from tests.support.baseline import assert_baseline
from tests.support.made_results import grasps, true_poses
from tests.support.said import said

# --- contact logs


def document() -> dict[str, Any]:
    """A small log with everything a log can state."""
    eye = np.eye(4).tolist()
    contacts = [
        {"finger": f"F{n}", "point_world_m": [0.03 * np.cos(n), 0.03 * np.sin(n), 0.0], "normal_world": [0.6, 0.8, 0.0]}
        for n in range(2)
    ]
    contacts[1] |= {"point_sigma_m": 0.003, "normal_sigma_rad": 0.2, "force_N": 1.5}
    line = {"finger": "F0", "start_world_m": [0.1, 0.0, 0.0], "end_world_m": [0.03, 0.0, 0.0], "touched": True}
    grasp = {
        "stamp_s": 1.5,
        "contacts": contacts,
        "hand_motion_world": eye,
        "closing_lines": [line],
        "world_T_object": np.eye(4).tolist(),
    }
    return {
        "format": "tactile-contacts/1",
        "dimension": 2,
        "point_sigma_m": 0.001,
        "normal_sigma_rad": 0.1,
        "motion_sigma": {"translation_m": 0.002, "rotation_rad": 0.03},
        "object": {"name": "box", "polygon_m": [[0, 0], [1, 0], [1, 1]]},
        "grasps": [grasp, copy.deepcopy(grasp)],
    }


CHANGES: dict[str, tuple[str, list[Any]]] = {
    "format": ("format", ["tactile-contacts/2", None]),
    "dimension": ("dimension", [3, 4]),
    "point sigma": ("point_sigma_m", [0.2, 0.21, 0.0]),
    "normal sigma": ("normal_sigma_rad", [3.14159, 3.15, 0.0]),
    "motion sigma": (
        "motion_sigma",
        [{"translation_m": 0.0, "rotation_rad": 0.0}, {"translation_m": 0.21, "rotation_rad": 0}],
    ),
    "unheld": ("motion_sigma.unheld", [0.0, 1.0, 1.01]),
    "palm": ("motion_sigma.palm_m", [0.0, -0.001]),
    "polygon": (
        "object.polygon_m",
        [[[0, 0], [2.0, 0], [1, 1]], [[0, 0], [2.01, 0], [1, 1]], [[0, 0], [1, 0]], [[0, 0]] * 2001],
    ),
    "mesh": ("object.mesh", ["a.ply", "a/b.ply", "..", ""]),
    "finger": ("grasps.0.contacts.0.finger", ["", "x" * 40, "x" * 41]),
    "normal": ("grasps.0.contacts.0.normal_world", [[1.0099, 0, 0], [1.0101, 0, 0], [0.9899, 0, 0], [0.9901, 0, 0]]),
    "height": ("grasps.0.contacts.0.point_world_m", [[0.0, 0.0, 1e-9], [0.27, 0, 0], [0.5, 0, 0], [1e308, 0, 0]]),
    "own sigma": ("grasps.0.contacts.0.point_sigma_m", [0.0, 0.2, 0.21]),
    "force": ("grasps.0.contacts.0.force_N", [0.0, -0.1]),
    "covariance": (
        "grasps.0.contacts.0.point_covariance_m2",
        [
            np.eye(3).tolist(),
            [[1, 0, 0], [1e-3, 1, 0], [0, 0, 1]],
            [[-1e-13, 0, 0], [0, 1, 0], [0, 0, 1]],
            [[-1, 0, 0], [0, 1, 0], [0, 0, 1]],
        ],
    ),
    "motion": ("grasps.1.hand_motion_world.0.3", [1.99, 2.01, 30.0]),
    "rotation": ("grasps.1.hand_motion_world.0.0", [1.00004, 1.0001, -1.0]),
    "last row": ("grasps.1.hand_motion_world.3.0", [1e-7, 1e-5]),
    "object pose": ("grasps.1.world_T_object.1.3", [99.0, 101.0]),
    "line": ("grasps.1.closing_lines.0.end_world_m", [[0.0, 0.0, 0.1], [500.0, 0.0, 0.0]]),
    "grasps": ("grasps", [[], [{"contacts": [], "hand_motion_world": np.eye(4).tolist()}]]),
    "apart": (
        "grasps.1.contacts",
        [[{"finger": "F", "point_world_m": [x, 0, 0], "normal_world": [1, 0, 0]}] for x in (19.9, 20.2)],
    ),
    "many": ("grasps.0.contacts", [[document()["grasps"][0]["contacts"][0]] * count for count in (100, 101)]),
}


def test_contact_logs_entry_by_entry(tmp_path: Path) -> None:
    path, told = tmp_path / "log.json", {}
    for name, (key, values) in CHANGES.items():
        for number, value in enumerate(values):
            content: Any = document()
            *way, last = key.split(".")
            at = content
            for step in way:
                at = at[int(step)] if isinstance(at, list) else at[step]
            at[int(last) if isinstance(at, list) else last] = value
            path.write_text(json.dumps(content))
            told[f"{name}, {number}"] = said(lambda: _counts(read_contact_log(path)), tmp_path)
    for name, text in {"torn": "{", "twice": '{"format": 1, "format": 2}', "a list": "[]"}.items():
        path.write_text(text)
        told[name] = said(lambda: _counts(read_contact_log(path)), tmp_path)
    inward = document()
    for contact, x in zip(inward["grasps"][0]["contacts"], (0.03, -0.03), strict=True):
        contact |= {"point_world_m": [x, 0.0, 0.0], "normal_world": [-np.sign(x), 0.0, 0.0]}
    inward["grasps"] = inward["grasps"][:1] * 4
    path.write_text(json.dumps(inward))
    told["inward"] = said(lambda: _counts(read_contact_log(path)), tmp_path)
    assert_baseline("sessions/exchange/logs", told)


def _counts(log: ContactLog) -> list[Any]:
    first = log.grasps[0]
    return [
        *(log.dimension, log.point_sigma_m, log.normal_sigma_rad, len(log.grasps), len(first.contacts), first.stamp_ns),
        *(
            [c.finger, c.force_N, c.normal_sigma_rad, np.diag(c.point_covariance_m2), c.normal_world]
            for c in first.contacts[:2]
        ),
        *(first.world_T_palm.matrix()[:3, 3], log.truth and log.truth.name, [p is None for p in log.true_poses]),
        *(log.motion_sigma and log.motion_sigma.model_dump(), len(first.approach_paths)),
    ]


@pytest.mark.parametrize("dimension", [2, 3])
def test_a_log_that_is_written(dimension: Any, tmp_path: Path) -> None:
    path = tmp_path / "log.json"
    log = ContactLog(dimension, 0.001, 0.15, None, grasps(), None, true_poses())
    count = write_contact_log(path, log)
    content = json.loads(path.read_text())
    assert_baseline(f"sessions/exchange/written_{dimension}", {"contacts": count, "log": content}, atol=1e-8)
    np.testing.assert_equal(len(read_contact_log(path).grasps), len(grasps()))


# --- tables of contacts


HEAD = (
    "time_s,grasp,finger,x_m,y_m,z_m,nx,ny,nz,held,tool_x_m,tool_y_m,tool_yaw_rad,"
    "object_x_m,object_y_m,object_qw,object_qx,object_qy,object_qz,point_sigma_m"
)
LINES = (
    "0.0,1,FF,0.01,0.02,0.03,1,0,0,,0.1,0.2,0.3,0,0,1,0,0,0,0.002",
    "0.1,1,TH,-0.01,0.02,0.03,-1,0,0,,0.1,0.2,0.3,0,0,1,0,0,0,",
    "1.0,2,FF,0.02,0.02,0.03,0.6,0.8,0,1,0.15,0.2,0.5,0.01,0,0.995,0.0998,0,0,",
)
TABLES: dict[str, list[str]] = {
    "as it should be": [HEAD, *LINES],
    "with a comment": ["# measured on a Monday", HEAD, *LINES],
    "millimetres": [HEAD.replace("x_m", "x_mm", 1), *LINES],
    "degrees": [HEAD.replace("tool_yaw_rad", "tool_yaw_deg"), *LINES],
    "unknown column": [HEAD.replace("held", "colour"), *LINES],
    "semicolons": [HEAD.replace(",", ";"), *LINES],
    "same name": [HEAD.replace("ny", "nx"), *LINES],
    "no time": [HEAD.replace("time_s", "point_sigma_m"), *LINES],
    "nothing": [HEAD],
    "too few values": [HEAD, LINES[0], "0.1,1,TH"],
    "too many values": [HEAD, LINES[0] + ",1"],
    "not a number": [HEAD, LINES[0].replace("0.03", "high")],
    "infinite": [HEAD, LINES[0].replace("0.03", "inf")],
    "earlier": [HEAD, LINES[2], LINES[0]],
    "lower grasp": [HEAD, LINES[0].replace("0.0,1", "0.0,3"), LINES[1]],
    "no height": [HEAD, LINES[0], LINES[1].replace("0.02,0.03", "0.02,")],
    "long normal": [HEAD, LINES[0].replace(",1,0,0,", ",1.0101,0,0,", 1)],
    "nearly a normal": [HEAD, LINES[0].replace(",1,0,0,", ",1.0099,0,0,", 1)],
    "no sigma": [HEAD, LINES[0].replace("0.002", "0")],
    "held by nothing": ["time_s,x_m,y_m,nx,ny,held", "0,0,0,1,0,0", "1,0,0,1,0,1"],
    "turned far": [HEAD, LINES[0].replace("0.2,0.3", "0.2,12.6")],
    "turned often": [HEAD, LINES[0].replace("0.2,0.3", "0.2,12.5")],
    "no quaternion": [HEAD, LINES[0].replace("0,0,1,0,0,0", "0,0,1,0,0,")],
    "long quaternion": [HEAD, LINES[0].replace("0,0,1,0,0,0", "0,0,1.02,0,0,0")],
    "by time": ["time_s,x_m,y_m,nx,ny", "0,0,0,1,0", "0.5,0,0.01,0,1", "1.01,0,0,1,0"],
    "by force": ["time_s,x_m,y_m,fx_N,fy_N", "0,0,0,3,4", "0.1,0,0.01,0,999"],
    "too much force": ["time_s,x_m,y_m,fx_N,fy_N", "0,0,0,0,1000"],
    "no force": ["time_s,x_m,y_m,fx_N,fy_N", "0,0,0,0,0"],
}


def test_tables_of_contacts_line_by_line(tmp_path: Path) -> None:
    told = {}
    for name, lines in TABLES.items():
        path = tmp_path / "table.csv"
        path.write_text("\n".join(lines) + "\n")
        told[name] = said(lambda path=path: _counts(read_timed_contacts(path, ImportSettings(mesh="a.ply"))), tmp_path)
    rows = [
        dict(zip(("time_s", "x_m", "y_m", "nx", "ny"), (0.7 * n, 0.01 * n, 0.0, 1.0, 0.0), strict=True))
        for n in range(3)
    ]
    documents: dict[str, Any] = {
        "json": {"contacts": rows, "point_sigma_m": 0.004, "note": "x", "object": {"name": "a", "mesh": "b.ply"}},
        "json, own gap": {"contacts": rows, "normal_sigma_rad": 0.2},
        "unknown key": {"contacts": rows, "colour": 1},
        "sigma zero": {"contacts": rows, "point_sigma_m": 0},
        "sigma true": {"contacts": rows, "normal_sigma_rad": True},
        "no list": {"contacts": {}},
        "no objects": {"contacts": [1]},
        "bad object": {"contacts": rows, "object": {"mesh": "a/b"}},
    }
    for name, content in documents.items():
        path = tmp_path / "table.json"
        path.write_text(json.dumps({"format": "tactile-timed-contacts/1", **content}))
        told[name] = said(lambda path=path: _counts(read_timed_contacts(path, ImportSettings(gap_s=0.69))), tmp_path)
    for name, text in {
        "other form": '{"format": "x"}',
        "a log": '{"format": "tactile-contacts/1"}',
        "torn": "{",
        "list": "[]",
    }.items():
        path.write_text(text)
        told[name] = said(lambda path=path: _counts(read_timed_contacts(path)), tmp_path)
    assert_baseline("sessions/exchange/tables", told, atol=1e-8)
