"""Taps on the top: on a world without physics, and what Perception makes of them."""

from __future__ import annotations

import numpy as np
import pytest

from drivers.core.contacts import FINGERS, Array, Grasp
from drivers.shadow.closing.closing import closing, sideways
from drivers.shadow.closing.posture import HandShape
from drivers.shadow.closing.tip_motion import motor_rates
from drivers.shadow.model.kinematics import joint_vector, palm_T_distal_matrices
from sessions.motion.cycle_settings import CycleSettings
from sessions.motion.grasp_cycle import GraspCycle
from sessions.motion.grasp_frame import GraspFrame
from sessions.motion.grasp_plan import GraspPlan, TouchPlace
from sessions.motion.motion import Motion
from sessions.motion.probing.lane import Lane
from sessions.motion.probing.touch_patterns import COLUMN, TAP, TAP_HEIGHT_m, lowest_ahead
from sessions.motion.probing.touching import Toucher
from sessions.motion.safety import SafetySettings, SafetySupervisor
from sessions.recording.session_events import EventKind
from tactile_lab.autonomy.heuristic_planner import HeuristicPlanner, PlanSettings, contact_centre
from tactile_lab.slam.tracking.contacts.contact_set import ContactSet
from tests.support.disc_world import Disc, DiscWorld, TIP_CENTRE_m

TIP = HandShape((0.0085, 0.0085, 0.0085), tuple(TIP_CENTRE_m))
QUICK = CycleSettings(finger_rad_s=20.0, travel_m_s=1.0, turn_rad_s=5.0)
LONG_FINGERS = ("FF", "MF", "RF", "LF")


def disc(height_m: float = 0.04, radius_m: float = 0.05) -> Disc:
    return Disc(np.zeros(2), radius_m=radius_m, height_m=height_m)


def motion_on(world: DiscWorld) -> Motion:
    supervisor = SafetySupervisor(world, SafetySettings(), world.cycle_ns)
    supervisor.on_approach()
    return Motion(world, supervisor)  # type: ignore[arg-type]


def grasp_with_tap(world: DiscWorld) -> Grasp:
    """One grasp that begins with a tap."""
    cycle = GraspCycle(motion_on(world), QUICK, TIP)
    assert cycle.descend(GraspPlan(GraspFrame(0.0, 0.0, 0.3), "pinch", 0.022, tap=True))
    cycle.close()
    cycle.settle()
    return cycle.capture()


@pytest.mark.parametrize("height_m", [0.03, 0.05, 0.07])
def test_a_tap_finds_the_top_with_several_fingers(height_m: float) -> None:
    world = DiscWorld(disc(height_m))
    felt = Toucher(motion_on(world), QUICK, TIP).tap(GraspFrame(0.0, 0.0, 0.0))
    assert len(felt) >= 4
    np.testing.assert_allclose(felt[:, 2], height_m, atol=3e-3)
    grasp = grasp_with_tap(world)
    probed = [contact for contact in grasp.contacts if contact.probed]
    assert {contact.finger for contact in probed} >= {"FF", "MF", "RF", "LF"}
    for contact in probed:
        assert contact.point_world_m[2] == pytest.approx(height_m, abs=2e-3)
        assert contact.normal_world[2] > 0.99


def test_probed_contacts_stand_behind_those_of_the_closing() -> None:
    grasp = grasp_with_tap(DiscWorld(disc(radius_m=0.035)))
    flags = [contact.probed for contact in grasp.contacts]
    assert flags == sorted(flags)
    assert grasp.touching == frozenset(contact.finger for contact in grasp.contacts if not contact.probed)
    assert len(grasp.touching) >= 4
    assert sum(flags) >= 1


def test_a_tap_tells_where_the_contacts_are_not_how_far_fingertips_reach_down() -> None:
    """A rim meets a fingertip's side: the top of a bowl of 52 mm was taken for 41 mm."""
    world = DiscWorld(disc())
    felt = Toucher(motion_on(world), QUICK, TIP).tap(GraspFrame(0.0, 0.0, 0.0))
    np.testing.assert_array_equal(felt, [contact.point_world_m for contact in world.perception.probed])


