from __future__ import annotations

import numpy as np
import pytest
from gtsam import Pose2

from drivers.core.contacts import FINGERS
from sessions.perception.carrying.carry import CarryOdometry
from sessions.perception.carrying.friction_balance import Balance, Friction, compose_steps
from tests.support.held_objects import BOX, DISC, carried, steps_of

TURN = Pose2(0.02, -0.01, 0.4)
_HOLDS = (("FF", "TH"), FINGERS)


def odometry():
    found = CarryOdometry(dict.fromkeys(("FF", "MF", "RF", "LF", "TH")), "right")
    found._spans_m = [0.08]
    return found


def error(carry, expected, middle_m=(0.0, 0.0)):
    """Millimetres at the object's middle, and degrees."""
    gap = carry.motion.transformFrom(np.array(middle_m)) - expected.transformFrom(np.array(middle_m))
    return 1e3 * np.linalg.norm(gap), np.degrees(abs(carry.motion.theta() - expected.theta()))


@pytest.mark.parametrize("contacts", [BOX, DISC], ids=["box", "disc"])
def test_an_object_whose_fingertips_stick_moves_with_them(contacts):
    balance = Balance.of(carried(contacts, object_motion=TURN, palm_motion=TURN))
    found = compose_steps(balance.solve([Friction(table_N=0.0)], 12), balance.centres_m)[0]
    np.testing.assert_allclose(found, TURN.matrix(), atol=1e-5)


@pytest.mark.parametrize("contacts", [BOX, DISC], ids=["box", "disc"])
def test_a_table_holds_it_back_by_no_more_than_the_creep(contacts):
    """A third of what the fingertips could hold, so a third of 3 mm/s, for 2 s; the noise nearly says so."""
    carry = odometry().carry(carried(contacts, object_motion=TURN, palm_motion=TURN))
    millimetres, degrees = error(carry, TURN)
    assert millimetres < 2.0
    assert degrees < 3.0
    assert carry.problems == ()
    assert millimetres < 3.5e3 * carry.sigma.translation_m
    assert degrees < 3 * np.degrees(carry.sigma.rotation_rad)


def test_an_object_that_turns_in_the_hand_with_its_fingertips_is_followed():
    held = Pose2(0.02, -0.01, 0.15)
    carry = odometry().carry(carried(BOX, object_motion=held, palm_motion=TURN))
    millimetres, degrees = error(carry, held)
    assert millimetres < 2.0
    assert degrees < 2.0
    assert np.degrees(carry.slip_rad) == pytest.approx(np.degrees(0.25), abs=2.0)


def test_fingertips_that_slide_along_a_flat_side_leave_the_object_where_its_other_side_holds_it():
    """One finger slides 5 mm along its face while four stick."""
    steps = carried(BOX, object_motion=TURN, palm_motion=TURN, extra_moves={"FF": np.array([0.005, 0.0, 0.0])})
    millimetres, degrees = error(odometry().carry(steps), TURN)
    assert millimetres < 1.0
    assert degrees < 2.0


def test_an_object_that_nobody_touches_stays_and_the_noise_holds_what_the_palm_did():
    steps = carried(BOX, object_motion=Pose2(), palm_motion=TURN, felt=())
    carry = odometry().carry(steps)
    assert carry.motion.equals(Pose2(), 1e-9)
    assert carry.loose_s == pytest.approx(steps.step_s.sum())
    assert "touched by no fingertip" in carry.in_words()
    assert carry.sigma.translation_m > 0.01
    assert carry.sigma.rotation_rad > 0.15


