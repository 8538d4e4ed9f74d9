"""What a worse hand makes of the samples of a carry."""

from __future__ import annotations

import numpy as np
import pytest

from drivers.core.contacts import FINGERS
from drivers.shadow.model.kinematics import JOINTS
from sessions.perception.carrying.carry_record import CarrySamples
from tactile_lab.experiments.data.spoilt_samples import SPOILT, BENDING_rad_N, PLAY_rad, spoil

COUNT = 60


class PushedTip:
    """Feels 2 N."""

    def wrenches(self, readings, world_R_distal):
        return np.tile([0.0, -2.0, 0.0, 0.0, 0.0, 0.0], (len(readings), 1))


def samples():
    joints = np.zeros((COUNT, len(JOINTS)))
    joints[:, :] = 0.5 + 0.2 * np.sin(np.linspace(0.0, 2 * np.pi, COUNT))[:, None]
    readings = np.cumsum(np.ones((COUNT, 5, 6)), axis=0)
    return CarrySamples(1e7 * np.arange(COUNT), joints, np.tile(np.eye(4), (COUNT, 1, 1)), readings)


def spoilt(how):
    return spoil(samples(), how, {finger: PushedTip() for finger in FINGERS}, np.random.default_rng(1))


@pytest.mark.parametrize("how", SPOILT)
def test_every_error_changes_what_it_is_about_and_the_wrist_stays(how):
    before, after = samples(), spoilt(how)
    joints, readings = (
        not np.allclose(getattr(before, name), getattr(after, name)) for name in ("joints_rad", "readings")
    )
    assert joints == (how in ("joint gains", "play", "bending", "all of these"))
    assert readings == (how in ("crosstalk", "late forces", "all of these"))
    wrist = [name.startswith("WR") for name in JOINTS]
    np.testing.assert_array_equal(before.joints_rad[:, wrist], after.joints_rad[:, wrist])


def test_play_hides_a_motion_of_half_its_width_and_follows_a_longer_one():
    off = spoilt("play").joints_rad - samples().joints_rad
    assert np.abs(off).max() == pytest.approx(PLAY_rad / 2)


def test_links_bend_in_proportion_to_the_force():
    off = spoilt("bending").joints_rad - samples().joints_rad
    bent = [name[2:] in ("J2", "J3") and name[:2] in FINGERS for name in JOINTS]
    np.testing.assert_allclose(off[:, bent], 2 * BENDING_rad_N)
    np.testing.assert_allclose(off[:, ~np.array(bent)], 0.0)


def test_late_forces_lie_between_two_samples():
    after = spoilt("late forces").readings
    np.testing.assert_allclose(after[1:], samples().readings[1:] - 0.5)
