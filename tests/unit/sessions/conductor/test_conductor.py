"""The conductor on a world without physics: order of the verbs, endings, failures, and what is told."""

from __future__ import annotations

import os
import signal
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from gtsam import Pose3, Rot3

from drivers.core.configuration import validate
from drivers.core.contacts import Contact, Grasp
from drivers.core.errors import ConfigurationError, DeviceError, TactileLabError
from drivers.shadow.closing.closing import closing
from sessions.conductor.conductor import Conductor
from sessions.conductor.decisions import AutonomousDecisions, Decision, End, Pause, UndoGrasp, Veto
from sessions.conductor.estimator import Reorientation
from sessions.conductor.estimator_client import EstimatorClient
from sessions.conductor.progress import GraspReport, NullProgress
from sessions.conductor.session_outcome import Ending, SessionOutcome
from sessions.motion.grasp_frame import GraspFrame
from sessions.motion.grasp_plan import GraspPlan
from sessions.recording.recorder import Level
from sessions.recording.session_events import EventKind
from tactile_lab.autonomy.autonomous_roles import autonomous_roles
from tactile_lab.autonomy.heuristic_planner import HeuristicPlanner, PlanSettings, contact_centre
from tactile_lab.autonomy.settings import SessionSettings
from tactile_lab.autonomy.variance_planner import closing_rays
from tactile_lab.slam.tactile_slam import SlamSettings, TactileSlam
from tests.support.disc_world import Disc, DiscWorld


class Watcher(NullProgress):
    """Keeps everything it is told."""

    def __init__(self) -> None:
        self.phases: list[str] = []
        self.reports: list[GraspReport] = []
        self.messages: list[str] = []

    def phase(self, number: int, name: str) -> None:
        self.phases.append(name)

    def grasp_done(self, report: GraspReport) -> None:
        self.reports.append(report)

    def on_message(self, message: str) -> None:
        self.messages.append(message)

    def on_interrupt(self) -> None:
        self.messages.append(f"interrupted in {self.phases[-1]}")


def settings(grasps: int = 2, **overrides: Any) -> SessionSettings:
    quick = {"landing_force_N": 0.25, "squeeze_s": 0.1, "finger_rad_s": 20.0, "travel_m_s": 1.0, "turn_rad_s": 5.0}
    plain = {"exploration": {"policy": None}, "fixed_grasps": grasps, "probing": {"top": False}}
    content = {"grasps": grasps, "cycle": quick, **plain, **overrides}
    return validate(content, SessionSettings, where="test")


def run(world: DiscWorld, grasps: int = 2, watcher: Watcher | None = None, **overrides: Any) -> SessionOutcome:
    slam = TactileSlam(SlamSettings(particles=200), seed=1)
    wanted = settings(grasps, **overrides)
    roles = autonomous_roles(world, slam, wanted, seed=3)  # type: ignore[arg-type]
    return Conductor(world, wanted, roles, watcher or Watcher()).run()  # type: ignore[arg-type]


def disc(x: float = 0.005, y: float = -0.004, **shape: float) -> Disc:
    return Disc(np.array([x, y]), **shape)


def test_session_runs_to_its_end_and_touches_with_most_fingers() -> None:
    world = DiscWorld(disc())
    outcome = run(world, grasps=3)
    assert outcome.ending is Ending.COMPLETE
    assert outcome.reason == "3 grasps done"
    assert [grasp.index for grasp in outcome.grasps] == [0, 1, 2]
    assert all(len(grasp.contacts) >= 4 for grasp in outcome.grasps)


def test_contacts_lie_on_the_disc() -> None:
    target = disc()
    outcome = run(DiscWorld(target), grasps=1)
    for contact in outcome.grasps[0].contacts:
        assert np.linalg.norm(contact.point_world_m[:2] - target.centre_m) == pytest.approx(0.033, abs=0.003)


