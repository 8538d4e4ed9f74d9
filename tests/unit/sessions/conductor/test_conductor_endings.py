"""How sessions end: nothing found, too much force, devices that fail, interrupts and limits."""

from __future__ import annotations

import os
import signal
from dataclasses import replace

import pytest

from drivers.core.errors import DeviceError
from sessions.conductor.conductor import Conductor
from sessions.conductor.decisions import AutonomousDecisions
from sessions.conductor.session_outcome import Ending
from sessions.recording.session_events import EventKind
from tactile_lab.autonomy.autonomous_roles import autonomous_roles
from tactile_lab.slam.slam_settings import SlamSettings
from tactile_lab.slam.tactile_slam import TactileSlam
from tests.support.disc_sessions import Watcher, disc, run, settings
from tests.support.disc_world import DiscWorld


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
    assert outcome.reason.startswith("could not reach the table: 6 approaches were blocked; the hand landed over ")
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
