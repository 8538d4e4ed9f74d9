from __future__ import annotations

import numpy as np
import pytest

from calibration.forearm.placement import load_forearm
from drivers.core.errors import ConfigurationError

FILE = """
world_T_mount: {translation_m: [0.1, 0.2, 0.3], rpy_rad: [0.0, 0.0, 1.5707963267948966]}
translation_sigma_m: 2e-3
rotation_sigma_rad: 0.01
"""


def test_pose_and_covariance_come_from_the_file(tmp_path):
    path = tmp_path / "forearm.yaml"
    path.write_text(FILE)
    forearm = load_forearm(path)
    np.testing.assert_allclose(forearm.world_T_mount.pose().transformFrom(np.array([1.0, 0, 0])), [0.1, 1.2, 0.3])
    np.testing.assert_allclose(np.diag(forearm.covariance()), [1e-4] * 3 + [4e-6] * 3)


@pytest.mark.parametrize(("old", "new"), [("2e-3", "-1.0"), ("0.01", ".nan"), ("translation_sigma_m", "sigma_m")])
def test_a_file_that_does_not_fit_is_named(tmp_path, old, new):
    path = tmp_path / "forearm.yaml"
    path.write_text(FILE.replace(old, new))
    with pytest.raises(ConfigurationError, match=r"forearm\.yaml"):
        load_forearm(path)