def test_marks_come_in_the_order_of_the_cycle() -> None:
    world = DiscWorld(disc())
    run(world, grasps=2)
    carried = [EventKind.HOLD_BEGIN, EventKind.HOLD_END]
    closed = [EventKind.TARE, EventKind.CLOSE_BEGIN]
    measured = [*closed, EventKind.CAPTURE_BEGIN, EventKind.CAPTURE_END, EventKind.TRUTH_FRAME]
    assert world.session_events == [*measured, *carried, *measured]  # nothing is carried after the last grasp


def test_verbs_come_in_the_order_of_the_cycle() -> None:
    watcher = Watcher()
    run(DiscWorld(disc()), grasps=2, watcher=watcher)
    first = ["descend", "close", "capture", "squeeze", "re-orient", "release", "lift", "estimate"]
    assert watcher.phases[:8] == first
    assert watcher.phases[8:] == ["descend", "close", "capture", "release", "lift", "estimate"]


def test_an_object_that_is_to_stay_is_let_go_where_it_is() -> None:
    world, watcher, wanted = DiscWorld(disc()), Watcher(), settings(2)
    roles = autonomous_roles(world, TactileSlam(SlamSettings(particles=200), seed=1), wanted, seed=3)  # type: ignore[arg-type]
    outcome = Conductor(world, wanted, replace(roles, decisions=Leaving(roles.estimator)), watcher).run()  # type: ignore[arg-type]
    grasp = ["descend", "close", "capture", "release", "lift", "estimate"]
    assert watcher.phases == [*grasp, *grasp]
    assert EventKind.HOLD_BEGIN not in world.session_events
    assert outcome.grasps[1].hand_motion_world.equals(Pose3(), 1e-12)


def test_hand_motion_carries_the_object_and_goes_into_the_next_grasp() -> None:
    target = disc()
    start_m = target.centre_m.copy()
    outcome = run(DiscWorld(target), grasps=2)
    motion = outcome.grasps[1].hand_motion_world
    moved_m = np.asarray(motion.transformFrom(np.array([*start_m, 0.0])))[:2]
    np.testing.assert_allclose(moved_m, target.centre_m, atol=2e-3)
    assert 0.2 < abs(motion.rotation().yaw()) < 0.8


def test_thumb_holds_against_the_fingers() -> None:
    """Fingers at the squeeze force, the thumb at the sum of what they push along the hand's axis."""
    loads: list[dict[str, float]] = []

    def listen(world: DiscWorld) -> None:
        if world.session_events and world.session_events[-1] is EventKind.HOLD_BEGIN:
            loads.append(world.perception.loads_N())

    run(DiscWorld(disc(), before_cycle=listen), grasps=2, cycle={"squeeze_force_N": 0.5, "squeeze_s": 1.0})
    held = loads[0]
    for finger in ("FF", "MF", "RF", "LF"):
        assert held[finger] == pytest.approx(0.5, abs=0.1) or held[finger] == 0.0
    pushing = sum(held[finger] > 0 for finger in ("FF", "MF", "RF", "LF"))
    assert held["TH"] == pytest.approx(0.5 * pushing, rel=0.25)


def test_object_is_brought_back_toward_the_middle() -> None:
    target = disc(0.03, 0.02)
    run(DiscWorld(target), grasps=3)
    assert np.linalg.norm(target.centre_m) < 0.02


def test_report_tells_contacts_forces_and_uncertainty() -> None:
    watcher = Watcher()
    run(DiscWorld(disc()), grasps=2, watcher=watcher)
    assert [report.number for report in watcher.reports] == [1, 2]
    report = watcher.reports[0]
    assert report.planned == 2
    assert report.contacts >= 4
    assert all(force_N > 0.1 for force_N in report.forces_N.values())
    assert set(report.forces_N) | set(report.missing) == {"FF", "MF", "RF", "LF", "TH"}
    assert report.position_sigma_m is not None
    assert report.verdict.startswith("first")
    assert report.explored is not None
    assert 0.0 <= report.explored <= 1.0


