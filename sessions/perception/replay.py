"""A recorded session, understood again from its raw bytes.

Why a replay gives the same grasps, bit for bit:

1. Live, the tap of each transport records a datagram and in the same call hands it to the session's
   :class:`~sessions.perception.interpreter.Interpreter`, before any device decodes it. A event is recorded and
   interpreted in one call too. All of it happens in one thread, so the order in the file is the order of
   interpretation.
2. The Interpreter knows nothing else: its decoders and its Perception are objects of its own, and its clock shows
   the newest stamp it was given. What the live devices decode for their own control does not reach it.
3. A replay hands the received bytes and the session events of the file, in the file's order, to an Interpreter built
from the
   same rig description and calibration copies.

So live and replay run the same code on the same input. Transmitted bytes, samples and truth in the file are not
read. A file that was cut off replays up to the cut.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator

from drivers.core.clock import Clock, MonotonicClock
from drivers.core.contacts import Grasp
from sessions.perception.event_outcomes import Outcome, Undone
from sessions.perception.interpreter import Interpreter
from sessions.recording.pacing import AS_FAST_AS_POSSIBLE, pace
from sessions.recording.session import Session
from sessions.recording.session_events import SessionEvent
from sessions.recording.traffic import schemas
from sessions.recording.traffic.loss import Loss
from sessions.recording.traffic.reader import TrafficReader


def kept_grasps(outcomes: Iterable[Outcome]) -> list[Grasp]:
    """The grasps of a session, without undone ones."""
    grasps: list[Grasp] = []
    for outcome in outcomes:
        if isinstance(outcome, Grasp):
            grasps.append(outcome)
        elif isinstance(outcome, Undone):
            del grasps[outcome.index :]
    return grasps


class Replay:
    """One pass over a session's traffic.

    Args:
        source: the session, or its traffic file.
        interpreter: a fresh one, as the session's own was.
        speed: 1 for the original pace, 4 for four times as fast, 0 (the default) as fast as possible.
        clock: waits if a speed is given.

    Raises:
        SessionError: the traffic file cannot be used.
    """

    def __init__(
        self,
        source: Session | TrafficReader,
        interpreter: Interpreter,
        speed: float = AS_FAST_AS_POSSIBLE,
        clock: Clock | None = None,
    ) -> None:
        self._speed, self._clock = speed, clock or MonotonicClock()
        self._span_ns = self._taken_ns = 0
        self._reader = source.traffic() if isinstance(source, Session) else source
        self._interpreter = interpreter

    @property
    def loss(self) -> Loss:
        """What could not be read; complete after :meth:`outcomes` has ended."""
        return self._reader.loss

    @property
    def factor(self) -> float:
        """Speed relative to the original pace; 0 before reading."""
        return self._span_ns / self._taken_ns if self._taken_ns else 0.0

    def outcomes(self) -> Iterator[Outcome]:
        """The grasps, camera frames and tare reports, in the order in which they came about.

        Raises:
            SessionError: a event cannot be understood.
        """
        begun_ns, first_ns = self._clock.now_ns(), None
        for message in pace(self._reader.messages(), self._speed, self._clock):
            first_ns = message.stamp_ns if first_ns is None else first_ns
            self._span_ns, self._taken_ns = message.stamp_ns - first_ns, self._clock.now_ns() - begun_ns
            if message.topic == schemas.SESSION_EVENTS_TOPIC:
                event = SessionEvent.from_bytes(message.data, where=str(self._reader.path))
                if (outcome := self._interpreter.event(event)) is not None:
                    yield outcome
            elif (transport := schemas.received_transport(message.topic)) is not None:
                self._interpreter.on_received(transport, message.data, message.stamp_ns)
