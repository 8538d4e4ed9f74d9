"""One path from received bytes to understanding, walked by the live session and by a replay alike.

Live, every link is tapped. The tap (:class:`Observer`) first records a datagram and then, still before the device
that asked for it sees it, hands the same bytes to the :class:`Interpreter`, whose decoders and :class:`Perception`
are objects apart from the live devices. A replay hands the recorded bytes to an equal Interpreter. The order of
recording *is* the order of processing, for marks too, and the Interpreter's clock shows the newest stamp that is not
one link's word alone (:mod:`sessions.agreed_time`), in both cases. So nothing can be understood live that the
recording does not say.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from drivers.camera.packet import picture_of
from drivers.links import Datagram
from sessions.agreed_time import AgreedTime
from sessions.instruments import BaseReading, Decoder, FrameReading, HandReading
from sessions.mark_outcomes import Outcome
from sessions.marks import Mark
from sessions.perception import Perception
from sessions.recorder import Recorder
from tactile_lab.clock import VirtualClock
from tactile_lab.errors import CodecError

HAND_LINK, BASE_LINK, CAMERA_LINK = "hand", "base", "camera"


def fingertip_link(finger: str) -> str:
    """Name of the link of a fingertip's own sensor."""
    return f"ft/{finger}"


@dataclass(frozen=True)
class Heard:
    """A sample and its arrival."""

    stamp_ns: int
    sample: Any


class Interpreter:
    """Decodes received datagrams and feeds Perception.

    Args:
        perception: a fresh one.
        hand, base: decoders of those links.
        wrenches: decoders of the fingertips' own links, by finger; empty when the hand carries their data.
        camera: decoder of camera frames, if the rig has a camera.
        clock: the clock the decoders were built with; it follows the stamps.
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
        self.clock, self.time = clock or VirtualClock(), AgreedTime()
        self.newest: dict[str, Heard] = {}
        """The newest sample of each link that gave one, and when it came."""
        self.undecodable: Counter[str] = Counter()
        """Datagrams that broke their protocol, by link."""
        self.listener: Callable[[str, Any], None] | None = None
        """Is told every sample with the name of its link, after Perception."""
        self._routes: dict[str, Callable[[Datagram], None]] = {
            HAND_LINK: self._route(HAND_LINK, hand, perception.on_hand),
            BASE_LINK: self._route(BASE_LINK, base, perception.on_base),
        }
        for finger, decoder in (wrenches or {}).items():
            link = fingertip_link(finger)
            self._routes[link] = self._route(link, decoder, _for_finger(perception, finger))
        if camera is not None:
            self._routes[CAMERA_LINK] = self._route(CAMERA_LINK, camera, perception.on_frame)

    def received(self, link: str, payload: bytes, stamp_ns: int) -> None:
        """Take one received datagram. Bytes that break the protocol are counted; links not known are left alone."""
        self.time.received(link, stamp_ns)
        self.clock.sleep_until_ns(self.time.now_ns)
        route = self._routes.get(link)
        if route is None:
            return
        try:
            route(Datagram(payload, stamp_ns))
        except CodecError:
            self.undecodable[link] += 1

    def mark(self, mark: Mark) -> Outcome | None:
        """Take one mark; see :meth:`Perception.mark`."""
        self.time.stamped(mark.stamp_ns)
        self.clock.sleep_until_ns(self.time.now_ns)
        return self.perception.mark(mark)

    def _route(self, link: str, decoder: Decoder[Any], take: Callable[[Any], None]) -> Callable[[Datagram], None]:
        def route(datagram: Datagram) -> None:
            sample = decoder.receive(datagram)
            if sample is None:
                return
            if not (isinstance(sample, list) and not sample):  # a message may hold no reading
                self.newest[link] = Heard(datagram.stamp_ns, sample)
            take(sample)
            if self.listener is not None:
                self.listener(link, sample)

        return route


def _for_finger(perception: Perception, finger: str) -> Callable[[Sequence[Any]], None]:
    def take(samples: Sequence[Any]) -> None:
        perception.on_wrench(finger, samples)

    return take


class Observer:
    """The tap of a live session: record first, then interpret.

    When recording fails, the error is raised once, where it happened, and ends the session. The links stay usable
    after that, unrecorded, so that zero demands still reach the hand; marks are refused.
    """

    def __init__(self, recorder: Recorder, interpreter: Interpreter) -> None:
        self.recorder, self.interpreter = recorder, interpreter

    def transmitted(self, link: str, payload: bytes, stamp_ns: int) -> None:
        """The program sends; recorded only."""
        if not self.recorder.broken:
            self.recorder.transmitted(link, payload, stamp_ns)

    def received(self, link: str, payload: bytes, stamp_ns: int) -> None:
        """A device sent."""
        if not self.recorder.broken:
            self.recorder.received(link, payload, stamp_ns)
            if link == CAMERA_LINK and (picture := picture_of(payload)):
                self.recorder.image(stamp_ns, picture)
        self.interpreter.received(link, payload, stamp_ns)

    def mark(self, mark: Mark) -> Outcome | None:
        """The conductor meant something."""
        self.recorder.mark(mark)
        return self.interpreter.mark(mark)