def test_empty_table_ends_the_session_with_a_reason() -> None:
    watcher = Watcher()
    outcome = run(DiscWorld(None), grasps=9, watcher=watcher)
    assert outcome.ending is Ending.OBJECT_LOST
    assert outcome.reason.startswith("no contact in 3 grasps in a row; nothing was touched.")
    assert len(outcome.grasps) == 3
    assert "squeeze" not in watcher.phases  # nothing to hold
    assert watcher.reports[0].verdict == "untracked: 0 contacts, the object frame needs 3"


def test_landing_on_the_object_shifts_the_grasp_toward_the_finger_that_landed() -> None:
    watcher = Watcher()
    world = DiscWorld(disc(0.06, -0.055))
    outcome = run(world, grasps=1, watcher=watcher)
    assert outcome.ending is Ending.COMPLETE
    assert watcher.reports[0].landings >= 1
    assert world.event_counts[EventKind.TARE] == 1 + watcher.reports[0].landings


def test_no_way_down_ends_the_session() -> None:
    watcher = Watcher()
    outcome = run(DiscWorld(disc(radius_m=0.2)), grasps=3, watcher=watcher)
    assert outcome.ending is Ending.OBJECT_LOST
    assert outcome.reason.startswith("could not reach the table: 6 approaches were blocked; fingertips landed over ")
    assert outcome.grasps == ()
    assert watcher.messages[0] == "the hand landed on the object 4 times: trying another grasp"


def test_object_far_away_ends_the_session() -> None:
    outcome = run(DiscWorld(disc(0.20, 0.0)), grasps=4, plan={"start_m": (0.2, 0.0)}, safety={"object_radius_m": 0.1})
    assert outcome.ending is Ending.OBJECT_LOST
    assert "20 cm from the workspace centre" in outcome.reason


def test_stop_after_every_ending() -> None:
    world = DiscWorld(disc())
    run(world, grasps=1)
    assert world.hand.stops == 1
    assert world.base.stops == 1


def test_too_much_force_stops_the_rig_and_keeps_the_grasps() -> None:
    def press(world: DiscWorld) -> None:
        if EventKind.HOLD_BEGIN in world.session_events and world.disc is not None:
            world.disc.radius_m = 0.06

    world = DiscWorld(disc(), before_cycle=press)
    outcome = run(world, grasps=3)
    assert outcome.ending is Ending.STOPPED
    assert "fingertip force" in outcome.reason
    assert len(outcome.grasps) == 1
    assert outcome.error is not None
    assert outcome.error.exit_code == 1
    assert world.hand.stops == 1


def test_silent_hand_stops_the_rig() -> None:
    def cut(world: DiscWorld) -> None:
        world.silent = world.cycles > 100

    outcome = run(DiscWorld(disc(), before_cycle=cut))
    assert outcome.ending is Ending.STOPPED
    assert outcome.reason.startswith("hand: no new status for 2510 ms")


def test_a_hand_that_is_silent_for_a_moment_costs_the_session_that_time_and_no_more() -> None:
    def cut(world: DiscWorld) -> None:
        world.silent = 100 < world.cycles <= 200

    whole, interrupted = DiscWorld(disc()), DiscWorld(disc(), before_cycle=cut)
    outcomes = [run(world, grasps=1) for world in (whole, interrupted)]
    assert [outcome.ending for outcome in outcomes] == [Ending.COMPLETE] * 2
    assert len({outcome.grasps[0].touching for outcome in outcomes}) == 1
    assert 90 <= interrupted.cycles - whole.cycles <= 100


def test_failing_device_stops_the_rig_and_is_told_once() -> None:
    def fail(world: DiscWorld) -> None:
        if world.cycles > 100:
            raise DeviceError("link is down", where="base")

    world = DiscWorld(disc(), before_cycle=fail)
    outcome = run(world)
    assert outcome.ending is Ending.STOPPED
    assert outcome.reason == "base: link is down"
    assert world.hand.stops == 1


