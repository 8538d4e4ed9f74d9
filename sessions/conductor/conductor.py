"""The conductor runs a session, grasp after grasp, until there are enough or there is a reason to end.

:class:`~sessions.conductor.decisions.SessionRoles` decide about the grasps and execute them.
"""

from __future__ import annotations

import numpy as np

from drivers.core.contacts import Array, Grasp
from drivers.core.errors import TactileLabError
from sessions.conductor.carrier import Carrier
from sessions.conductor.decisions import (
    DoGrasp,
    End,
    FindAgain,
    GraspAbandonedError,
    Pause,
    SessionRoles,
    UndoGrasp,
    Veto,
    Wait,
)
from sessions.conductor.estimation import Estimation
from sessions.conductor.estimator import Change, Estimate, Reorientation
from sessions.conductor.object_gone import blocked, lost, not_found, nowhere
from sessions.conductor.progress import GraspReport, NullProgress, Progress
from sessions.conductor.session_outcome import Ending, SessionOutcome
from sessions.conductor.settings import ConductorSettings
from sessions.motion.grasp_plan import GraspPlan
from sessions.recording.recorder import Level
from sessions.rig_runtime.rig_runtime import RigRuntime


class Conductor:
    """Runs a session on a connected rig runtime.

    Args:
        runtime: connected; the caller closes it.
        settings: of the session.
        roles: decide about the grasps and execute them; the caller opens their estimator.
        progress: receives what happens.
    """

    def __init__(
        self,
        runtime: RigRuntime,
        settings: ConductorSettings,
        roles: SessionRoles,
        progress: Progress | None = None,
    ) -> None:
        self._runtime, self._settings = runtime, settings
        self._progress = progress or NullProgress()
        self._supervisor, self._cycle, self._decisions = roles.supervisor, roles.performer, roles.decisions
        self._survey, self._find, self._guard = roles.survey, roles.find, roles.guard
        self._carrier = Carrier(runtime, roles, self._phase, self._tell)
        self._guard.heard = self._progress.on_interrupt
        self._estimation = Estimation(runtime, roles.estimator)
        self._prepared: int | None = None
        self._paused = False
        self._grasps: list[Grasp] = []
        self._misses = 0
        self._landings_m: list[Array] = []
        """Where fingertips landed on the object since the last approach that succeeded, world, (3,) each."""
        self._number = 0

    # --- the session -------------------------------------------------------------------------------------------

    def run(self) -> SessionOutcome:
        """Grasp until done.

        In every case the hand ends without demands and the positioner holds. Ctrl+C once finishes the current step and
        ends the session, twice raises KeyboardInterrupt immediately.
        """
        try:
            with self._guard:
                ending, reason = self._grasp_until_done()
            return self._end(ending, reason)
        except TactileLabError as error:
            return self._end(Ending.STOPPED, str(error), error)
        except BaseException as error:
            self._supervisor.stop(error)
            raise

    def _feel_bounding_box(self) -> tuple[Ending, str] | None:
        """The bounding box phase before the first grasp, if enabled. Returns why to end if there is no object."""
        if self._survey is None:
            return None
        self._phase("bounding box")
        box = self._survey(lambda: self._guard.requested)
        if box is None:
            return None
        self._decisions.on_bounding_box(box)
        self._tell(Level.INFO, box.in_words())
        if box.is_found or self._guard.requested:
            return None
        probing, lowest_m = self._settings.probing, self._settings.cycle.touch.lowest_m
        return Ending.OBJECT_LOST, not_found(box, self._decisions.centre_m, probing.around_m, lowest_m)

    def _grasp_until_done(self) -> tuple[Ending, str]:
        if ended := self._feel_bounding_box():
            return ended
        while True:
            if ended := self._reason_to_end():
                return ended
            try:
                if ended := self._follow_decision(len(self._grasps)):
                    return ended
            except TactileLabError as error:
                self._survive(error)

    def _follow_decision(self, index: int) -> tuple[Ending, str] | None:
        """Ask for the next decision, and execute it."""
        self._number = index + 1
        self._consider(index)
        if self._guard.requested:
            return None
        decision = self._decisions.decide(index)
        self._pause(decision if isinstance(decision, Pause) else None)
        match decision:
            case DoGrasp(plan):
                self._prepared = None
                self._one_grasp(plan)
            case UndoGrasp(reason):
                self._undo(reason)
            case End(reason, partial):
                if partial and not self._grasps:
                    return Ending.OBJECT_LOST, reason
                return Ending.PARTIAL if partial else Ending.COMPLETE, reason
            case FindAgain():
                return self._find_again(decision)
            case Wait() | Pause():
                self._cycle.idle()
        return None

    def _find_again(self, wanted: FindAgain) -> tuple[Ending, str] | None:
        """Look for an object that may have fallen over or been pushed. Returns why to end if it is gone."""
        search, self._prepared = wanted.search, None
        if self._find is None:
            return Ending.OBJECT_LOST, lost(search.reason, self._grasps)
        self._tell(Level.WARNING, f"{search.reason}: the object is looked for")
        self._phase("search")
        box = self._find(lambda: self._guard.requested, search.places_m, search.top_m)
        if self._guard.requested:
            return None
        if not box.is_found:
            return Ending.OBJECT_LOST, lost(f"{search.reason}, {nowhere(search.places_m)}", self._grasps)
        self._supervisor.count_contacts(1)
        change, words = wanted.found(box)
        if change is not Change.STANDS:
            self._runtime.note_object_moved(fell=change is Change.FELL)
        self._tell(Level.INFO if change is Change.STANDS else Level.WARNING, words)
        return None

    def _consider(self, index: int) -> None:
        if self._prepared != index:
            self._decisions.prepare(index)
            self._prepared = index
            if plan := self._decisions.suggested:
                self._runtime.recorder.plan(self._runtime.clock.now_ns(), plan.as_plain(index))

    def _pause(self, wanted: Pause | None) -> None:
        if wanted is not None and not self._paused:
            self._runtime.stop()
            self._tell(Level.INFO, f"paused: {wanted.reason}")
        elif wanted is None and self._paused:
            self._runtime.resume()
            self._tell(Level.INFO, "the session continues")
        self._paused = wanted is not None

    def _survive(self, error: TactileLabError) -> None:
        """Stop everything, and continue if the decision maker wants to. Raises the error otherwise."""
        if not self._decisions.on_failure(error):
            raise error
        problems = self._supervisor.stop(error)
        if self._runtime.perception.is_holding:
            self._runtime.end_hold()
        self._paused, self._prepared = True, None
        self._tell(Level.ERROR, "; ".join([f"stopped: {error}", *problems]))

    def _reason_to_end(self) -> tuple[Ending, str] | None:
        if self._guard.requested:
            return Ending.INTERRUPTED, "interrupted by the operator"
        if len(self._grasps) >= self._settings.grasps:
            return Ending.COMPLETE, f"{len(self._grasps)} grasps done"
        if self._misses >= self._settings.missed_approaches:
            touched = any(grasp.contacts for grasp in self._grasps)
            return Ending.PARTIAL if touched else Ending.OBJECT_LOST, blocked(self._misses, self._landings_m)
        if reason := self._supervisor.time_over(self._runtime.clock.now_ns()):
            return Ending.LIMIT, reason
        if reason := self._supervisor.object_lost(*self._decisions.centre_m):
            return Ending.OBJECT_LOST, lost(reason, self._grasps)
        return None

    def _end(self, ending: Ending, reason: str, error: TactileLabError | None = None) -> SessionOutcome:
        problems = self._supervisor.stop(error)
        text = "; ".join([reason, *(f"while stopping: {problem}" for problem in problems)])
        self._runtime.log(Level.ERROR if error else Level.INFO, "conductor", f"{ending}: {text}")
        for note in getattr(error, "__notes__", ()):
            self._runtime.log(Level.ERROR, "conductor", note)
        seen = self._runtime.perception
        return SessionOutcome(ending, text, tuple(self._grasps), dict(seen.touches.drop_counts), error, seen.properties)

    # --- one grasp ---------------------------------------------------------------------------------------------

    def _one_grasp(self, plan: GraspPlan) -> None:
        """Descend, close, settle, capture, squeeze, re-orient, release, lift; then estimate."""
        try:
            grasp = self._measure(plan)
        except GraspAbandonedError as given_up:
            self._tell(Level.INFO, str(given_up))
            self._let_go()
            return
        if grasp is None:
            return
        missing = dict(self._runtime.perception.touches.dropped)
        wanted = self._choose_reorientation(grasp)
        if isinstance(wanted, Veto):
            self._runtime.undo()
            self._tell(Level.INFO, f"grasp {self._number} was discarded: {wanted.reason}")
            self._let_go()
            return
        self._grasps.append(grasp)
        try:
            if wanted is not None:
                self._carry(grasp, wanted)
                self._let_go()
        except TactileLabError as error:
            self._survive(error)
        self._phase("estimate")
        estimate = self._estimation.step(grasp)
        self._decisions.on_estimate(estimate.step)
        self._progress.grasp_done(self._report(grasp, plan, estimate, missing))

    def _choose_reorientation(self, grasp: Grasp) -> Reorientation | Veto | None:
        """How to continue after a captured grasp; None if something failed meanwhile and the session continues."""
        try:
            return self._decisions.on_capture(grasp, self._cycle.plan)
        except TactileLabError as error:
            self._survive(error)
            return None

    def _measure(self, plan: GraspPlan) -> Grasp | None:
        """Descend, close and capture. Returns None if the hand did not get there, or must not continue."""
        cycle = self._cycle
        self._phase("descend")
        if not self._arrive(plan):
            return None
        if not plan.only_touch:
            self._phase("close")
            cycle.close()
            cycle.settle()
        if self._guard.requested:
            self._let_go()
            return None
        self._phase("capture")
        return cycle.capture()

    def _undo(self, reason: str) -> None:
        """Undo the last grasp; the next one gets its number, and the hand odometry is kept."""
        if not self._grasps:
            self._tell(Level.WARNING, "there is no grasp to undo")
            return
        undone = self._runtime.undo()
        self._grasps.pop()
        self._estimation.undo(self._runtime.perception.hand_motion.world)
        self._decisions.on_undo()
        self._prepared = None
        self._tell(Level.INFO, f"grasp {undone.index + 1} undone: {reason}")

    def _arrive(self, plan: GraspPlan) -> bool:
        arrived = self._cycle.descend(plan)
        self._decisions.on_arrival(self._cycle.landings_world_m)
        self._misses = 0 if arrived else self._misses + 1
        self._landings_m = [] if arrived else [*self._landings_m, *self._cycle.landings_world_m]
        if not arrived:
            landings = len(self._cycle.landings_world_m)
            often = "once" if landings == 1 else f"{landings} times"
            self._tell(Level.WARNING, f"the hand landed on the object {often}: trying another grasp")
        return arrived

    def _carry(self, grasp: Grasp, wanted: Reorientation) -> None:
        """Weigh and re-orient the object, as far as that is wanted and a grasp follows."""
        interrupted, count = self._guard.requested, len(self._grasps)
        weighed = count <= self._settings.weighings and not interrupted
        last = count >= self._settings.grasps or interrupted
        self._carrier.carry(grasp, wanted, weighed=weighed, last=last)

    def _let_go(self) -> None:
        if self._cycle.plan.only_touch:
            return
        self._phase("release")
        self._cycle.release()
        self._phase("lift")
        self._cycle.lift()

    # --- telling -----------------------------------------------------------------------------------------------

    def _report(self, grasp: Grasp, plan: GraspPlan, estimate: Estimate, missing: dict[str, str]) -> GraspReport:
        step, covariance = estimate.step, estimate.step.covariance
        return GraspReport(
            number=len(self._grasps),
            planned=self._settings.grasps,
            closing=plan.closing,
            reason=plan.reason,
            forces_N=_largest_forces_N(grasp, probed=False),
            touches_N=_largest_forces_N(grasp, probed=True),
            missing=missing,
            landings=len(self._cycle.landings_world_m),
            position_sigma_m=None if covariance is None else float(np.sqrt(np.trace(covariance[:2, :2]) / 2)),
            yaw_sigma_rad=None if covariance is None else float(np.sqrt(covariance[2, 2])),
            explored=estimate.explored,
            verdict=f"{step.verdict}: {step.reason}",
            stamp_ns=grasp.stamp_ns,
        )

    def _phase(self, name: str) -> None:
        self._progress.phase(self._number, name)

    def _tell(self, level: Level, message: str) -> None:
        self._runtime.log(level, "conductor", message)
        self._progress.on_message(message)


def _largest_forces_N(grasp: Grasp, *, probed: bool) -> dict[str, float]:
    """The largest force on each finger that touched, in its touches before the hand closed or in the grasp itself."""
    largest_N: dict[str, float] = {}
    for contact in grasp.contacts:
        if contact.probed is probed:
            largest_N[contact.finger] = max(contact.force_N, largest_N.get(contact.finger, 0.0))
    return largest_N
