"""What 10 000 sessions of four grasps cost in cores, hours and bytes, from a few that are made.

python -m tests.support.session_costs --store

Two kinds: whole sessions of the simulated rig (physics, recording, estimation, report), by ``sweep``; and contacts
simulated without physics, by an experiment. Each command is a process of its own, its start included.
"""

from __future__ import annotations

import resource
import subprocess
import sys
import tempfile
from dataclasses import dataclass
from pathlib import Path

from tests.support.stored_table import GrowingTable, Outline, parser

MANY, CORES = 10_000, 16


@dataclass(frozen=True)
class Kind:
    """A kind of session, and the command that makes some.

    Attributes:
        words: of the command, but for ``--out``.
        sessions: that it makes.
    """

    words: tuple[str, ...]
    sessions: int


KINDS = {
    "simulated rig": Kind(("sweep", "--objects", "box-10x6x4,l-block,cylinder", "--seeds", "11", "--grasps", "4"), 6),
    "contacts without physics": Kind(
        (
            *("experiment", "methods-2d", "--grasps", "4", "--seeds", "11-12"),
            *("--only", "method=joint", "--only", "noise=100", "--only", "outliers=0"),
        ),
        16,
    ),
}

OUTLINE = Outline(
    "session-costs",
    "What 10 000 sessions of four grasps cost in processor time and bytes, by a few of them.",
    ("python -m tests.support.session_costs --store",),
    "Processor time of the whole command with one process at a time, bytes of all that it leaves in its folder, both "
    "multiplied to 10 000 sessions; hours on 16 cores by 85 % of their time. "
    + " ".join(f"{name}: `tactile-lab {' '.join(kind.words)} --jobs 1`." for name, kind in KINDS.items()),
    ("Sessions of", "Made", "Processor s each", "MB each", "10 000: core hours", "Hours on 16 cores", "GB"),
)


def cost(kind: Kind) -> tuple[float, float]:
    """Processor seconds and bytes of a session."""
    with tempfile.TemporaryDirectory() as folder:
        before_s = _children_s()
        words = [sys.executable, "-m", "tactile_lab", *kind.words, "--jobs", "1", "--no-input", "--out", folder]
        subprocess.run(words, check=True, stdout=subprocess.DEVNULL)
        size = sum(file.stat().st_size for file in Path(folder).rglob("*") if file.is_file())
        return (_children_s() - before_s) / kind.sessions, size / kind.sessions


def _children_s() -> float:
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    return used.ru_utime + used.ru_stime


def main() -> None:
    """Make the table."""
    table = GrowingTable(parser(__doc__).parse_args().docs, OUTLINE, [(name,) for name in KINDS])
    for (name,) in table.missing:
        seconds, size = cost(KINDS[name])
        hours = seconds * MANY / 3600
        figures = (f"{seconds:.2f}", f"{size / 1e6:.3f}", f"{hours:.1f}", f"{hours / CORES / 0.85:.1f}")
        table.put((name,), (str(KINDS[name].sessions), *figures, f"{size * MANY / 1e9:.2f}"))
    table.publish()


if __name__ == "__main__":
    main()
