"""Motion with a person looking on: every cycle shows what is seen and hears what is asked for."""

from __future__ import annotations

from collections.abc import Callable, Iterator

from sessions.bench import Bench
from sessions.guided.desk import Desk
from sessions.guided.operator import Request
from sessions.motion import Motion
from sessions.safety import SafetySupervisor


class GuidedMotion(Motion):
    """As :class:`Motion`; a pause holds it, and giving up a grasp ends it.

    Args:
        bench: connected.
        supervisor: looks at every cycle.
        desk: where the person sits.
    """

    def __init__(self, bench: Bench, supervisor: SafetySupervisor, desk: Desk) -> None:
        super().__init__(bench, supervisor)
        self._desk = desk

    def tick(self) -> None:
        """One supervised cycle, and as many more as the person wants the hand to stay where it is.

        Raises:
            GraspAbandonedError: the person has given up this grasp.
            SafetyError, DeviceError: as :meth:`Motion.tick`.
        """
        super().tick()
        self._desk.cycle()
        while self._desk.holds:
            super().tick()
            self._desk.cycle()
        self._desk.check_given_up()

    def requests(self, each: Callable[[], None] = lambda: None) -> Iterator[Request]:
        """What the person asks for in this step, until he wants to be elsewhere; ``each`` acts before every cycle."""
        while not self._desk.moves_on:
            each()
            self.tick()
            yield from self._desk.take()

    def rest(self) -> None:
        """One cycle while the session pauses: a failing device is shown, and fails nothing."""
        self._desk.rest()

    def begin_anew(self) -> None:
        """After a stop: the next motion begins where everything stands."""
        self._base_q = self.bench.perception.base_q.copy()
        self._targets_rad = {}
