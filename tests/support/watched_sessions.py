"""Guided sessions that others watch: what the live page and the viewers' server cost the control cycle.

python -m tests.support.watched_sessions [--rig sim-wire] [--grasps 1] [--pairs 1]

runs guided sessions in turn: nobody watches; the live page and the server for viewers are open together, one viewer
reads all topics and another one reads none of those it asked for. On rigs over wires, in real time, the lost cycles of
both are compared.
"""

from __future__ import annotations

import argparse
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from pathlib import Path

from sessions.conductor.progress import NullProgress
from sessions.guided.operator import Ask, Panel, Request, Together
from sessions.guided.simulated_operator import Cue, SimulatedOperator
from sessions.recording.session import Session
from tactile_lab.view.feed import ViewFeed
from tactile_lab.viewers.live.feed import LiveFeed
from tactile_lab.workflow.attending import Attendance
from tactile_lab.workflow.running import SessionRequest, run_session
from tests.support.repository import REPOSITORY

TOKEN = "a-token-of-the-tests-0123456789"
HERE = "127.0.0.1"
PATIENCE_s = 600.0


@dataclass
class Watched:
    """What came of a session.

    Attributes:
        folder: of the session.
        received: frames that the reading viewer has received.
        dropped: messages that page and server did not take.
    """

    folder: Path
    received: int = 0
    dropped: int = 0

    @property
    def counts(self) -> dict[str, int]:
        """Of its record: messages by topic, grasps, and cycles that ended late."""
        return dict(Session.open(self.folder).manifest.counts)

    @property
    def cycles(self) -> int:
        """Each sends the hand's motors one message."""
        return self.counts["/link/hand/tx"]


def guided(root: Path, rig: str, grasps: int, *, watched: bool, seed: int = 3) -> Watched:
    """Run a guided session, led by a simulated operator, with the estimation's cheapest method."""
    request = SessionRequest(rig, "box-10x6x4", root, method="odometry", seed=seed, grasps=grasps)
    operator = SimulatedOperator([Cue(_holds, (Request(Ask.CAPTURE),))] * grasps)
    counts: list[int] = []
    with ExitStack() as stack:
        onlookers: tuple[ViewFeed | LiveFeed, ...] = ()
        if watched:
            page = stack.enter_context(ViewFeed(HERE, 0, TOKEN, "watched"))
            live = stack.enter_context(LiveFeed(rig, HERE, 0, TOKEN, "watched"))
            onlookers = page, live
            counts = stack.enter_context(viewers(live.url))
        operators = Together(operator, *(one for one in onlookers if isinstance(one, ViewFeed)))
        attendance = Attendance(operators, True, "keys", pace=0.0, onlookers=onlookers)
        finished = run_session(request, NullProgress(), attendance)
        dropped = sum(one.dropped for one in onlookers)
    return Watched(finished.folder, sum(counts), dropped)


def _holds(panel: Panel) -> bool:
    """Whether a person may capture; waiting for a steady grasp would take half a minute."""
    return Ask.CAPTURE in panel.asks


@contextmanager
def viewers(url: str) -> Iterator[list[int]]:
    """One viewer that reads and one that does not; gives, at the end, the number of frames that the first one received.

    They have a process of their own, as everybody's have: in this one they would take the interpreter from the session.
    """
    counts: list[int] = []
    words = [sys.executable, "-m", "tests.support.live_viewers", url]
    process = subprocess.Popen(words, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True, cwd=REPOSITORY)
    try:
        yield counts
    finally:
        told, _ = process.communicate("end\n", timeout=PATIENCE_s)
        counts.append(int(told))


def main() -> None:
    """Print a line for each session."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--rig", default="sim-wire")
    parser.add_argument("--grasps", type=int, default=1)
    parser.add_argument("--pairs", type=int, default=1)
    arguments = parser.parse_args()
    print("| Watched | Cycles | Late | Share | Frames to the viewer that reads | Not sent |\n|---|---|---|---|---|---|")
    with tempfile.TemporaryDirectory() as folder:
        for watched in [False, True] * arguments.pairs:
            ran = guided(Path(folder), arguments.rig, arguments.grasps, watched=watched)
            cycles, late = ran.cycles, ran.counts["overruns"]
            told = ("yes" if watched else "no", cycles, late, f"{late / cycles:.2%}", ran.received, ran.dropped)
            print(f"| {' | '.join(map(str, told))} |", flush=True)


if __name__ == "__main__":
    main()