def test_a_tap_beside_the_object_meets_nothing_and_the_hand_rises_again() -> None:
    world = DiscWorld(None)
    motion = motion_on(world)
    assert len(Toucher(motion, QUICK, TIP).tap(GraspFrame(0.0, 0.0, 0.0))) == 0
    table = closing(TAP.closing, TAP_HEIGHT_m, TIP)
    lowest_m = QUICK.touch.lowest_m + TIP.semi_axes_m[2] - TAP_HEIGHT_m
    above = motion.base_joints(GraspFrame(0.0, 0.0, 0.0), table, lowest_m + QUICK.lift_m)
    np.testing.assert_allclose(world.base_q, above, atol=1e-6)


def test_a_touch_alone_gives_probed_contacts_and_needs_no_closing() -> None:
    world = DiscWorld(disc(0.05))
    motion = motion_on(world)
    motion.tallest_m = 0.05
    cycle = GraspCycle(motion, QUICK, TIP)
    assert cycle.descend(GraspPlan(GraspFrame(0.0, 0.0, 0.3), TAP.closing, TAP_HEIGHT_m, only_touch=True))
    grasp = cycle.capture()
    assert grasp.touching == frozenset()
    assert len(grasp.contacts) >= 4
    assert all(contact.probed for contact in grasp.contacts)


def test_a_touch_alone_looks_no_deeper_than_the_knuckles_allow() -> None:
    world = DiscWorld(None)
    motion = motion_on(world)
    motion.tallest_m = 0.10
    Toucher(motion, QUICK, TIP).tap(GraspFrame(0.0, 0.0, 0.0), below_top_m=0.03)
    table = closing(TAP.closing, TAP_HEIGHT_m, TIP)
    lowest_m = 0.07 + TIP.semi_axes_m[2] - TAP_HEIGHT_m
    above = motion.base_joints(GraspFrame(0.0, 0.0, 0.0), table, lowest_m + QUICK.lift_m)
    np.testing.assert_allclose(world.base_q, above, atol=1e-6)


def test_taps_are_gentle() -> None:
    most = 0.0

    def listen(world: DiscWorld) -> None:
        nonlocal most
        if world.session_events:
            most = max(most, max(world.load_N(finger) for finger in FINGERS))

    world = DiscWorld(disc(), before_cycle=listen)
    Toucher(motion_on(world), QUICK, TIP).tap(GraspFrame(0.0, 0.0, 0.0))
    assert 0.2 < most < 1.5


