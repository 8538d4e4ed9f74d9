"""Motion with an operator: every cycle updates the display and reads requests."""

from __future__ import annotations

from collections.abc import Callable, Iterator

from sessions.guided.console import OperatorConsole
from sessions.guided.operator import Request
from sessions.motion.motion import Motion
from sessions.motion.safety import SafetySupervisor
from sessions.rig_runtime.rig_runtime import RigRuntime


class GuidedMotion(Motion):
    """As :class:`Motion`; a pause holds it, and giving up a grasp ends it.

    Args:
        runtime: connected.
        supervisor: checks every cycle.
        console: the operator's console.
    """

    def __init__(self, runtime: RigRuntime, supervisor: SafetySupervisor, console: OperatorConsole) -> None:
        super().__init__(runtime, supervisor)
        self._console = console

    def tick(self) -> None:
        """One supervised cycle, and further ones for as long as the operator pauses.

        Raises:
            GraspAbandonedError: the operator has given up this grasp.
            SafetyError, DeviceError: as :meth:`Motion.tick`.
        """
        super().tick()
        self._console.cycle()
        while self._console.holds:
            super().tick()
            self._console.cycle()
        self._console.check_given_up()

    def requests(self, each: Callable[[], None] = lambda: None) -> Iterator[Request]:
        """The operator's requests in this step, until one leaves it; ``each`` is called before every cycle."""
        while not self._console.moves_on:
            each()
            self.tick()
            yield from self._console.take()

    def rest(self) -> None:
        """One cycle while the session is paused: a device failure is shown, but not raised."""
        self._console.rest()

    def begin_anew(self) -> None:
        """After a stop: the next motion starts at the present position."""
        self._base_q = self.runtime.perception.hand.base_q.copy()
        self._fingers.forget()