def test_programming_errors_stop_the_rig_and_are_not_hidden() -> None:
    def fail(world: DiscWorld) -> None:
        if world.cycles == 100:
            raise RuntimeError("mistake")

    world = DiscWorld(disc(), before_cycle=fail)
    with pytest.raises(RuntimeError, match="mistake"):
        run(world)
    assert world.hand.stops == 1


def test_one_interrupt_finishes_the_step_and_ends_the_session() -> None:
    def interrupt(world: DiscWorld) -> None:
        if world.session_events and world.session_events[-1] is EventKind.CAPTURE_BEGIN:
            world.before_cycle = None
            os.kill(os.getpid(), signal.SIGINT)

    watcher = Watcher()
    outcome = run(DiscWorld(disc(), before_cycle=interrupt), grasps=5, watcher=watcher)
    assert outcome.ending is Ending.INTERRUPTED
    assert len(outcome.grasps) == 1  # the capture is finished, kept and estimated
    assert watcher.phases[-4:] == ["capture", "release", "lift", "estimate"]
    assert watcher.messages == ["interrupted in capture"]


def test_interrupt_before_the_capture_lets_go_without_a_grasp() -> None:
    def interrupt(world: DiscWorld) -> None:
        if world.session_events == [EventKind.TARE]:
            world.before_cycle = None
            os.kill(os.getpid(), signal.SIGINT)

    watcher = Watcher()
    outcome = run(DiscWorld(disc(), before_cycle=interrupt), watcher=watcher)
    assert outcome.ending is Ending.INTERRUPTED
    assert outcome.grasps == ()
    assert watcher.phases[-1] == "lift"


def test_interrupt_while_the_next_grasp_is_thought_of_ends_without_it() -> None:
    """As at the question of --confirm, which the planner's answer is taken for here."""

    class Interrupted(AutonomousDecisions):
        def prepare(self, index: int) -> None:
            super().prepare(index)
            if index == 1:
                os.kill(os.getpid(), signal.SIGINT)

    world, wanted = DiscWorld(disc()), settings(5)
    roles = autonomous_roles(world, TactileSlam(SlamSettings(particles=200), seed=1), wanted)  # type: ignore[arg-type]
    roles = replace(roles, decisions=Interrupted(roles.estimator))
    outcome = Conductor(world, wanted, roles).run()  # type: ignore[arg-type]
    assert (outcome.ending, len(outcome.grasps)) == (Ending.INTERRUPTED, 1)
    assert world.event_counts[EventKind.CAPTURE_END] == 1


def test_two_interrupts_stop_at_once() -> None:
    def interrupt(world: DiscWorld) -> None:
        if world.cycles in (200, 201):
            os.kill(os.getpid(), signal.SIGINT)

    world = DiscWorld(disc(), before_cycle=interrupt)
    with pytest.raises(KeyboardInterrupt):
        run(world, grasps=5)
    assert world.hand.stops == 1
    assert world.cycles < 210


def test_session_limit_ends_between_grasps() -> None:
    outcome = run(DiscWorld(disc()), grasps=9, safety={"session_limit_s": 5.0})
    assert outcome.ending is Ending.LIMIT
    assert 0 < len(outcome.grasps) < 9


def test_same_seed_same_session() -> None:
    first, second = (run(DiscWorld(disc()), grasps=2).grasps for _ in range(2))
    np.testing.assert_array_equal(first[1].points_world_m, second[1].points_world_m)


def test_estimate_chooses_after_the_fixed_grasps() -> None:
    watcher = Watcher()
    outcome = run(DiscWorld(disc()), grasps=3, watcher=watcher, fixed_grasps=2)
    assert outcome.ending is Ending.COMPLETE
    assert [report.reason.split()[0] for report in watcher.reports[:2]] == ["alternating", "alternating"]
    assert "contacts expected" in watcher.reports[2].reason
    assert len(outcome.grasps[2].contacts) >= 3


