"""The single path from received bytes to samples and grasps, shared by live sessions and replays.

Live, every transport is tapped. The tap (:class:`Observer`) first records a datagram and then, before the requesting
device sees it, passes the same bytes to the :class:`Interpreter`, whose decoders and :class:`Perception` are separate
from the live devices. A replay passes the recorded bytes to an equal Interpreter. In both cases the order of recording
*is* the order of processing, for session events too, and the Interpreter's clock shows the newest stamp that is
confirmed by more than one transport (:mod:`sessions.recording.traffic.session_clock`). So a live session cannot know
anything that is not in its recording.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from typing import Any, NamedTuple

from drivers.camera.packet import picture_of
from drivers.core.clock import VirtualClock
from drivers.core.errors import CodecError
from drivers.core.transports import Datagram
from sessions.perception.event_outcomes import Outcome
from sessions.perception.instruments import BaseReading, Decoder, FrameReading, HandReading
from sessions.perception.perception import Perception
from sessions.recording.recorder import Recorder
from sessions.recording.session_events import SessionEvent
from sessions.recording.traffic.session_clock import SessionClock

HAND_LINK, BASE_LINK, CAMERA_LINK = "hand", "base", "camera"


def fingertip_link(finger: str) -> str:
    """Name of the transport of a fingertip's own sensor."""
    return f"ft/{finger}"


class Heard(NamedTuple):
    """A sample and its arrival."""

    stamp_ns: int
    sample: Any


class Interpreter:
    """Decodes received datagrams and feeds Perception.

    Args:
        perception: a fresh one.
        hand, base: decoders of those transports.
        wrenches: decoders of the fingertips' own transports, by finger; empty when the hand carries their data.
        camera: decoder of camera frames, if the rig has a camera.
        clock: the clock the decoders were built with; it is set to the stamps.
    """

    def __init__(
        self,
        perception: Perception,
        *,
        hand: Decoder[HandReading],
        base: Decoder[BaseReading],
        wrenches: Mapping[str, Decoder[Sequence[Any]]] | None = None,
        camera: Decoder[FrameReading] | None = None,
        clock: VirtualClock | None = None,
    ) -> None:
        self.perception = perception
        self.clock, self.time = clock or VirtualClock(), SessionClock()
        self.newest: dict[str, Heard] = {}
        """The newest sample of each transport, and its arrival."""
        self.undecodable: Counter[str] = Counter()
        """Datagrams that broke their protocol, by transport."""
        self.listener: Callable[[str, Any], None] | None = None
        """Receives every sample with the name of its transport, after Perception."""
        self._routes: dict[str, Callable[[Datagram], None]] = {
            HAND_LINK: self._route(HAND_LINK, hand, perception.on_hand),
            BASE_LINK: self._route(BASE_LINK, base, perception.on_base),
        }
        for finger, decoder in (wrenches or {}).items():
            transport = fingertip_link(finger)
            self._routes[transport] = self._route(transport, decoder, _for_finger(perception, finger))
        if camera is not None:
            self._routes[CAMERA_LINK] = self._route(CAMERA_LINK, camera, perception.on_frame)

    def on_received(self, transport: str, payload: bytes, stamp_ns: int) -> None:
        """Process one datagram. Bytes that break the protocol are counted; unknown transports are ignored."""
        self.time.on_received(transport, stamp_ns)
        self.clock.sleep_until_ns(self.time.now_ns)
        route = self._routes.get(transport)
        if route is None:
            return
        try:
            route(Datagram(payload, stamp_ns))
        except CodecError:
            self.undecodable[transport] += 1

    def event(self, event: SessionEvent) -> Outcome | None:
        """Process one session event; see :meth:`Perception.event`."""
        self.time.on_stamp(event.stamp_ns)
        self.clock.sleep_until_ns(self.time.now_ns)
        return self.perception.event(event)

    def _route(self, transport: str, decoder: Decoder[Any], take: Callable[[Any], None]) -> Callable[[Datagram], None]:
        def route(datagram: Datagram) -> None:
            sample = decoder.receive(datagram)
            if sample is None:
                return
            if not (isinstance(sample, list) and not sample):  # a message may hold no reading
                self.newest[transport] = Heard(datagram.stamp_ns, sample)
            take(sample)
            if self.listener is not None:
                self.listener(transport, sample)

        return route


def _for_finger(perception: Perception, finger: str) -> Callable[[Sequence[Any]], None]:
    def take(samples: Sequence[Any]) -> None:
        perception.on_wrench(finger, samples)

    return take


class Observer:
    """The tap of a live session: record first, then interpret.

    If recording fails, the error is raised once, where it happened, and ends the session. The transports remain usable
    after that, unrecorded, so that zero demands still reach the hand; session events are refused.
    """

    def __init__(self, recorder: Recorder, interpreter: Interpreter) -> None:
        self.recorder, self.interpreter = recorder, interpreter

    def on_transmitted(self, transport: str, payload: bytes, stamp_ns: int) -> None:
        """The program sent something; it is only recorded."""
        if not self.recorder.broken:
            self.recorder.on_transmitted(transport, payload, stamp_ns)

    def on_received(self, transport: str, payload: bytes, stamp_ns: int) -> None:
        """A device sent something."""
        if not self.recorder.broken:
            self.recorder.on_received(transport, payload, stamp_ns)
            if transport == CAMERA_LINK and (picture := picture_of(payload)):
                self.recorder.image(stamp_ns, picture)
        self.interpreter.on_received(transport, payload, stamp_ns)

    def event(self, event: SessionEvent) -> Outcome | None:
        """Record and process a session event."""
        self.recorder.event(event)
        return self.interpreter.event(event)