def test_an_object_that_slips_out_halfway_stays_where_it_was_lost():
    steps = carried(BOX, object_motion=TURN, palm_motion=TURN)
    steps.forces_N[len(steps) // 2 :] = 0.0
    carry = odometry().carry(steps)
    assert carry.motion.theta() == pytest.approx(TURN.theta() / 2, abs=0.02)
    missed_m, missed_rad = np.linalg.norm([0.01, 0.005]), 0.2
    assert carry.sigma.translation_m > missed_m / 3
    assert carry.sigma.rotation_rad > missed_rad / 3


def test_one_fingertip_tells_little_and_says_so():
    carry = odometry().carry(carried(BOX, object_motion=TURN, palm_motion=TURN, felt=("TH",)))
    assert "held by one fingertip" in carry.in_words()
    millimetres, degrees = error(carry, TURN)
    assert 1e3 * carry.sigma.translation_m > millimetres / 3
    assert np.degrees(carry.sigma.rotation_rad) > degrees / 3


def test_a_saturated_fingertip_is_named_and_makes_the_carry_less_certain():
    steps = carried(BOX, object_motion=TURN, palm_motion=TURN, felt=("FF", "MF", "RF", "TH"))
    steps.is_void[:, 3] = True
    carry = odometry().carry(steps)
    assert carry.void == ("LF",)
    assert "LF without valid readings" in carry.in_words()
    assert carry.sigma.translation_m > 0.005


def test_an_object_that_cannot_be_moved_resists_and_the_noise_holds_that():
    """All fingertips slide along it: kinematics alone would say that it is dragged along."""
    shift = Pose2(0.02, 0.0, 0.0)
    steps = carried(BOX, object_motion=shift, palm_motion=shift)
    steps.net_forces_N[:] = [0.6 * steps.forces_N.sum(axis=1)[0], 0.0, 0.0]
    carry = odometry().carry(steps)
    assert "resisted" in carry.in_words()
    assert carry.is_remarkable
    assert carry.sigma.translation_m > error(carry, Pose2())[0] / 1e3 / 3


def test_an_object_that_cannot_be_turned_resists_and_the_noise_holds_that():
    """All fingertips slide around it: their forces balance, only their moment tells."""
    turn = Pose2(0.0, 0.0, 0.4)
    steps = carried(DISC, object_motion=turn, palm_motion=turn)
    steps.levers_m[:], steps.moments_Nm[:] = 0.03, 0.9 * 0.03 * steps.forces_N.sum(axis=1)
    carry = odometry().carry(steps)
    assert carry.resisted_N == pytest.approx(0.9 * 5.0)
    assert carry.sigma.rotation_rad > error(carry, Pose2())[1] / np.degrees(3)


@pytest.mark.parametrize("felt", [("FF", "TH"), FINGERS])
def test_the_tables_friction_is_no_jam_however_few_fingertips_drag_the_object(felt):
    steps = carried(BOX, object_motion=TURN, palm_motion=TURN, felt=felt)
    steps.net_forces_N[:] = [0.9, 0.0, 0.0]
    carry = odometry().carry(steps)
    assert carry.resisted_N == 0.0
    assert carry.problems == ()


def test_fingertips_that_press_little_for_what_they_push_are_not_believed_to_stick():
    """0.9 N are no jam, but 0.3 N a fingertip hardly hold against them."""
    firm, light = (carried(BOX, object_motion=TURN, palm_motion=TURN) for _ in range(2))
    for steps in (firm, light):
        steps.net_forces_N[:] = [0.9, 0.0, 0.0]
    light.forces_N[:] *= 0.3
    assert odometry().carry(light).resisted_N == 0.0
    assert odometry().carry(light).sigma.rotation_rad > odometry().carry(firm).sigma.rotation_rad + 0.1 * TURN.theta()


def test_a_jam_is_told_of_few_steps_and_what_is_around_them_is_not_believed():
    steps = carried(BOX, object_motion=TURN, palm_motion=TURN)
    sure = odometry().carry(steps).sigma
    steps.net_forces_N[50:53] = [3.0, 0.0, 0.0]
    jammed = odometry().carry(steps)
    assert jammed.resisted_N == pytest.approx(3.0)
    assert jammed.sigma.rotation_rad > sure.rotation_rad + 0.04 * TURN.theta()


def test_what_is_not_known_of_a_turn_moves_the_objects_middle():
    """It turns about the middle of its contacts; the fewer hold it, the less is known of that."""
    few, all_five = (
        odometry().carry(carried(DISC, object_motion=TURN, palm_motion=TURN, felt=felt)).sigma for felt in _HOLDS
    )
    assert few.translation_m > 0.01 * few.rotation_rad
    assert few.translation_m > all_five.translation_m


@pytest.mark.parametrize("upward_N", [1.0, -1.0])
def test_what_the_fingertips_hold_up_or_press_down_may_roll_when_it_is_let_go_of(upward_N):
    steps = carried(BOX, object_motion=TURN, palm_motion=TURN)
    flat = odometry().carry(steps).sigma
    steps.net_forces_N[:, 2] = upward_N
    assert odometry().carry(steps).sigma.translation_m > flat.translation_m + 1.5e-4


def test_fingers_that_feel_nothing_go_on_closing_and_may_push_the_object():
    """Though the hand itself hardly moves."""
    carry = odometry().carry(carried(BOX, object_motion=Pose2(), palm_motion=Pose2(), felt=("TH",)))
    assert carry.sigma.translation_m > 0.5 * 0.008 * carry.single_s
    assert carry.sigma.rotation_rad > 0.5 * 0.008 * carry.single_s / 0.04


def test_a_fingertip_that_sinks_in_does_not_drag_the_object():
    """The thumb presses twice as hard and gives, 0.3 mm for each e-fold; joints move so far, the box does not."""
    steps = carried(BOX, object_motion=Pose2(), palm_motion=Pose2())
    thumb, grown = FINGERS.index("TH"), np.log(2.0)
    steps.sinking[:, thumb] = grown / len(steps)
    steps.moves_m[:, thumb] -= steps.normals[:, thumb] * 0.0003 * grown / len(steps)
    assert error(odometry().carry(steps), Pose2())[0] < 0.01
    steps.sinking[:] = 0.0
    assert error(odometry().carry(steps), Pose2())[0] > 0.03


def test_an_object_that_is_let_go_under_force_is_less_certain():
    firm, eased = (carried(BOX, object_motion=TURN, palm_motion=TURN) for _ in range(2))
    eased.forces_N[-1] *= 0.3
    assert odometry().carry(eased).sigma.rotation_rad < odometry().carry(firm).sigma.rotation_rad


def test_links_that_push_show_in_the_net_force_and_in_the_noise():
    steps = carried(BOX, object_motion=TURN, palm_motion=TURN)
    alone = odometry().carry(steps).sigma
    steps.net_forces_N[:] = [1.2, 0.0, 0.0]
    pushed = odometry().carry(steps).sigma
    assert pushed.translation_m > 1.2 * alone.translation_m
    assert pushed.rotation_rad > alone.rotation_rad


def test_contacts_that_slide_tell_the_edge_of_the_cone():
    steps = carried(BOX, object_motion=Pose2(), palm_motion=Pose2())
    steps.moves_m[:, 0, 0] = 0.02 * steps.step_s
    steps.tangential_N[:, 0] = 0.9
    np.testing.assert_allclose(odometry().carry(steps).sliding, 0.9)


def test_two_assumptions_that_differ_widen_the_noise():
    sure = odometry().carry(carried(BOX, object_motion=TURN, palm_motion=TURN))
    steps = carried(BOX, object_motion=TURN, palm_motion=TURN, felt=("FF", "TH"))
    steps.forces_N[:] *= 2.5  # two press as hard as five: the opening hand does the same to the object
    spread = odometry().carry(steps)
    assert spread.sigma.rotation_rad >= sure.sigma.rotation_rad


def test_the_foot_is_as_large_as_the_contacts_are_apart():
    small, large = odometry(), odometry()
    small._spans_m, large._spans_m = [0.02], [0.12]
    assert small.friction.foot_m < odometry().friction.foot_m < large.friction.foot_m


@pytest.mark.parametrize("count", [1, 2, 7, 64])
def test_steps_compose_as_one_after_the_other(count):
    rng = np.random.default_rng(count)
    motions, centres = rng.normal(size=(count, 3)) * 0.01, rng.normal(size=(count, 2)) * 0.1
    expected = np.eye(3)
    for motion, centre in zip(motions, centres, strict=True):
        cosine, sine = np.cos(motion[2]), np.sin(motion[2])
        turn = np.array([[cosine, -sine], [sine, cosine]])
        step = np.eye(3)
        step[:2, :2] = turn
        step[:2, 2] = centre + motion[:2] / 2 - turn @ (centre - motion[:2] / 2)
        expected = step @ expected
    np.testing.assert_allclose(compose_steps(motions, centres), expected, atol=1e-12)


def test_the_same_steps_give_the_same_carry_bit_for_bit():
    steps = carried(BOX, object_motion=TURN, palm_motion=TURN)
    assert odometry().carry(steps).sigma == odometry().carry(steps).sigma
    assert steps_of(BOX, 3).points_m.shape == (3, 5, 3)
