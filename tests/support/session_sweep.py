"""Wire faults in the middle of a session: does it end properly, or go on with the fault reported and stored?

A session of one grasp runs on a simulated rig, in virtual time. From when the fingers first close, one of its
transports has one fault (:mod:`tests.support.faults`, with the message layouts of the drivers' own sweeps). Any
exception other than the program's own errors ends the sweep. A transport that is read too often means that the session
hangs.
"""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from functools import partial
from pathlib import Path
from unittest.mock import patch

from drivers.core.clock import NANOSECONDS, Clock
from drivers.core.errors import TactileLabError
from drivers.core.transports import Datagram, Transport
from drivers.simulation.world import SimulatedWorld
from sessions.conductor.session_outcome import Ending
from sessions.perception.replay import Replay
from sessions.recording.session import Session
from sessions.recording.traffic.schemas import LOG_TOPIC
from tactile_lab.rigs import laboratory
from tactile_lab.rigs.build import build_interpreter
from tactile_lab.rigs.description import rig_of_session
from tactile_lab.workflow.finishing import differing_files, has_results
from tactile_lab.workflow.replaying import recorded_seed, recorded_slam, replay_session
from tactile_lab.workflow.running import SessionRequest, run_session
from tests.support.at_phase import At
from tests.support.faults import CounterWrap, Fault, FaultyTransport, MessageLayout, When, standard_faults
from tests.unit.drivers.ati.test_nano17_sweep import TestNetBox
from tests.unit.drivers.positioner.test_positioner_sweep import TestPositioner
from tests.unit.drivers.test_device_sweeps import TestBioTacInThePalm, TestCamera, TestHand

LAYOUTS: dict[str, dict[str, MessageLayout]] = {
    "sim": {
        "hand": TestHand.layout,
        "base": TestPositioner.layout,
        "ft/MF": TestNetBox.layout,
        "camera": TestCamera.layout,
    },
    "sim-biotac": {
        "hand": TestBioTacInThePalm.layout,
        "base": TestPositioner.layout,
        "camera": TestCamera.layout,
    },
}
"""Rigs, their transports, and the message layouts that faults need."""

BLIND: dict[str, dict[str, dict[str, str]]] = {
    "sim": {
        "hand": TestHand.blind,
        "base": TestPositioner.blind,
        "ft/MF": TestNetBox.blind,
        "camera": TestCamera.blind,
    },
    "sim-biotac": {
        "hand": TestBioTacInThePalm.blind,
        "base": TestPositioner.blind,
        "camera": TestCamera.blind,
    },
}
"""Faults that devices cannot detect, and why, by rig and transport."""

STRIKES_AT = "close"
"""The phase of the session with which faults begin: the fingers close on the object."""

LONGEST_s = {"hand": 3.0, "base": 0.5, "ft/MF": 0.5, "camera": 1.5}
"""Longest time from the fault to the session's end, if it ends: 2 s in which a hand may come back, ten lost cycles of
the positioner, 0.2 s without a fingertip, a second for a picture, plus the cycles that stop the hand.
"""

UNTIL_IT_MOVES_s = {("base", "stuck value"): 5.0}
"""The same for faults that cannot be detected before the device has to move."""

HANGS_AFTER = 60_000
"""Limit for the readings of one transport; a session of one grasp needs some thousand."""


class ArmedFault(FaultyTransport):
    """A fault that strikes once it is armed, not at a number of messages.

    Attributes:
        struck_ns: when it first struck.
    """

    def __init__(self, transport: Transport, clock: Clock, fault: Fault, when: When) -> None:
        super().__init__(transport, fault, replace(when, first=0))
        self._clock, self._readings = clock, 0
        self.struck_ns: int | None = None
        self.armed = isinstance(fault, CounterWrap)  # its counters are changed from the first message on

    def receive(self) -> list[Datagram]:
        self._readings += 1
        assert self._readings < HANGS_AFTER, f"{self.name}: the session hangs"
        try:
            return super().receive()
        finally:
            if self.injected and self.struck_ns is None:
                self.struck_ns = self._clock.now_ns()


@dataclass
class Swept:
    """The outcome of a session.

    Attributes:
        struck: how often the fault struck.
        ended: why it ended, if it ended because of the fault.
        after_s: time from the first strike to the end.
        told: reports in its events and manifest that a healthy session does not have.
        lost: losses in its manifest.
        replay: result of replaying the recording.
    """

    struck: int
    ended: str
    after_s: float | None
    told: tuple[str, ...] = ()
    replay: str = ""
    lost: dict[str, int] = field(default_factory=dict)

    def check(self, transport: str, fault: str) -> None:
        """Raises AssertionError if the session took longer to end than its time-outs allow."""
        assert self.struck > 0, "the fault never struck"
        longest_s = UNTIL_IT_MOVES_s.get((transport, fault), LONGEST_s[transport])
        assert not self.ended or (self.after_s is not None and self.after_s <= longest_s), self