# --- the fixed rule ----------------------------------------------------------------------------------------------


def rule(**content: Any) -> HeuristicPlanner:
    return HeuristicPlanner(validate(content, PlanSettings, where="test"), np.random.default_rng(0))


def test_fixed_rule_alternates_sides_closings_and_heights() -> None:
    plans = [rule(contour_heights_m=(0.018, 0.03)).plan(index) for index in range(8)]
    assert [plan.closing for plan in plans] == ["radial", "radial", "pinch", "pinch"] * 2
    assert [plan.frame.yaw_rad > 0 for plan in plans] == [False, True] * 4
    assert [plan.height_m for plan in plans] == [0.018, 0.03, 0.018, 0.03, 0.03, 0.018, 0.03, 0.018]


@pytest.mark.parametrize(
    ("top_m", "used_m"),
    [
        (None, {0.034, 0.018, 0.048}),
        (0.01, {0.018}),
        (0.04, {0.034, 0.018}),
        (0.06, {0.034, 0.048}),
        (0.12, {0.048}),
    ],
)
def test_a_surface_is_touched_below_its_top_and_with_room_for_the_hand_above_it(
    top_m: float | None, used_m: set[float]
) -> None:
    planner = HeuristicPlanner(PlanSettings(), np.random.default_rng(0), dimension=3)
    planner.top_m = top_m
    assert {planner.height_m(index) for index in range(12)} == used_m


def test_turns_keep_the_yaw_window() -> None:
    planner = rule(yaw_window_rad=(-1.0, 1.0))
    for yaw in np.linspace(-1.0, 1.0, 21):
        turn = planner.turn(float(yaw))
        assert 0.2 <= abs(turn) <= 0.8
        assert -1.0 <= yaw + turn <= 1.0


def test_turn_in_a_narrow_window_uses_the_room_there_is() -> None:
    assert rule(yaw_window_rad=(0.0, 0.1)).turn(0.02) == pytest.approx(0.08)


def test_step_back_is_bounded_and_ends_at_the_start() -> None:
    planner = rule(start_m=(0.1, 0.0), return_m=0.03)
    np.testing.assert_allclose(planner.step_back(np.array([0.2, 0.0])), [-0.03, 0.0])
    np.testing.assert_allclose(planner.step_back(np.array([0.11, 0.0])), [-0.01, 0.0])
    np.testing.assert_allclose(planner.step_back(np.array([0.1, 0.0])), [0.0, 0.0])


def touch(finger: str, x: float, y: float, frame: GraspFrame) -> Contact:
    point = np.asarray(frame.pose.transformFrom(np.array([x, y, 0.02])))
    return Contact(finger, point, np.array([1.0, 0, 0]), 1e-6 * np.eye(3), 0.05, 0.5)


def centre_of(plan: GraspPlan, **touches: tuple[float, float]) -> np.ndarray:
    contacts = tuple(touch(finger, x, y, plan.frame) for finger, (x, y) in touches.items())
    grasp = Grasp(0, 0, contacts, Pose3(Rot3(), np.zeros(3)))
    inside = plan.frame.pose.inverse().transformFrom(np.array([*contact_centre(grasp, plan), 0.0]))
    return np.asarray(inside)[:2]


FRONT = {"FF": (0.04, 0.03), "MF": (0.04, 0.01), "RF": (0.04, -0.01), "LF": (0.04, -0.03)}
SIDES = {"FF": (0.02, 0.03), "MF": (0.04, 0.01), "LF": (0.02, -0.05), "TH": (-0.02, 0.0)}


