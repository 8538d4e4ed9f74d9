"""Carries a captured object: weighs it, predicts what will become of it, re-orients it, and tells how it slipped."""

from __future__ import annotations

from collections.abc import Callable

from drivers.core.contacts import Grasp
from sessions.conductor.decisions import SessionRoles
from sessions.conductor.estimator import Reorientation
from sessions.motion.grasp_plan import holds
from sessions.perception.hand_odometry import HandMotion
from sessions.recording.recorder import Level
from sessions.rig_runtime.rig_runtime import RigRuntime

_TRIES = 2
"""What slipped out of the fingers once may hang better in another grasp; twice, it is the object."""

Tell = Callable[[Level, str], None]


class Carrier:
    """Executes what follows a capture, until the hand opens.

    Args:
        runtime: connected.
        roles: perform, and decide.
        phase: hears each step.
        tell: hears what a person should know.
    """

    def __init__(self, runtime: RigRuntime, roles: SessionRoles, phase: Callable[[str], None], tell: Tell) -> None:
        self._runtime, self._roles, self._phase, self._tell = runtime, roles, phase, tell
        self._too_heavy = 0

    def carry(self, grasp: Grasp, wanted: Reorientation, *, weighed: bool, last: bool) -> None:
        """Squeeze, and re-orient the object, unless it stays in place or too few fingers hold it.

        Args:
            grasp: as captured.
            wanted: how to re-orient it.
            weighed: whether it is to be weighed before.
            last: no grasp follows.
        """
        self._roles.supervisor.count_contacts(len(grasp.contacts))
        motion, is_held = HandMotion(), holds(grasp.touching)
        if weighed and is_held:
            is_held = self._weigh(grasp.touching)
            motion = self._told_carry() or motion
        if wanted.moves and is_held and not last:
            motion = self._reorient(grasp, wanted)
        self._roles.decisions.on_carry(motion)

    def _reorient(self, grasp: Grasp, wanted: Reorientation) -> HandMotion:
        """The object's motion since the capture."""
        cycle = self._roles.performer
        self._forecast(grasp, wanted)
        self._phase("squeeze")
        cycle.squeeze(grasp.touching)
        self._phase("re-orient")
        palm_motion = cycle.reorient(wanted.turn_rad, wanted.shift_world_m, grasp.touching)
        if cycle.jammed:
            self._tell(Level.WARNING, f"{', '.join(cycle.jammed)} pressed hard: re-orientation stopped early")
        if cycle.slipped is not None:
            self._tell(Level.INFO, f"the object slips ({cycle.slipped.in_words()}): re-orientation stopped early")
        return self._told_carry() or HandMotion(palm_motion)

    def _forecast(self, grasp: Grasp, wanted: Reorientation) -> None:
        """Hold the object as hard as it needs, and say what is to be expected."""
        if self._roles.forecast is None:
            return
        forecast = self._roles.forecast(grasp, wanted.turn_rad, wanted.shift_world_m)
        if forecast is None:
            return
        self._runtime.log(Level.INFO, "odometry", f"each finger holds the object with {forecast.force_N:.2f} N")
        if words := forecast.in_words():
            self._tell(Level.WARNING, f"the object {words}")

    def _weigh(self, touching: frozenset[str]) -> bool:
        """Weigh the held object, if this session can and nobody objects. Returns whether it is still held.

        Its mass is measured once: a hand's errors are the same every time. What was too heavy twice is lifted no more.
        """
        roles, is_known = self._roles, self._runtime.perception.properties.hung_free
        if roles.weigh is None or is_known or self._too_heavy >= _TRIES:
            return True
        if not roles.decisions.may_weigh(roles.performer.plan):
            self._tell(Level.INFO, "the object is not weighed")
            return True
        self._phase("weigh")
        lift = roles.weigh(touching)
        self._too_heavy += lift.is_too_heavy
        self._tell(Level.INFO, f"weighed: {lift.in_words()}; {self._runtime.perception.properties.in_words()}")
        if self._too_heavy == _TRIES:
            self._tell(Level.WARNING, "the object is too heavy for the fingers: it is lifted no more")
        return lift.end.is_held

    def _told_carry(self) -> HandMotion | None:
        """Report how the object slipped. Returns how it was moved, if the fingertips felt that."""
        perception = self._runtime.perception
        if (slip := perception.heard_slip) is not None:
            self._runtime.log(Level.INFO, "odometry", f"the object {slip.in_words()}")
        if (carry := perception.carry) is None:
            return None
        level, words = Level.WARNING if carry.is_remarkable else Level.INFO, f"the object {carry.in_words()}"
        if carry.is_remarkable:
            self._tell(level, words)
        else:
            self._runtime.log(level, "odometry", words)
        return perception.hand_motion
