"""The science as a library: contacts in, a contour with its uncertainty out, and no device is loaded for it."""

from __future__ import annotations

import subprocess
import sys

import tactile_lab

SESSION = """
import numpy as np
from gtsam import Pose3
from tactile_lab import Contact, Grasp, SlamSettings, TactileSlam

rng, slam = np.random.default_rng(0), TactileSlam(SlamSettings(dimension=2), seed=0)
for index in range(6):
    contacts = []
    for finger, turn in zip(("FF", "MF", "RF", "LF", "TH"), rng.uniform(0.0, 2.0 * np.pi, 5)):
        normal = np.array([np.cos(turn), np.sin(turn), 0.0])
        contacts.append(Contact(finger, 0.03 * normal + rng.normal(0.0, 0.0003, 3), normal))
    slam.add_grasp(Grasp(index, index, tuple(contacts), hand_motion_world=Pose3()))
outline = slam.finish().contour
radii_m = np.linalg.norm(outline.points_m - outline.points_m.mean(0), axis=1)
print(round(float(radii_m.mean()), 4), outline.sigma_m.max() > 0)
"""


def test_contacts_become_a_contour_with_sigma_in_fifteen_lines_without_any_driver() -> None:
    loaded = "\nimport sys\nprint(*sorted({name for name in sys.modules if name.startswith(('drivers', 'sessions'))}))"
    done = subprocess.run([sys.executable, "-c", SESSION + loaded], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    figures, names = done.stdout.splitlines()
    radius_m, has_sigma = figures.split()
    assert abs(float(radius_m) - 0.03) < 0.002
    assert has_sigma == "True"
    assert all(name == "drivers" or name.startswith("drivers.core") for name in names.split()), names
    assert len([line for line in SESSION.splitlines() if line]) <= 15


def test_everything_that_is_public_can_be_had() -> None:
    for name in tactile_lab.__all__:
        assert getattr(tactile_lab, name).__name__ == name
