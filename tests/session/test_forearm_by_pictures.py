"""Forearm to world by pictures, through the physics: a board on the simulated hand, seen by the rig's camera."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import yaml

from calibration.forearm_wizard import problem_of
from calibration.quality import region_holds
from drivers.fingertip import RigidTransform
from sessions.calibration_station import StationSettings
from sessions.recorder import NullTraffic
from tactile_lab import rigs
from tactile_lab.geometry.poses import rotation_angle_rad
from tactile_lab.workflow.calibrating import CalibrationSettings, ForearmRequest, forearm_wizard

TRUTH = RigidTransform(translation_m=(0.006, -0.004, 0.005), rpy_rad=(0.01, -0.008, 0.012))
QUICK = StationSettings(travel_m_s=0.6, turn_rad_s=2.5, settle_s=0.2, capture_s=0.15)


def shifted_rig(folder: Path) -> str:
    """The simulated rig with its mount elsewhere than its calibration says, and its wrist off by 0.6 degrees."""
    home = Path(rigs.__file__).parent
    content = yaml.safe_load((home / "sim.yaml").read_text())
    content["calibration"] = {kind: str(home / file) for kind, file in content["calibration"].items()}
    content["simulation"] = {
        "world_T_mount": TRUTH.model_dump(),
        "joint_sensors": {"wrist_bias_rad": float(np.radians(0.6))},
    }
    path = folder / "shifted.yaml"
    path.write_text(yaml.safe_dump(content))
    return str(path)


def test_eight_pictures_find_the_mount_and_their_region_holds_it(tmp_path: Path) -> None:
    settings = CalibrationSettings(station=QUICK)
    request = ForearmRequest(shifted_rig(tmp_path), "marker", seed=1, pictures=8, settings=settings)
    with forearm_wizard(request, NullTraffic()) as (wizard, station):
        for step in wizard.steps():
            wizard.measure(step, station)
    assert wizard.motion().ok
    solution = problem_of(wizard.measured, wizard.settings).solve()
    off = TRUTH.pose().between(solution.world_T_mount)
    assert np.linalg.norm(off.translation()) < 1e-3
    assert np.degrees(rotation_angle_rad(off)) < 0.3
    assert region_holds(solution, TRUTH.pose())
    assert 0.5 < np.sqrt(solution.variance_factor) < 1.5