@pytest.mark.parametrize(
    ("name", "touches", "expected"),
    [
        ("pinch", {**FRONT, "TH": (-0.02, 0.0)}, (0.01, 0.0)),
        ("pinch", {"RF": (0.03, -0.01), "LF": (0.03, -0.03), "TH": (-0.03, 0.0)}, (0.0, -0.016)),
        ("radial", SIDES, (0.01, -0.01)),
        ("pinch", {"TH": (-0.02, 0.01)}, (0.01, 0.0)),
        ("pinch", FRONT, (0.01, 0.0)),
        ("radial", {}, (0.0, 0.0)),
    ],
)
def test_centre_from_contacts(
    name: str, touches: dict[str, tuple[float, float]], expected: tuple[float, float]
) -> None:
    plan = GraspPlan(GraspFrame(0.1, -0.05, 0.6), name, 0.022)
    np.testing.assert_allclose(centre_of(plan, **touches), expected, atol=1e-9)


def test_rays_are_the_usable_parts_of_the_lines() -> None:
    table = closing("radial", 0.022)
    rays = closing_rays(table)
    for index, finger in enumerate(rays.fingers):
        path = table.path(finger)
        np.testing.assert_allclose(rays.starts_m[index], path.centre_m(path.valid[0]))
        end_m = rays.starts_m[index] + rays.lengths_m[index] * rays.directions[index]
        np.testing.assert_allclose(end_m, path.centre_m(path.valid[1]), atol=1e-12)


@pytest.mark.parametrize(
    "content",
    [
        {"closings": ["scoop"]},
        {"closings": []},
        {"contour_heights_m": []},
        {"surface_heights_m": [0.5]},
        {"yaw_window_rad": [1.0, -1.0]},
        {"turn_rad": [0.5, 0.2]},
        {"unknown": 1},
    ],
)
def test_senseless_plans_are_refused(content: dict[str, Any]) -> None:
    with pytest.raises(ConfigurationError):
        validate(content, PlanSettings, where="rig.yaml")


# --- decisions other than the planner's ---------------------------------------------------------------------------


class Leaving(AutonomousDecisions):
    """Never carries the object."""

    def on_capture(self, grasp: Grasp, plan: GraspPlan) -> Reorientation | Veto:
        super().on_capture(grasp, plan)
        return Reorientation(0.0, np.zeros(2))


class Scripted(AutonomousDecisions):
    """The planner's decisions with others put in between; keeps what it is told."""

    def __init__(
        self, estimator: EstimatorClient, script: list[Decision | None], vetoes: set[int] | None = None
    ) -> None:
        super().__init__(estimator)
        self.script, self.vetoes, self.undos = script, vetoes or set(), 0
        self.errors: list[str] = []

    def decide(self, index: int) -> Decision:
        return (self.script.pop(0) if self.script else None) or super().decide(index)

    def on_capture(self, grasp: Grasp, plan: GraspPlan) -> Reorientation | Veto:
        wanted = super().on_capture(grasp, plan)
        if grasp.index in self.vetoes:
            self.vetoes.remove(grasp.index)
            return Veto("too few fingers")
        return wanted

    def on_undo(self) -> None:
        self.undos += 1
        super().on_undo()

    def on_failure(self, error: TactileLabError) -> bool:
        self.errors.append(str(error))
        return len(self.errors) < 2


def scripted(
    world: DiscWorld, script: list[Decision | None], grasps: int = 3, vetoes: set[int] | None = None
) -> tuple[SessionOutcome, Scripted, TactileSlam]:
    slam, wanted = TactileSlam(SlamSettings(particles=200), seed=1), settings(grasps)
    roles = autonomous_roles(world, slam, wanted, seed=3)  # type: ignore[arg-type]
    decisions = Scripted(roles.estimator, script, vetoes)
    roles = replace(roles, decisions=decisions)
    return Conductor(world, wanted, roles).run(), decisions, slam  # type: ignore[arg-type]


