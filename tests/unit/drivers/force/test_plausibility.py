"""What speaks against the noise of a force sensor that nothing touches."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest

from drivers.core.contacts import Array
from drivers.core.fingertip import load_fingertips
from drivers.force.plausibility import noise_objection
from tactile_lab import rigs

TIPS = load_fingertips(Path(rigs.__file__).parent / "calibrations" / "simulated-hand" / "fingertips.yaml")
KNOWN = np.repeat([TIPS["FF"].force_sigma_N, TIPS["FF"].moment_sigma_Nm], 3)


@pytest.mark.parametrize(
    ("noise", "words"),
    [
        (KNOWN, ""),
        (5.0 * KNOWN, ""),
        (7.0 * KNOWN, "noisier than its calibration says"),
        (
            0.0 * KNOWN,
            "its readings do not change, a still sensor has a noise of 3.1 mN: is it",
        ),
        (np.append(np.zeros(5), KNOWN[5]), ""),
    ],
)
def test_the_noise_of_a_still_sensor_is_neither_large_nor_nothing(noise: Array, words: str) -> None:
    told = noise_objection(noise, TIPS["FF"])
    assert re.match(words or "$", told)