def faults(rig: str) -> Iterator[tuple[str, str]]:
    """Transports and names of faults of a rig."""
    for transport, layout in LAYOUTS[rig].items():
        for name in sorted(standard_faults(layout)):
            yield transport, name


def run_with(rig: str, faulty: dict[str, str], root: Path, phase: str = STRIKES_AT) -> Swept:
    """Run a session in which transports have faults, by name, from a phase of it on, and check everything it recorded.

    Raises:
        AssertionError: it hung, or its recording cannot be read or replayed.
    """
    transports: dict[str, ArmedFault] = {}
    with _faulty_world(rig, faulty, transports):
        try:
            progress = At(phase, partial(_arm, transports))
            finished = run_session(SessionRequest(rig, "box-10x6x4", root, seed=1, grasps=1), progress)
            folder, outcome, error = finished.folder, finished.outcome, None
        except TactileLabError as stopped:  # while connecting or closing; the folder tells
            folder, outcome, error = max(root.iterdir()), None, stopped
    session = Session.open(folder)
    assert session.manifest.status in ("closed", "failed"), session.manifest.status
    ended = str(error or "")
    if outcome is not None and outcome.ending is not Ending.COMPLETE:
        ended = outcome.reason
    struck_ns = min(
        (transport.struck_ns for transport in transports.values() if transport.struck_ns is not None), default=None
    )
    return Swept(
        struck=sum(transport.injected for transport in transports.values()),
        ended=ended,
        after_s=None if struck_ns is None else _stopped_after_s(session, struck_ns),
        told=tuple(_told(session)),
        replay=_replayed(session),
        lost=session.manifest.data_loss,
    )


def _arm(transports: Mapping[str, ArmedFault]) -> None:
    for transport in transports.values():
        transport.armed = True


@contextmanager
def _faulty_world(rig: str, faulty: dict[str, str], transports: dict[str, ArmedFault]) -> Iterator[None]:
    """Give the simulated rigs of this process faulty transports within this context."""
    build = laboratory.simulated_world

    def world_with_faults(*arguments: object) -> SimulatedWorld:
        world = build(*arguments)  # type: ignore[arg-type]
        given = world.transports()
        for name, fault_name in faulty.items():
            fault, when = standard_faults(LAYOUTS[rig][name])[fault_name]
            transports[name] = ArmedFault(given[name], world.clock, fault, when)
        world.transports = lambda: {**given, **transports}  # type: ignore[method-assign]
        return world

    with patch.object(laboratory, "simulated_world", world_with_faults):
        yield


def _events(session: Session) -> Iterator[tuple[int, int, str]]:
    """Stamp, level and text of a session's events."""
    for message in session.traffic().messages():
        if message.topic == LOG_TOPIC:
            content = json.loads(message.data)
            yield message.stamp_ns, content["level"], f"{content['name']}: {content['message']}"


def _stopped_after_s(session: Session, struck_ns: int) -> float | None:
    """Time from the fault to the conductor's message that it stopped; None if nothing stopped it."""
    stamps = [stamp_ns for stamp_ns, _, words in _events(session) if words.startswith("safety: stopped")]
    return (stamps[0] - struck_ns) / NANOSECONDS if stamps else None


def _told(session: Session) -> Iterator[str]:
    """Warnings of the devices with their last figures, and further losses in the manifest."""
    for _, level, words in _events(session):
        if level > 2 and "total: " in words:
            yield words.replace("total: ", "")
    lost: dict[str, list[tuple[str, int]]] = {}
    for name, number in session.manifest.data_loss.items():
        kind, _, topic = name.partition(" /")
        if kind == "lost cycles hand":  # the hand's own warning has the same number
            continue
        lost.setdefault(kind, []).append((topic, number))
    for kind, found in lost.items():
        where = f"/{found[0][0]}" if len(found) == 1 and found[0][0] else f"in {len(found)} topics"
        yield f"{sum(number for _, number in found)} {kind} {where if found[0][0] else ''}".strip()


def _replayed(session: Session) -> str:
    """Replay the recording: all of it must be readable, and results must be the same."""
    if not has_results(session):
        replay = Replay(session, build_interpreter(rig_of_session(session)))
        outcomes = sum(1 for _ in replay.outcomes())
        assert not replay.loss, replay.loss.describe()
        return f"read, {outcomes} marks"
    out = session.folder / "replay"
    finished = replay_session(session, recorded_slam(session), recorded_seed(session), out)
    assert not finished.unread, finished.unread
    differing = differing_files(session.results, out)
    assert not differing, differing
    return "identical"