def test_grasp_taken_back_is_forgotten_by_session_and_estimate() -> None:
    world = DiscWorld(disc())
    outcome, decisions, slam = scripted(world, [None, None, UndoGrasp("it slipped"), None, None])
    assert [grasp.index for grasp in outcome.grasps] == [0, 1, 2]
    assert world.event_counts[EventKind.UNDO] == decisions.undos == 1
    assert world.event_counts[EventKind.CAPTURE_END] == 4
    again = TactileSlam(SlamSettings(particles=200), seed=1)
    for grasp in outcome.grasps:
        again.step(grasp)
    assert again.world_T_object is not None
    assert slam.world_T_object is not None
    np.testing.assert_array_equal(again.world_T_object.matrix(), slam.world_T_object.matrix())
    assert slam.step_count == 3


def test_motion_of_a_grasp_taken_back_belongs_to_the_next_one() -> None:
    target = disc()
    start_m = target.centre_m.copy()
    outcome, _, _ = scripted(DiscWorld(target), [None, None, UndoGrasp("again")], grasps=2)
    motion = outcome.grasps[1].hand_motion_world
    moved_m = np.asarray(motion.transformFrom(np.array([*start_m, 0.0])))[:2]
    np.testing.assert_allclose(moved_m, target.centre_m, atol=4e-3)


def test_nothing_to_take_back_is_told() -> None:
    world = DiscWorld(disc())
    outcome, _, _ = scripted(world, [UndoGrasp("oops")], grasps=1)
    assert outcome.ending is Ending.COMPLETE
    assert (Level.WARNING, "there is no grasp to undo") in world.log_lines


def test_vetoed_grasp_does_not_count() -> None:
    world = DiscWorld(disc())
    outcome, _, slam = scripted(world, [], grasps=2, vetoes={1})
    assert [grasp.index for grasp in outcome.grasps] == [0, 1]
    assert world.event_counts[EventKind.CAPTURE_END] == 3
    assert slam.step_count == 2


def test_hand_is_without_demand_for_as_long_as_the_session_pauses() -> None:
    world = DiscWorld(disc())
    outcome, _, _ = scripted(world, [None, *[Pause("coffee")] * 5], grasps=2)
    assert outcome.ending is Ending.COMPLETE
    assert world.hand.stops == 2  # the pause, the end
    assert world.hand.resumes == 1
    pauses = [text for _, text in world.log_lines if "coffee" in text or text == "the session continues"]
    assert pauses == ["paused: coffee", "the session continues"]


def test_whoever_decides_ends_the_session() -> None:
    outcome, _, _ = scripted(DiscWorld(disc()), [None, End("seen enough")])
    assert (outcome.ending, outcome.reason, len(outcome.grasps)) == (Ending.COMPLETE, "seen enough", 1)


def test_session_goes_on_after_a_failure_where_whoever_decides_says_so() -> None:
    """A failure while the object is carried: the captured grasp counts and is estimated."""

    def fail_once(world: DiscWorld) -> None:
        if world.session_events and world.session_events[-1] is EventKind.HOLD_BEGIN and not failures:
            failures.append(True)
            raise DeviceError("cable pulled", where="FF")

    failures: list[bool] = []
    world = DiscWorld(disc(), fail_once)
    outcome, decisions, slam = scripted(world, [], grasps=2)
    assert outcome.ending is Ending.COMPLETE
    assert len(outcome.grasps) == slam.step_count == 2
    assert decisions.errors == ["FF: cable pulled"]
    assert world.event_counts[EventKind.HOLD_BEGIN] == world.event_counts[EventKind.HOLD_END] == 1


def test_second_failure_ends_the_session_where_whoever_decides_says_so() -> None:
    def fail(world: DiscWorld) -> None:
        if world.cycles > 100:
            raise DeviceError("cable pulled", where="FF")

    outcome, decisions, _ = scripted(DiscWorld(disc(), fail), [])
    assert outcome.ending is Ending.STOPPED
    assert len(decisions.errors) == 2
