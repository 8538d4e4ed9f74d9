"""Sessions in which somebody else decides: grasps taken back, vetoes, pauses, ends, and failures that are gone past."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from drivers.core.contacts import Grasp
from drivers.core.errors import DeviceError, TactileLabError
from sessions.conductor.conductor import Conductor
from sessions.conductor.decisions import AutonomousDecisions, Decision, End, Pause, UndoGrasp, Veto
from sessions.conductor.estimator import Reorientation
from sessions.conductor.estimator_client import EstimatorClient
from sessions.conductor.session_outcome import Ending, SessionOutcome
from sessions.motion.grasp_plan import GraspPlan
from sessions.recording.recorder import Level
from sessions.recording.session_events import EventKind
from tactile_lab.autonomy.autonomous_roles import autonomous_roles
from tactile_lab.slam.slam_settings import SlamSettings
from tactile_lab.slam.tactile_slam import TactileSlam
from tests.support.disc_sessions import disc, settings
from tests.support.disc_world import DiscWorld


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
        again.add_grasp(grasp)
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
