"""Hostile files of every kind that the program reads: what each costs, and what is said about it.

    python -m tests.support.hostile_table --store
    python -m tests.support.hostile_table --only mesh

Each is read by the command line in a process of its own. Processor time is what counts: on a quiet core it is how long
the command takes.
"""

from __future__ import annotations

import json
import os
import resource
import subprocess
import tempfile
import traceback
from collections.abc import Iterator
from dataclasses import dataclass
from functools import partial
from pathlib import Path

from drivers.core.child_process import child_command, child_environment
from tests.support.forked_program import side_by_side
from tests.support.low_rig import low_rig
from tests.support.stored_table import GrowingTable, Outline, parser

MOST_s, MOST_MB = 5.0, 1000.0
_ENOUGH_s = 60
_SHOWN = 160
OUTLINE = Outline(
    "hostile-files",
    "Files that nobody should have to read: what each costs, and what is said about it.",
    ("python -m tests.support.hostile_table --store",),
    f"The whole command, in seconds of processor time, loading the program included; largest resident memory. "
    f"Asked for: at most {MOST_s:g} s and {MOST_MB:g} MB each, no traceback. Long messages are cut here.",
    ("File", "What is wrong with it", "Command", "Exit code", "s", "MB", "Said"),
    keys=2,
)


@dataclass(frozen=True)
class Command:
    """One file, and the words that have it read in its folder."""

    kind: str
    name: str
    words: list[str]
    shown: str
    folder: Path

    @property
    def key(self) -> tuple[str, str]:
        """Of its row."""
        return self.kind, self.name


@dataclass(frozen=True)
class Outcome:
    """What a command made of a file.

    Attributes:
        code: exit code; negative for a signal.
        processor_s: processor time of its processes.
        memory_MB: largest resident memory of one of them.
        said: last line on standard error.
        traceback: whether there was one.
    """

    code: int
    processor_s: float
    memory_MB: float
    said: str
    traceback: bool

    @property
    def wrong(self) -> str:
        """What was asked for and is not so; "" if all is."""
        found = {
            "a traceback": self.traceback,
            "an error of the program": "the program itself failed" in self.said,
            "ended by a signal": self.code < 0,
            "no word": not self.said,
            f"more than {MOST_s:g} s": self.processor_s > MOST_s,
            f"more than {MOST_MB:g} MB": self.memory_MB > MOST_MB,
        }
        return ", ".join(words for words, is_so in found.items() if is_so)


def read(command: Command) -> Outcome:
    """Run a command, on a processor time that it cannot use up honestly."""
    told = command.folder / "said"
    with told.open("w") as said:
        process = subprocess.Popen(
            child_command("tactile_lab.cli.main", *command.words),
            cwd=command.folder,
            env=child_environment(),
            stdin=subprocess.DEVNULL,
            stdout=subprocess.DEVNULL,
            stderr=said,
            preexec_fn=_bound_time,  # there are no other threads
        )
        _, status, used = os.wait4(process.pid, 0)
    text = told.read_text(errors="replace")
    lines = [line for line in text.splitlines() if line.strip()]
    shown = (lines[-1] if lines else "").replace(str(command.folder) + "/", "")
    seconds = used.ru_utime + used.ru_stime
    return Outcome(os.waitstatus_to_exitcode(status), seconds, used.ru_maxrss / 1e3, shown, "Traceback" in text)


def _bound_time() -> None:
    resource.setrlimit(resource.RLIMIT_CPU, (_ENOUGH_s, _ENOUGH_s))


def row(command: Command) -> tuple[str, ...]:
    """What is outside of the bounds, then one line of the table behind its keys."""
    outcome = read(command)
    said = outcome.said if len(outcome.said) <= _SHOWN else outcome.said[:_SHOWN] + " ..."
    said = said.replace("|", "/").encode("ascii", "backslashreplace").decode()
    return (
        outcome.wrong,
        command.shown,
        str(outcome.code),
        f"{outcome.processor_s:.1f}",
        f"{outcome.memory_MB:.0f}",
        said,
    )


# --- the files: made by another process, whose memory does not count ----------------------------------------------


def make_all(root: Path, only: str, session: Path | None) -> list[Command]:
    """Make all files, each in a folder of its own, and give the commands that read them."""
    index, maker = root / "index.json", os.fork()
    if maker == 0:
        try:
            index.write_text(json.dumps(list(_make(root, only, session or sound_session(root)))))
        except BaseException:
            traceback.print_exc()
            os._exit(1)
        os._exit(0)
    if os.waitpid(maker, 0)[1]:
        raise AssertionError("the files could not be made")
    return [
        Command(kind, name, list(words), shown, Path(folder))
        for kind, name, words, shown, folder in json.loads(index.read_text())
    ]


def _make(root: Path, only: str, session: Path) -> Iterator[tuple[str, str, list[str], str, str]]:
    from tests.support.hostile.recordings import recording_cases
    from tests.support.hostile.shapes import shape_cases
    from tests.support.hostile.texts import text_cases

    for number, case in enumerate([*text_cases(), *shape_cases(), *recording_cases(session)]):
        if only not in f"{case.kind} {case.name}":
            continue
        folder = root / f"{number:03d}"
        folder.mkdir()
        words = [word.replace("SESSION", str(session)) for word in case.command(case.write(folder))]
        shown = " ".join(word for word in case.words if not word.startswith("--no-"))
        yield case.kind, case.name, words, shown, str(folder)


def sound_session(folder: Path) -> Path:
    """A session of one grasp, for cases to spoil."""
    words = (
        "run",
        "--rig",
        str(low_rig(folder)),
        "--grasps",
        "1",
        "--method",
        "odometry",
        "--out",
        str(folder / "runs"),
    )
    subprocess.run(
        child_command("tactile_lab.cli.main", *words), env=child_environment(), check=True, capture_output=True
    )
    (session,) = (folder / "runs").iterdir()
    return session


def main() -> None:
    """Print the table, and store it where that is asked for; exit code 1 if a bound was passed."""
    options = parser(__doc__)
    options.add_argument("--only", default="", help="Part of the kind's and the case's name.")
    options.add_argument("--session", type=Path, help="A sound session to spoil copies of; else one is recorded.")
    options.add_argument("--jobs", type=int, default=1, help="Files side by side.")
    chosen = options.parse_args()
    wrong: list[str] = []
    with tempfile.TemporaryDirectory() as root:
        commands = make_all(Path(root), chosen.only, chosen.session)
        table = GrowingTable(chosen.docs, OUTLINE, [command.key for command in commands])
        works = {command.key: partial(row, command) for command in commands}
        for key, (problem, *cells) in side_by_side(works, chosen.jobs):
            table.put(key, cells)
            if problem:
                wrong.append(f"{', '.join(key)}: {problem}")
    table.publish()
    print("\n".join([f"{len(commands)} files, {len(wrong)} outside of the bounds:", *wrong]))
    raise SystemExit(bool(wrong))


if __name__ == "__main__":
    main()
