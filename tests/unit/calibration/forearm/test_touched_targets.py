"""What is touched: faces whose place is not quite known, and points that tell all three coordinates."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from gtsam import Pose3

from calibration.forearm.touch_plan import plan_touches
from calibration.forearm.touch_problem import TouchProblem
from calibration.steps.geometry import KnownGeometry, TableEdges
from calibration.steps.hand_chain import mount_T_link
from calibration.steps.observations import Plane, Spot, Touch
from tactile_lab.experiments.data.calibration_data import TrueRig, touches_of


@pytest.fixture(scope="module")
def recorded() -> tuple[Pose3, list[Touch]]:
    """The mount's true place and touches of a table."""
    rng = np.random.default_rng(1)
    rig = TrueRig.draw(rng)
    table = KnownGeometry(table=TableEdges(size_m=(1.0, 1.0), thickness_m=0.02, pressed_m=0.3))
    return rig.world_T_mount, touches_of(plan_touches(table, ("FF", "MF"), 4), rig, rng)


def with_top(touches: list[Touch], *, sigma_m: float, off_m: float = 0.0) -> list[Touch]:
    """The same touches, the table's top described ``off_m`` too high and known to ``sigma_m``."""
    changed = []
    for touch in touches:
        plane = touch.target
        assert isinstance(plane, Plane)
        if plane.name == "table top":
            plane = replace(plane, sigma_m=sigma_m, point_world_m=np.add(plane.point_world_m, [0.0, 0.0, off_m]))
        changed.append(replace(touch, target=plane))
    return changed


def height_sigma_m(touches: list[Touch]) -> float:
    solution = TouchProblem(touches).solve()
    rotation = solution.world_T_mount.rotation().matrix()
    return float(np.sqrt((rotation @ solution.covariance[3:, 3:] @ rotation.T)[2, 2]))


def test_what_is_not_known_of_the_table_s_height_is_not_known_of_the_mount_s(recorded) -> None:
    _, touches = recorded
    assert height_sigma_m(with_top(touches, sigma_m=1e-5)) < 0.001
    assert height_sigma_m(with_top(touches, sigma_m=0.005)) == pytest.approx(0.005, rel=0.1)


def test_points_of_known_place_find_the_mount(recorded) -> None:
    truth, touches = recorded
    rng = np.random.default_rng(4)
    spots = []
    for number, touch in enumerate(touches):
        place = truth.transformFrom((mount_T_link(touch.pose, touch.finger) @ np.append(touch.point_distal_m, 1.0))[:3])
        spot = Spot(f"spot {number}", place + 1e-4 * rng.standard_normal(3), 1e-4)
        spots.append(replace(touch, target=spot, force_N=0.0))
    away = TouchProblem(spots).solve().world_T_mount.between(truth)
    assert np.linalg.norm(away.translation()) < 5e-4
    assert np.degrees(np.linalg.norm(Pose3.Logmap(away)[:3])) < 0.2
