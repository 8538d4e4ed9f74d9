"""A person decides; the planner suggests."""

from __future__ import annotations

from sessions.decisions import AutonomousDecisions, Decision, End, Pause, UndoGrasp, Veto, Wait
from sessions.grasp_plan import GraspPlan
from sessions.guided.desk import Desk
from sessions.guided.operator import Ask, Stage
from sessions.guided.words import plan_in_words, unknown_in_words
from sessions.planner import Reorientation
from sessions.thinker import Thinker
from sessions.thinking import Thinking
from tactile_lab.errors import DeviceError, SafetyError, TactileLabError
from tactile_lab.geometry.contacts import Grasp
from tactile_lab.geometry.poses import planar
from tactile_lab.slam_result import SlamStep
from tactile_lab.tracking.observability import planar_observability

GOOD_OBSERVABILITY = 0.15
"""Smallest eigenvalue of (3.18) from which a grasp tells the whole pose on the table."""


class GuidedDecisions(AutonomousDecisions):
    """What the person asks for at the desk.

    Args:
        thinking: where the planner is asked, which suggests.
        desk: where the person sits.
    """

    def __init__(self, thinking: Thinking, desk: Desk) -> None:
        super().__init__(thinking)
        self._desk = desk
        self._entered: int | None = None

    def think(self, index: int) -> None:
        super().think(index)
        assert self.suggested is not None
        self._desk.suggestion = plan_in_words(self.suggested)
        self._entered = None

    def decide(self, index: int) -> Decision:
        desk = self._desk
        if desk.end_wanted:
            return End(f"ended by the operator after {index} grasps")
        if desk.undo_wanted:
            desk.undo_wanted = False
            return self._again(UndoGrasp("by the operator"))
        if desk.paused:
            return Pause(desk.paused)
        if self._entered != index:
            self._enter(index)
        for request in desk.take():
            if request.ask is Ask.UNDO:
                return self._again(UndoGrasp("by the operator"))
            if request.ask in (Ask.NEXT, Ask.GO):
                return self._again(super().decide(index))
        return Wait()

    def _again(self, decision: Decision) -> Decision:
        self._entered = None
        return decision

    def _enter(self, index: int) -> None:
        self._entered, self._desk.grasp = index, index + 1
        first = "Place the object on the table." if index == 0 else "Ready for the next grasp."
        undo = "" if index == 0 else "; u: take the last grasp back"
        self._desk.enter(Stage.PLACE, f"{first} SPACE: go on{undo}; e: end", Ask.NEXT, Ask.UNDO, Ask.END)

    def captured(self, grasp: Grasp, plan: GraspPlan) -> Reorientation | Veto:
        self._desk.tell(_in_words(grasp))
        self._desk.enter(Stage.ROTATE, "Considering how to turn the object")  # it can not be given up any more
        return super().captured(grasp, plan)

    def estimated(self, step: SlamStep) -> None:
        super().estimated(step)
        self._desk.unknown = self.thinking.ask(_unknown)
        self._desk.tell(f"grasp {step.index + 1} {step.verdict}: {step.reason}")

    def undone(self) -> None:
        super().undone()
        self._desk.unknown = self.thinking.ask(_unknown)

    def failed(self, error: TactileLabError) -> bool:
        return isinstance(error, (SafetyError, DeviceError)) and self._desk.fail(str(error))


def _unknown(thinker: Thinker) -> str:
    """Which part of the object is still unknown."""
    world_T_object = thinker.slam.world_T_object
    pose = None if world_T_object is None else planar(world_T_object)
    return unknown_in_words(thinker.known_shape(), pose)


def _in_words(grasp: Grasp) -> str:
    """What was captured, and whether it tells the pose."""
    if not grasp.contacts:
        return "captured, but no finger has a contact"
    value = planar_observability(grasp.points_world_m, grasp.normals_world).smallest
    worth = "tells the whole pose" if value >= GOOD_OBSERVABILITY else "leaves a motion of the object open"
    return f"captured {len(grasp.contacts)} contacts: observability {value:.2f}, {worth}"
