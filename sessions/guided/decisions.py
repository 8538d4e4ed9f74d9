"""A person decides; the planner suggests."""

from __future__ import annotations

from drivers.core.contacts import Grasp
from drivers.core.errors import DeviceError, SafetyError, TactileLabError
from drivers.core.observability import planar_observability
from sessions.conductor.decisions import AutonomousDecisions, Decision, End, Pause, UndoGrasp, Veto, Wait
from sessions.conductor.estimator import EstimatorService, PoseStep, Reorientation
from sessions.conductor.estimator_client import EstimatorClient
from sessions.guided.console import OperatorConsole
from sessions.guided.operator import Ask, Stage
from sessions.guided.words import plan_in_words
from sessions.motion.grasp_plan import GraspPlan

GOOD_OBSERVABILITY = 0.15
"""Smallest eigenvalue of (3.18) above which a grasp determines the whole pose on the table."""


class GuidedDecisions(AutonomousDecisions):
    """The operator's decisions at the console.

    Args:
        estimator: client of the planner, which makes suggestions.
        console: the operator's console.
        felt: the operator was asked to place the object, and whether to feel it, before the first decision.
    """

    def __init__(self, estimator: EstimatorClient, console: OperatorConsole, *, felt: bool = False) -> None:
        super().__init__(estimator)
        self._console, self._felt = console, felt
        self._entered: int | None = None

    def prepare(self, index: int) -> None:
        super().prepare(index)
        assert self.suggested is not None
        self._console.suggestion = plan_in_words(self.suggested)
        self._entered = None

    def decide(self, index: int) -> Decision:
        console = self._console
        if console.end_wanted:
            return End(f"ended by the operator after {index} grasps")
        if console.undo_wanted:
            console.undo_wanted = False
            return self._again(UndoGrasp("by the operator"))
        if console.paused:
            return Pause(console.paused)
        if self._entered != index:
            self._enter(index)
        for request in console.take():
            if request.ask is Ask.UNDO:
                return self._again(UndoGrasp("by the operator"))
            if request.ask in (Ask.NEXT, Ask.GO):
                return self._again(super().decide(index))
        return Wait()

    def _again(self, decision: Decision) -> Decision:
        self._entered = None
        return decision

    def _enter(self, index: int) -> None:
        self._entered, self._console.grasp = index, index + 1
        ready = f"Ready for the {'next' if index else 'first'} grasp."
        first = ready if index or self._felt else "Place the object on the table."
        undo = "" if index == 0 else "; u: take the last grasp back"
        self._console.enter(Stage.PLACE, f"{first} SPACE: continue{undo}; e: end", Ask.NEXT, Ask.UNDO, Ask.END)

    def on_capture(self, grasp: Grasp, plan: GraspPlan) -> Reorientation | Veto:
        self._console.tell(_in_words(grasp))
        self._console.enter(Stage.ROTATE, "Considering how to turn the object")  # it cannot be given up any more
        return super().on_capture(grasp, plan)

    def on_estimate(self, step: PoseStep) -> None:
        super().on_estimate(step)
        self._console.unknown = self.estimator.ask(EstimatorService.describe_unknown)
        self._console.tell(f"grasp {step.index + 1} {step.verdict}: {step.reason}")

    def on_undo(self) -> None:
        super().on_undo()
        self._console.unknown = self.estimator.ask(EstimatorService.describe_unknown)

    def on_failure(self, error: TactileLabError) -> bool:
        return isinstance(error, (SafetyError, DeviceError)) and self._console.fail(str(error))


def _in_words(grasp: Grasp) -> str:
    """What was captured, and whether it determines the pose."""
    if not grasp.contacts:
        return "captured, but no finger is in contact"
    value = planar_observability(grasp.points_world_m, grasp.normals_world).smallest
    worth = "determines the whole pose" if value >= GOOD_OBSERVABILITY else "does not determine the whole pose"
    return f"captured {len(grasp.contacts)} contacts: observability {value:.2f}, {worth}"
