"""Mass, centre and friction from made wrenches of a hanging and of a dragged object."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from drivers.core.errors import SessionError
from drivers.core.fingertip import GRAVITY
from drivers.shadow.model.kinematics import JOINTS
from sessions.perception.carrying.held_object import HeldObject
from sessions.perception.carrying.net_wrench import upward_N
from sessions.perception.weighing.object_properties import ObjectProperties
from sessions.perception.weighing.scales import Scales
from sessions.perception.weighing.weighing import Dragging, dragging, hanging, until_it_slips
from sessions.recording.session_events import EventKind, SessionEvent
from tests.support.held_samples import TIPS, CENTRE_m, HEIGHT_m, JOINT_SIGMA_rad, held_samples

MASS_kg = 0.3


def test_what_hangs_free_is_weighed_and_its_centre_found():
    found = hanging(held_samples(0.0, MASS_kg * GRAVITY), TIPS, "right", JOINT_SIGMA_rad, HEIGHT_m)
    assert found.weight_N == pytest.approx(MASS_kg * GRAVITY, abs=1e-9)
    np.testing.assert_allclose(found.centre_m, CENTRE_m, atol=1e-9)
    assert found.held_back_N == pytest.approx(0.0, abs=1e-9)
    assert found.is_free
    assert 0.005 < found.weight_sigma_N / found.weight_N < 0.05
    assert (found.centre_sigma_m > 0.0003).all()


def test_joint_angles_that_are_wrong_by_what_is_stated_stay_within_the_stated_error():
    true, rng = held_samples(0.0, MASS_kg * GRAVITY), np.random.default_rng(1)
    off = []
    for _ in range(20):
        wrong = replace(true, joints_rad=true.joints_rad + rng.normal(0.0, JOINT_SIGMA_rad, len(JOINTS)))
        found = hanging(wrong, TIPS, "right", JOINT_SIGMA_rad, HEIGHT_m)
        off.append((found.weight_N - MASS_kg * GRAVITY) / found.weight_sigma_N)
    assert np.sqrt(np.mean(np.square(off))) < 1.5


def test_a_squeeze_that_swings_tells_what_wrong_joint_angles_add_to_the_weight():
    rng, off_N = np.random.default_rng(1), {0.0: [], 0.3: []}
    for swing, found_N in off_N.items():
        true = held_samples(0.0, MASS_kg * GRAVITY, swing=swing)
        for _ in range(10):
            wrong = replace(true, joints_rad=true.joints_rad + rng.normal(0.0, JOINT_SIGMA_rad, len(JOINTS)))
            found = hanging(wrong, TIPS, "right", JOINT_SIGMA_rad, HEIGHT_m)
            found_N.append(found.weight_N - MASS_kg * GRAVITY)
    at_rest_N, swung_N = (float(np.sqrt(np.mean(np.square(found_N)))) for found_N in off_N.values())
    assert swung_N < 0.6 * at_rest_N


def test_an_edge_that_still_stands_on_the_table_is_noticed():
    found = hanging(held_samples(pull_N=0.3, upward_N=2.0), TIPS, "right", JOINT_SIGMA_rad, HEIGHT_m)
    assert found.held_back_N == pytest.approx(0.3, abs=1e-6)
    assert not found.is_free


def test_an_upward_force_that_varies_shows_an_edge_on_the_table():
    samples = held_samples(0.0, MASS_kg * GRAVITY)
    samples.readings[15:25] *= 0.8
    found = hanging(samples, TIPS, "right", JOINT_SIGMA_rad, HEIGHT_m)
    assert found.unsteady_N > 0.1
    assert found.stands
    assert not found.is_free


def test_fingertips_that_push_the_object_sideways_show_a_link_that_pushes_back():
    samples = held_samples(0.0, MASS_kg * GRAVITY)
    samples.readings[:, :, 1] += 0.3
    found = hanging(samples, TIPS, "right", JOINT_SIGMA_rad, HEIGHT_m)
    assert found.is_leaned_on
    assert not found.stands
    assert not found.is_free


def test_friction_of_the_table_is_half_the_difference_between_to_and_fro():
    found = dragging(held_samples(pull_N=1.0, upward_N=-0.2), TIPS, "right")
    assert found.friction_N == pytest.approx(1.0, abs=1e-6)
    assert found.pressed_N == pytest.approx(0.2, abs=1e-9)


def test_a_fingertip_without_a_reading_counts_for_nothing():
    samples = held_samples(0.0, MASS_kg * GRAVITY)
    samples.readings[:, 0] = np.nan
    assert hanging(samples, TIPS, "right", JOINT_SIGMA_rad, HEIGHT_m).weight_N == pytest.approx(0.8 * MASS_kg * GRAVITY)


def test_the_upward_force_now_is_that_of_the_newest_readings():
    TIPS["FF"].wrench = np.array([0.0, 0.0, -1.5, 0.0, 0.0, 0.0])
    assert upward_N(TIPS, np.tile(np.eye(3), (5, 1, 1))) == pytest.approx(1.5)
    TIPS["FF"].wrench = np.zeros(6)


def test_what_slips_in_the_fingers_is_believed_until_then():
    samples = held_samples(0.0, MASS_kg * GRAVITY)
    assert len(until_it_slips(samples, TIPS, "right").stamps_ns) == len(samples.stamps_ns)
    samples.readings[36:] *= 0.7
    assert 20 <= len(until_it_slips(samples, TIPS, "right").stamps_ns) < 36
    samples.readings[25:] *= 0.7
    assert until_it_slips(samples, TIPS, "right") is None


def test_of_one_lift_the_more_certain_weight_counts_and_the_first_centre():
    wrong = np.random.default_rng(3).normal(0.0, JOINT_SIGMA_rad, len(JOINTS))
    still, swinging = (held_samples(0.0, MASS_kg * GRAVITY, swing=swing) for swing in (0.0, 0.3))
    liftings = ([still], [still, swinging], [still, held_samples(pull_N=0.3, upward_N=2.0)])
    (alone,), (swung,), (caught,) = (weighed(each, wrong).hangings for each in liftings)
    assert swung[1].weight_sigma_N < 0.8 * alone[1].weight_sigma_N
    np.testing.assert_array_equal(swung[1].centre_m, alone[1].centre_m)
    assert caught[1].weight_N == alone[1].weight_N


def weighed(liftings, wrong_rad):
    """What scales know after the liftings of one grasp, with joint angles that are wrong."""
    left = iter([replace(each, joints_rad=each.joints_rad + wrong_rad) for each in liftings])
    still = SimpleNamespace(
        samples_since=lambda stamp_ns: next(left),
        carried_until=lambda stamp_ns: None,
        fingertips=TIPS,
        contact_height_m=HEIGHT_m,
        odometry=SimpleNamespace(),
    )
    scales = Scales(still, "right", JOINT_SIGMA_rad)
    for _ in liftings:
        scales.event(SessionEvent(EventKind.HANG_BEGIN, 1), 0)
        scales.event(SessionEvent(EventKind.HANG_END, 2), 0)
    return scales.properties


def known():
    found = ObjectProperties()
    found.draggings.append((0, Dragging(1.05, 0.05, 0.06)))
    found.hangings.append((1, hanging(held_samples(0.0, MASS_kg * GRAVITY), TIPS, "right", JOINT_SIGMA_rad, HEIGHT_m)))
    found.sliding.append((1, np.linspace(0.5, 0.9, 100)))
    return found


def test_properties_come_with_their_standard_deviations():
    found = known()
    assert found.mass_kg.value == pytest.approx(MASS_kg)
    assert found.table_friction.value == pytest.approx(1.05 / (MASS_kg * GRAVITY + 0.06))
    assert found.tip_friction_at_least == pytest.approx(0.86, abs=0.01)
    assert found.centres[0].grasp_index == 1
    assert "mass 300 ±" in found.in_words()


def test_what_did_not_hang_free_is_no_mass():
    found = ObjectProperties()
    stands = hanging(held_samples(pull_N=0.3, upward_N=2.0), TIPS, "right", JOINT_SIGMA_rad, HEIGHT_m)
    found.hangings.append((0, stands))
    assert found.mass_kg is None
    assert found.is_known
    assert "nothing" in found.in_words()


def test_an_undone_grasp_takes_along_what_was_weighed_in_it():
    found = known()
    found.undo(1)
    assert found.mass_kg is None
    assert found.table_friction_N.value == pytest.approx(1.05)
    assert found.tip_friction_at_least is None


def test_odometry_learns_what_was_measured_and_forgets_what_was_undone():
    watched = HeldObject({}, "right")
    scales = Scales(watched, "right", JOINT_SIGMA_rad)
    scales.properties.draggings.append((0, Dragging(0.5, 0.05, 0.06)))
    scales.on_carry(np.linspace(0.5, 0.9, 100), 0)
    assert watched.odometry.friction.table_N == 0.5
    assert watched.odometry.friction.tips == pytest.approx(0.86, abs=0.01)
    scales.undo(0)
    assert watched.odometry.measured == ObjectProperties().friction
    assert watched.odometry.friction.table_N == HeldObject({}, "right").odometry.friction.table_N


def test_an_end_without_a_beginning_is_refused():
    scales = Scales(HeldObject({}, "right"), "right", JOINT_SIGMA_rad)
    with pytest.raises(SessionError, match="without its beginning"):
        scales.event(SessionEvent(EventKind.HANG_END, 1), 0)


def test_fingertips_that_tell_nothing_while_they_move_weigh_nothing():
    scales = Scales(HeldObject({}, "right"), "right", JOINT_SIGMA_rad)
    for kind in (EventKind.DRAG_BEGIN, EventKind.DRAG_END, EventKind.HANG_BEGIN, EventKind.HANG_END):
        assert scales.event(SessionEvent(kind, 1), 0) is None
    assert not scales.properties.is_known
