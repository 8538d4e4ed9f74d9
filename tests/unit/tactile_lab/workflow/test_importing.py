"""A recording nobody here made, from its own file through ``session import`` to a judged shape.

A person rolls an instrumented cylinder of 40 mm radius between three fingers; a Nano17 behind each sector of its wall
measures the finger on it (``tests/unit/drivers/force/test_finger_manipulation.py`` tells what is known of it). The
sectors stay in the cylinder's frame, so the contacts of one are touches of a fixed object, whose true shape is
known.
"""

from __future__ import annotations

import csv
from pathlib import Path

import numpy as np
import pytest
import trimesh

from drivers.core.contacts import Array
from drivers.force.intrinsic_contact import contact_on_ellipsoid
from sessions.exchange.timed_contacts import ImportSettings
from tactile_lab.workflow.importing import import_contacts
from tactile_lab.workflow.reconstructing import Wishes, reconstruct_log
from tests.unit.drivers.force.test_finger_manipulation import SECTOR, AXIS_m, RADIUS_m, TURN_rad

RATE_Hz, EVERY, TOGETHER, TOUCHES_N = 60.0, 25, 4, 1.0
COLUMNS = ("time_s", "grasp", "finger", "x_m", "y_m", "fx_N", "fy_N", "object_x_m", "object_y_m", "object_yaw_rad")


def sector_wrenches(table: Path, sensor: int) -> tuple[Array, Array, Array]:
    """Times in seconds, forces on a sector and their moments about the cylinder's axis, shapes (samples, 3)."""
    raw = np.loadtxt(table, delimiter=",").reshape(-1, 3, 6)[:, sensor - 1] * np.repeat([1.0, 1e-3], 3)
    raw -= raw[:40].mean(axis=0)  # no finger is on it yet
    cosine, sine = np.cos(TURN_rad), np.sin(TURN_rad)
    turn = np.array([[cosine, sine, 0], [-sine, cosine, 0], [0, 0, 1]])
    force, moment = raw[:, :3] @ turn.T, raw[:, 3:] @ turn.T
    return np.arange(len(raw)) / RATE_Hz, force, moment + np.cross([0.0, 0.0, AXIS_m], force)


def converted(table: Path, sensor: int, out: Path) -> int:
    """Write the contacts of a sensor as a table for import, in the plane across the cylinder's axis; how many."""
    times_s, force, moment = sector_wrenches(table, sensor)
    solved = contact_on_ellipsoid(force, moment, np.array(SECTOR.semi_axes_m))
    firm = np.flatnonzero((np.linalg.norm(force, axis=1) > TOUCHES_N) & (solved.axis_distance < 1.0))[::EVERY]
    with out.open("w", newline="") as file:
        writer = csv.writer(file)
        writer.writerow(COLUMNS)
        for number, i in enumerate(firm):
            measured = [*solved.point_m[i, [0, 2]], *-force[i, [0, 2]]]  # the force on the finger, not on the sector
            cells = [f"{times_s[i]:.4f}", number // TOGETHER, "FF", *(f"{value:.6f}" for value in measured)]
            writer.writerow([*cells, 0, 0, 0])
    return len(firm)


@pytest.mark.parametrize("sensor", [1, 2])
def test_real_touches_of_a_known_cylinder_are_imported_and_give_its_radius(lab_data, tmp_path, sensor) -> None:
    number = converted(lab_data / "finger_manipulation" / "roll" / "raw_data.csv", sensor, tmp_path / "roll.csv")
    cylinder = trimesh.creation.cylinder(radius=RADIUS_m, height=0.022, sections=128)
    cylinder.export(tmp_path / "cylinder.ply")
    log = import_contacts(
        tmp_path / "roll.csv", tmp_path / "roll.json", ImportSettings(), mesh=tmp_path / "cylinder.ply"
    )
    assert sum(len(grasp.contacts) for grasp in log.grasps) == number > 40
    finished = reconstruct_log(tmp_path / "roll.json", Wishes(method="known-pose", seed=1))
    assert finished.evaluation is not None
    document = finished.evaluation.as_json()
    assert document["contacts"] == number
    assert "every grasp touched only one side of the object: its other sides are unknown" in document["warnings"]
    known_m = touched_outline_m(finished.results, np.array([c.point_world_m for g in log.grasps for c in g.contacts]))
    radius_m = np.linalg.norm(known_m, axis=1)  # the cylinder's axis is the world's origin
    assert len(known_m) > 25
    assert abs(np.median(radius_m) - RADIUS_m) < 0.0005
    assert np.abs(radius_m - RADIUS_m).max() < 0.002


def touched_outline_m(results: Path, points_m: Array) -> Array:
    """The estimated outline within 2 mm of the contacts, shape (n, 2), world frame."""
    trajectory = np.genfromtxt(results / "trajectory.csv", delimiter=",", names=True)
    origin_m = [trajectory["world_T_object_03"][-1], trajectory["world_T_object_13"][-1]]
    outline_m = np.loadtxt(results / "contour.csv", delimiter=",", skiprows=1, usecols=(0, 1)) + origin_m
    return outline_m[np.linalg.norm(outline_m[:, None] - points_m[:, :2], axis=2).min(axis=1) < 0.002]
