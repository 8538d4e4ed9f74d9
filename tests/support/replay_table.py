"""Sessions of all rigs and objects of the catalogue, replayed: the same samples, the same results, and how fast.

python -m tests.support.replay_table --into docs/results.md
python -m tests.support.replay_table --into docs/results.md --rigs sim-wire --objects cylinder,sphere --grasps 1
"""

from __future__ import annotations

import argparse
import gc
import struct
import tempfile
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, fields, is_dataclass
from hashlib import sha256
from pathlib import Path
from typing import Any
from unittest.mock import patch

import numpy as np

from drivers.simulation.objects import CATALOGUE
from sessions.interpreter import Interpreter
from sessions.progress import NullProgress
from sessions.session import Session
from sessions.session_outcome import Ending
from tactile_lab.errors import SessionError, TactileLabError
from tactile_lab.rigs import build, wired_bench
from tactile_lab.rigs.description import load_rig
from tactile_lab.workflow import replaying
from tactile_lab.workflow.judging import differing_files
from tactile_lab.workflow.running import SessionRequest, run_session
from tests.support.results_section import GrowingTable

Listener = Callable[[str, Any], None]

_UNTRACKED = 1000
"""Samples after which the garbage collector is told to leave alone what there is."""
RIGS = "sim,sim-biotac,sim-wire,sim-wire-biotac"
HEAD = """## Replay of all rigs and objects

`python -m tests.support.replay_table --into docs/results.md`: a session of two grasps, seed 1, for every rig and
object (on wires of one, the first box of two, in real time: `--rigs sim-wire,sim-wire-biotac --grasps 1`), and its
replay as fast as possible. Samples: all that the decoders gave, in order, compared bit by bit. Results: trajectory,
contacts, contour or surface, and the estimation's own record, compared byte by byte.

| Rig | Object | Samples | Are the same | Results | Bytes read, times the original pace |
|---|---|---:|---|---|---:|
"""


def bits(value: Any) -> bytes:
    """Everything in a sample, as bytes."""
    if isinstance(value, np.ndarray):
        return value.tobytes()
    if is_dataclass(value):
        return b"".join(bits(getattr(value, field.name)) for field in fields(value))
    if isinstance(value, (list, tuple)):
        return b"".join(map(bits, value))
    return struct.pack("<d", value) if isinstance(value, float) else repr(value).encode()


class Digest:
    """Number and digest of samples, by the order in which they were understood."""

    def __init__(self) -> None:
        self.count, self._digest = 0, sha256()

    def take(self, link: str, sample: Any) -> None:
        """One sample of a link."""
        self.count += 1
        self._digest.update(link.encode() + bits(sample))

    @property
    def value(self) -> tuple[int, str]:
        """What two equal sequences of samples have in common."""
        return self.count, self._digest.hexdigest()


class Kept:
    """The samples of a running session, digested when it is over: a session on wires has no time to spare for it.

    A replay's samples are digested one by one, so that a sample which changed after it was given shows as a difference.
    """

    def __init__(self) -> None:
        self._samples: list[tuple[str, Any]] = []

    def take(self, link: str, sample: Any) -> None:
        """One sample of a link."""
        self._samples.append((link, sample))
        if len(self._samples) % _UNTRACKED == 0:
            gc.freeze()  # or the collector would go through all of them again and again, in the middle of a cycle

    def digested(self) -> Digest:
        """The digest of all of them, which are let go."""
        gc.unfreeze()
        digest, samples, self._samples = Digest(), self._samples, []
        for link, sample in samples:
            digest.take(link, sample)
        return digest


@contextmanager
def listening(module: Any, take: Listener) -> Iterator[None]:
    """Hear all samples of the interpreters that a module builds meanwhile."""
    make = module.build_interpreter

    def heard(*arguments: Any) -> Interpreter:
        interpreter: Interpreter = make(*arguments)
        interpreter.listener = take
        return interpreter

    with patch.object(module, "build_interpreter", heard):
        yield


@dataclass(frozen=True)
class Replayed:
    """A session and its replay, compared."""

    samples: int
    same_samples: bool
    differing: tuple[str, ...]
    factor: float

    def cells(self) -> tuple[str, ...]:
        """As cells of the table."""
        results = "identical" if not self.differing else f"differ: {', '.join(self.differing)}"
        return str(self.samples), "yes" if self.same_samples else "NO", results, f"{self.factor:.1f}"


def compare(rig: str, object_name: str, grasps: int, root: Path) -> Replayed:
    """Run a session and replay it. Raises TactileLabError, also for a session that ended early."""
    request = SessionRequest(rig, object_name, root, seed=1, grasps=grasps)
    kept, again = Kept(), Digest()
    with listening(_builder(rig), kept.take):
        finished = run_session(request, NullProgress())
    if finished.outcome is None or finished.outcome.ending is not Ending.COMPLETE:
        raise SessionError(finished.outcome.reason if finished.outcome else finished.problem)
    live, session = kept.digested(), Session.open(finished.folder)
    out = session.folder / "replay"
    with listening(replaying, again.take):
        replayed = replaying.replay_session(
            session, replaying.recorded_slam(session), replaying.recorded_seed(session), out
        )
    differing = tuple(differing_files(session.results, out))
    return Replayed(live.count, live.value == again.value, differing, replayed.read_factor or 0.0)


def _builder(rig: str) -> Any:
    """The module that builds the interpreter of a running session."""
    return wired_bench if load_rig(rig).description.wires is not None else build


def run(table: GrowingTable, rigs: list[str], objects: list[str], grasps: int) -> None:
    """Run sessions and replay them; one that fails is a row with its reason."""
    for rig in rigs:
        for name in objects:
            with tempfile.TemporaryDirectory() as root:
                try:
                    cells = compare(rig, name, grasps, Path(root)).cells()
                except TactileLabError as error:
                    cells = ("", "", f"failed: {error}", "")
            table.put((rig, name), cells)


def main() -> None:
    """Print the table, or write it into a document row by row."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--into", type=Path)
    parser.add_argument("--rigs", default=RIGS)
    parser.add_argument("--objects", default=",".join(CATALOGUE))
    parser.add_argument("--grasps", type=int, default=2)
    chosen = parser.parse_args()
    keys = [(rig, name) for rig in RIGS.split(",") for name in CATALOGUE]
    table = GrowingTable(chosen.into, "replays", HEAD, keys)
    run(table, chosen.rigs.split(","), chosen.objects.split(","), chosen.grasps)


if __name__ == "__main__":
    main()
