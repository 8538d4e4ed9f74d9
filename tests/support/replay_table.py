"""Replays sessions of all rigs and objects of the catalogue: are samples and results the same, and how fast is it?

python -m tests.support.replay_table --store
python -m tests.support.replay_table --store --rigs sim-wire --objects cylinder,sphere --grasps 1
"""

from __future__ import annotations

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

from drivers.core.errors import SessionError, TactileLabError
from drivers.simulation.objects import CATALOGUE
from sessions.conductor.progress import NullProgress
from sessions.conductor.session_outcome import Ending
from sessions.perception.interpreter import Interpreter
from sessions.recording.session import Session
from tactile_lab.rigs import build
from tactile_lab.rigs import wired_runtime as wired_runtime
from tactile_lab.rigs.description import load_rig
from tactile_lab.workflow import replaying
from tactile_lab.workflow.finishing import differing_files
from tactile_lab.workflow.running import SessionRequest, run_session
from tests.support.stored_table import GrowingTable, Outline, parser

Listener = Callable[[str, Any], None]

_UNTRACKED = 1000
"""Number of samples after which existing objects are exempted from garbage collection."""
RIGS = "sim,sim-biotac,sim-wire,sim-wire-biotac"
OUTLINE = Outline(
    "replays",
    "Sessions of every rig and object replayed from their bytes, and compared.",
    (
        "python -m tests.support.replay_table --store",
        "python -m tests.support.replay_table --store --rigs sim-wire,sim-wire-biotac --grasps 1",
    ),
    "Sessions of two grasps (one on wires, in real time), seed 1, and their replay as fast as possible. Samples: all "
    "that the decoders gave, in order, compared bit by bit. Results: trajectory, contacts, contour or surface, and the "
    "estimation's own record, compared byte by byte.",
    ("Rig", "Object", "Samples", "Are the same", "Results", "Bytes read, times the original pace"),
    keys=2,
)


def bits(value: Any) -> bytes:
    """All data in a sample, as bytes."""
    if isinstance(value, np.ndarray):
        return value.tobytes()
    if is_dataclass(value):
        return b"".join(bits(getattr(value, field.name)) for field in fields(value))
    if isinstance(value, (list, tuple)):
        return b"".join(map(bits, value))
    return struct.pack("<d", value) if isinstance(value, float) else repr(value).encode()


class Digest:
    """Number and digest of samples, in the order of their decoding."""

    def __init__(self) -> None:
        self.count, self._digest = 0, sha256()

    def take(self, transport: str, sample: Any) -> None:
        """Take one sample of a transport."""
        self.count += 1
        self._digest.update(transport.encode() + bits(sample))

    @property
    def value(self) -> tuple[int, str]:
        """A value that is the same for equal sequences of samples."""
        return self.count, self._digest.hexdigest()


class Kept:
    """Keeps the samples of a running session and digests them at its end, since a session on wires has no time to
    spare.

    A replay's samples are digested one by one, so that a sample that changed after it was returned shows as a
    difference.
    """

    def __init__(self) -> None:
        self._samples: list[tuple[str, Any]] = []

    def take(self, transport: str, sample: Any) -> None:
        """Take one sample of a transport."""
        self._samples.append((transport, sample))
        if len(self._samples) % _UNTRACKED == 0:
            gc.freeze()  # otherwise the collector would visit all of them again and again, in the middle of a cycle

    def digested(self) -> Digest:
        """The digest of all samples, which are then released."""
        gc.unfreeze()
        digest, samples, self._samples = Digest(), self._samples, []
        for transport, sample in samples:
            digest.take(transport, sample)
        return digest


@contextmanager
def listening(module: Any, take: Listener) -> Iterator[None]:
    """Receive all samples of interpreters that a module builds within this context."""
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
    """The module that builds the interpreter for a running session."""
    return wired_runtime if load_rig(rig).description.wires is not None else build


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
    """Print the table, and store it row by row if requested."""
    options = parser(__doc__)
    options.add_argument("--rigs", default=RIGS)
    options.add_argument("--objects", default=",".join(CATALOGUE))
    options.add_argument("--grasps", type=int, default=2)
    chosen = options.parse_args()
    keys = [(rig, name) for rig in RIGS.split(",") for name in CATALOGUE]
    table = GrowingTable(chosen.docs, OUTLINE, keys)
    run(table, chosen.rigs.split(","), chosen.objects.split(","), chosen.grasps)
    table.publish()


if __name__ == "__main__":
    main()