def test_a_hand_that_waited_for_a_pressed_finger_goes_on_from_there(monkeypatch: pytest.MonkeyPatch) -> None:
    """A target that had gone on meanwhile would be a jump onto the stiff thumb, by millimetres in one cycle."""
    heights: list[float] = []
    pressed = [5.0] * 8 + [0.0] * 1000
    world = DiscWorld(disc())
    motion = motion_on(world)
    toucher = Toucher(motion, QUICK, TIP)

    def loads_N() -> dict[str, float]:
        return dict.fromkeys(FINGERS, pressed[min(len(heights) // 2, len(pressed) - 1)])

    def set_base(q: Array) -> None:
        heights.append(float(q[2]))

    table, frame = closing(TAP.closing, TAP_HEIGHT_m, TIP), GraspFrame(0.0, 0.0, 0.0)
    start = float(motion.runtime.perception.hand.base_q[2])
    monkeypatch.setattr(motion, "set_base", set_base)
    monkeypatch.setattr(motion, "loads_N", loads_N)
    monkeypatch.setattr(motion, "tick", lambda: heights.append(heights[-1] if heights else start))
    toucher._lay_on(table, TAP, np.array([0.0, 0.0, -1.0]), frame, 0.35, 0.004)
    steps_m = np.abs(np.diff([start, *heights]))
    usual_m = 2 * 0.004 / motion.cycles(QUICK.touch.press_s)
    assert steps_m.max() < 1.01 * usual_m
    assert abs(heights[-1] - start) > 0.003


def test_fingertips_that_have_felt_nothing_yet_are_laid_on_as_far_as_they_reach(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Towards a force alone they would come a third of the way; towards one that is lost they would push on."""
    motion, set_rad, touch = motion_on(DiscWorld(disc())), {}, QUICK.touch
    loads_N = {"FF": [0.13], "MF": [0.01], "RF": [0.01], "LF": [0.10, 0.05], "TH": [0.0]}
    toucher, towards = Toucher(motion, QUICK, TIP), np.array([0.0, -1.0, 0.0])
    table, cycles = closing(sideways("pinch", "left"), 0.05, TIP), motion.cycles(touch.press_s)
    monkeypatch.setattr(motion, "loads_N", lambda: {finger: felt_N[0] for finger, felt_N in loads_N.items()})
    monkeypatch.setattr(motion, "set_fingers", lambda table, progress, aside: set_rad.update(aside))
    monkeypatch.setattr(motion, "tick", lambda: loads_N.update(LF=loads_N["LF"][-1:]))
    toucher._lay_on(table, COLUMN, towards, GraspFrame(0.0, 0.0, 0.0), touch.rake_N, 0.0)
    followed_m = {finger: touch.gain * (touch.rake_N - loads_N[finger][0]) * touch.press_s for finger in ("FF", "LF")}
    per_m = motor_rates(table, COLUMN.progress, towards, TIP)
    for finger, gone_m in {**followed_m, "MF": touch.reach_m, "RF": touch.reach_m}.items():
        for motor, rate in per_m[finger].items():
            assert set_rad[motor] == pytest.approx(rate * gone_m, rel=3 / cycles)


@pytest.mark.parametrize(("felt_N", "is_laid"), [(0.25, True), (0.0, False)])
def test_no_fingertip_is_laid_on_what_a_link_has_met_alone(
    felt_N: float, is_laid: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Fingers that flex behind such a link would push the object with it."""
    world, table, done = DiscWorld(disc()), closing(sideways("pinch", "left"), 0.05, TIP), []
    toucher = Toucher(motion_on(world), QUICK, TIP)
    lane = Lane(table, lowest_ahead(table, TIP, 0.05), TouchPlace(GraspFrame(0.0, 0.0, 0.0), 0.05), 0.012, 0.02)
    monkeypatch.setattr(toucher, "_approach", lambda *args: True)
    monkeypatch.setattr(toucher, "_lay_on", lambda *args: done.append("laid on"))
    monkeypatch.setattr(toucher._motion, "loads_N", lambda: dict.fromkeys(FINGERS, 0.0) | {"MF": felt_N})
    assert len(toucher._lay_against(lane)) == is_laid
    assert done == ["laid on"] * is_laid
    assert world.session_events[-1] is EventKind.TOUCH_END


def test_one_coming_touches_a_side_at_several_places_and_draws_back_between_them() -> None:
    felt: list[bool] = []

    def listen(world: DiscWorld) -> None:
        if world.session_events:
            felt.append(max(world.load_N(finger) for finger in FINGERS) > 0.05)

    world = DiscWorld(disc(0.15), before_cycle=listen)
    motion = motion_on(world)
    motion.tallest_m = 0.15
    frame = GraspFrame(0.0, 0.05, 0.0)
    places = [TouchPlace(frame.shifted_inside(np.array([x_m, 0.0])), z_m) for x_m, z_m in ((0, 0.05), (0.02, 0.1))]
    touch = Toucher(motion, QUICK, TIP).touch_side(places, "left", 0.1, 0.02)
    assert touch is not None
    np.testing.assert_allclose(np.linalg.norm(touch.points_m[:, :2], axis=1), 0.05, atol=1e-3)
    np.testing.assert_allclose(touch.points_m[:, 2], [0.05, 0.1], atol=2e-3)
    assert np.diff(touch.points_m[:, 0]) == pytest.approx(0.02, abs=5e-3)
    assert np.count_nonzero(np.diff(np.array(felt).astype(int)) == 1) == 2
    assert world.session_events.count(EventKind.TOUCH_END) == 2
    assert world.base_q[2] > motion.base_joints(frame, closing("pinch-from-left", 0.15, TIP))[2]


@pytest.mark.parametrize(("felt_N", "met", "touched"), [(0.2, True, 3), (0.0, True, 1), (0.0, False, 3)])
def test_what_gave_way_when_it_was_touched_is_not_touched_at_further_places(
    felt_N: float, met: bool, touched: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    motion, laid = motion_on(DiscWorld(disc(0.15))), []
    motion.tallest_m, toucher = 0.15, Toucher(motion, QUICK, TIP)

    def lay_against(lane: Lane) -> Array:
        laid.append(lane)
        return np.zeros((int(met), 3))

    monkeypatch.setattr(toucher, "_lay_against", lay_against)
    monkeypatch.setattr(toucher, "_go_along", lambda lane: True)
    monkeypatch.setattr(motion, "loads_N", lambda: dict.fromkeys(FINGERS, felt_N))
    monkeypatch.setattr(toucher.guard, "is_met", lambda: False)
    toucher.touch_side([TouchPlace(GraspFrame(0.0, 0.05, 0.0), 0.05)] * 3, "left", 0.1, 0.02)
    assert len(laid) == touched


def test_what_stands_in_the_way_along_a_side_is_felt_and_the_hand_goes_back_where_it_came_from(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    world = DiscWorld(disc(0.15))
    motion, ways = motion_on(world), []
    motion.tallest_m, toucher = 0.15, Toucher(motion, QUICK, TIP)
    monkeypatch.setattr(toucher, "_go_along", lambda lane: False)
    move_base = motion.move_base
    monkeypatch.setattr(motion, "move_base", lambda q, *speeds: (ways.append(q), move_base(q, *speeds)))
    places = [TouchPlace(GraspFrame(x_m, -0.03, 0.0), 0.05) for x_m in (-0.09, 0.03, 0.06)]
    touch = toucher.touch_side(places, "left", 0.1, 0.02)
    assert world.session_events.count(EventKind.TOUCH_END) == 2
    assert touch is not None
    on_way = [contact for contact in motion.runtime.perception.probed if contact.normal_world[0] < -0.7]
    assert on_way
    assert min(contact.force_N for contact in on_way) > 0.15
    table = closing("pinch-from-left", 0.05, TIP)
    first_m, second_m = (motion.base_joints(each.frame, table, 0.0, 0.1)[0] for each in places[:2])
    assert abs(ways[-1][0] - first_m) < abs(ways[-1][0] - second_m)


@pytest.mark.parametrize("met", [("links",), ("FF",)])
def test_a_link_that_met_something_along_a_side_is_not_pressed_against_it(
    met: tuple[str, ...], monkeypatch: pytest.MonkeyPatch
) -> None:
    motion, laid_on = motion_on(DiscWorld(None)), []
    toucher, place = Toucher(motion, QUICK, TIP), TouchPlace(GraspFrame(0.1, 0.05, 0.0), 0.05)
    table = closing("pinch-from-left", 0.05, TIP)
    monkeypatch.setattr(toucher.guard, "is_met", lambda: True)
    monkeypatch.setattr(toucher.guard, "restart", lambda: None)
    monkeypatch.setattr(toucher.guard, "met", met)
    monkeypatch.setattr(toucher, "_lay_on", lambda *given: laid_on.append(given))
    before = motion.runtime.perception.hand.base_q.copy()
    toucher._meet_again(Lane(table, lowest_ahead(table, TIP, 0.05), place, 0.012, 0.02))
    assert len(laid_on) == (met == ("FF",))
    np.testing.assert_allclose(motion.runtime.perception.hand.base_q, before, atol=1e-3)


@pytest.mark.parametrize("met", [("links",), ("FF",)])
def test_where_a_link_stands_on_the_object_no_fingertip_is_laid_on(
    met: tuple[str, ...], monkeypatch: pytest.MonkeyPatch
) -> None:
    toucher, laid_on = Toucher(motion_on(DiscWorld(disc())), QUICK, TIP), []
    monkeypatch.setattr(toucher.guard, "is_met", lambda: True)
    monkeypatch.setattr(toucher.guard, "restart", lambda: None)
    monkeypatch.setattr(toucher.guard, "met", met)
    monkeypatch.setattr(toucher, "_lay_on", lambda *_, leans: laid_on.append(leans))
    toucher.tap(GraspFrame(0.0, 0.0, 0.0), below_top_m=0.03)
    assert laid_on == ([toucher.guard.leans] if met == ("FF",) else [])
    toucher.tap(GraspFrame(0.0, 0.0, 0.0))
    assert laid_on[-1] == toucher.guard.leans_hard


@pytest.mark.parametrize(("met", "higher_m"), [(("links",), 0.05), (("links", "FF"), 0.0), (("FF",), 0.0)])
def test_what_a_link_met_first_may_be_higher_than_what_fingertips_felt(
    met: tuple[str, ...], higher_m: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    motion = motion_on(DiscWorld(disc()))
    toucher = Toucher(motion, QUICK, TIP)
    monkeypatch.setattr(toucher.guard, "met", met)
    toucher.on_top(0.03)
    assert motion.tallest_m == pytest.approx(0.03 + higher_m)


def test_a_tap_tells_what_it_met_even_where_the_hand_has_drawn_back_since(monkeypatch: pytest.MonkeyPatch) -> None:
    toucher = Toucher(motion_on(DiscWorld(disc(0.05))), QUICK, TIP)
    monkeypatch.setattr(toucher, "_lay_on", lambda *_, leans: toucher._motion.rise(0.05, 1.0))
    felt = toucher.tap(GraspFrame(0.0, 0.0, 0.0))
    assert len(felt) >= 1
    np.testing.assert_allclose(felt[:, 2], 0.05, atol=3e-3)


@pytest.mark.parametrize(("for_cycles", "higher"), [(0, -1), (1, 0), (1000, 1)])
def test_a_hand_whose_link_leans_on_something_draws_back_until_it_leans_no_more_and_sinks_no_more(
    monkeypatch: pytest.MonkeyPatch, for_cycles: int, higher: int
) -> None:
    world = DiscWorld(None)
    motion = motion_on(world)
    toucher, leans = Toucher(motion, QUICK, TIP), iter([False] * 2 + [True] * for_cycles + [False] * 1000)
    start_m = float(world.base_q[2])
    table, frame = closing(TAP.closing, TAP_HEIGHT_m, TIP), GraspFrame(0.0, 0.0, 0.0)
    toucher._lay_on(table, TAP, np.array([0.0, 0.0, -1.0]), frame, 0.35, 0.004, leans=lambda: next(leans))
    assert round((float(world.base_q[2]) - start_m) / 0.004) == higher


def test_contacts_probed_before_the_object_was_carried_are_forgotten() -> None:
    world = DiscWorld(disc(radius_m=0.035))
    Toucher(motion_on(world), QUICK, TIP).tap(GraspFrame(0.0, 0.0, 0.0))
    world.begin_hold()
    world.end_hold()
    world.begin_capture()
    world.cycle()
    assert not any(contact.probed for contact in world.end_capture().contacts)


def test_ways_of_a_tap_are_free_space_in_the_estimation_of_a_surface_only() -> None:
    grasp = grasp_with_tap(DiscWorld(disc()))
    points = [contact.point_world_m for contact in grasp.contacts if contact.probed]
    assert len(ContactSet.of_grasp(grasp, 3, 0.0)) == len(grasp.contacts)
    flat = ContactSet.of_grasp(grasp, 2, 0.0)
    assert len(flat) == len(grasp.contacts) - len(points)
    assert len(flat.free_m) == 0 or np.linalg.norm(flat.free_m, axis=1).min() > 0.04  # none over the object


def test_middle_of_the_object_is_told_by_the_closing_alone() -> None:
    world = DiscWorld(disc(radius_m=0.035))
    plan = GraspPlan(GraspFrame(0.0, 0.0, 0.3), "pinch", 0.022, tap=True)
    grasp = grasp_with_tap(world)
    np.testing.assert_allclose(contact_centre(grasp, plan), [0.0, 0.0], atol=8e-3)


def test_every_second_grasp_taps_where_a_surface_is_wanted() -> None:
    rng = np.random.default_rng(0)
    assert [HeuristicPlanner(PlanSettings(), rng, 3).taps(index) for index in range(4)] == [True, False, True, False]
    assert not any(HeuristicPlanner(PlanSettings(), rng, 2).taps(index) for index in range(4))
    assert not any(HeuristicPlanner(PlanSettings(tap_every=0), rng, 3).taps(index) for index in range(4))


def tips_m(angles_rad: dict[str, float]) -> Array:
    """Tip centres in the grasp frame of the tap's closing, shape (5, 3)."""
    table = closing(TAP.closing, TAP_HEIGHT_m)
    frames = table.grasp_T_palm.matrix() @ palm_T_distal_matrices(joint_vector(angles_rad))
    return np.asarray((frames @ np.append(HandShape().centre_distal_m, 1.0))[:, :3])


def test_fingertips_move_where_the_rates_say() -> None:
    table, down = closing(TAP.closing, TAP_HEIGHT_m), np.array([0.0, 0.0, -1.0])
    angles = {name: a for finger in FINGERS for name, a in table.angles_rad(finger, TAP.progress[finger]).items()}
    moved, way_m = dict(angles), 0.004
    for motors in motor_rates(table, TAP.progress, down, HandShape()).values():
        for motor, rate in motors.items():
            pair = {f"{motor[:2]}J1": 0.375, f"{motor[:2]}J2": 0.625} if motor.endswith("J0") else {motor: 1.0}
            for joint, share in pair.items():
                moved[joint] += share * rate * way_m
    gone_m = (tips_m(moved) - tips_m(angles))[:4]
    np.testing.assert_allclose(gone_m, np.tile(way_m * down, (4, 1)), atol=1e-3)


@pytest.mark.parametrize(
    ("side", "up_to_m", "ahead"), [("left", 0.045, "FF MF"), ("left", 0.0, "FF"), ("right", 0.045, "LF")]
)
def test_the_lowest_fingertips_of_a_column_are_ahead_of_the_others(side: str, up_to_m: float, ahead: str) -> None:
    height_m = {"left": 0.020, "right": 0.032}[side]
    table = closing(sideways(COLUMN.closing, side), height_m, HandShape())
    column = lowest_ahead(table, HandShape(), up_to_m)
    angles = {name: a for finger in FINGERS for name, a in table.angles_rad(finger, COLUMN.progress[finger]).items()}
    moved = dict(angles)
    for motor, more_rad in column.aside(table).items():
        pair = {f"{motor[:2]}J1": 0.375, f"{motor[:2]}J2": 0.625} if motor.endswith("J0") else {motor: 1.0}
        for joint, share in pair.items():
            moved[joint] += share * more_rad
    way = table.grasp_T_palm.rotation().matrix().T @ np.array(table.approach)
    centre_m = np.append(HandShape().centre_distal_m, 1.0)
    before, after = (palm_T_distal_matrices(joint_vector(each)) @ centre_m for each in (angles, moved))
    forward_m = (after - before)[:4, :3] @ way
    behind = [finger not in ahead.split() for finger in LONG_FINGERS]
    np.testing.assert_allclose(forward_m, np.where(behind, -0.010, 0.0), atol=2e-3)


def test_thumb_is_not_moved_up_and_down() -> None:
    rates = motor_rates(closing(TAP.closing, TAP_HEIGHT_m), TAP.progress, np.array([0.0, 0.0, -1.0]), HandShape())
    assert rates["TH"] == {}
    assert all(rates[finger] for finger in LONG_FINGERS)


def test_marks_of_a_tap() -> None:
    world = DiscWorld(disc())
    Toucher(motion_on(world), QUICK, TIP).tap(GraspFrame(0.0, 0.0, 0.0))
    assert world.session_events == [EventKind.TARE, EventKind.CLOSE_BEGIN, EventKind.CAPTURE_BEGIN, EventKind.TOUCH_END]
