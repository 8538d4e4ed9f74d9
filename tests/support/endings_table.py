"""Every way for a session to end, and every bad disk: what happened, what was kept, exit code, seconds.

    python -m tests.support.endings_table --store

A session of the simulated rig is struck as soon as its recording has messages. The machine's own clock is left alone:
the wall clock jumps for the session only. What a jump of the session's own clock does is in the experiment
``crash-recovery``.
"""

from __future__ import annotations

import ctypes
import errno
import os
import re
import resource
import shutil
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from contextlib import ExitStack, suppress
from dataclasses import dataclass
from datetime import datetime, timedelta, tzinfo
from functools import partial
from pathlib import Path
from typing import Self

from drivers.core.errors import TactileLabError
from sessions.recording import running_session as session_files
from sessions.recording.session import Session
from sessions.recording.traffic import disk
from tactile_lab.benchmarks.start_times import has_messages
from tests.support.forked_program import fork_program, nothing, side_by_side
from tests.support.low_rig import low_rig
from tests.support.stored_table import GrowingTable, Outline, parser
from tests.support.warm_program import load

_SLOW_bytes_per_s, _ROOM_bytes, _STALL_s = 100_000, 500_000, 15.0
_CAPABILITIES_VERSION, _SHOWN = 0x20080522, 150
_POLL_s = 0.02

OUTLINE = Outline(
    "endings",
    "Every way for a session to end, and every bad disk.",
    ("python -m tests.support.endings_table --store",),
    "A session of one grasp on the simulated rig, struck as soon as its recording has messages; bad "
    "disks are so from the beginning. "
    "Seconds from then to the end of the program, on a machine with other work. Kept: messages that can be read "
    "afterwards.",
    (
        "What happened",
        "Exit code",
        "s",
        "Status",
        "Messages kept",
        "Missing or damaged",
        "Last line on standard error",
    ),
)


class Running:
    """A session that runs.

    Attributes:
        root: the folder that its session is in.
        told: what it has said so far.
    """

    def __init__(self, folder: Path, words: list[str], *, terminal: bool, prepare: Callable[[], None]) -> None:
        self.root, self.told = folder / "runs", ""
        if terminal:
            self._ours, its = os.openpty()
            streams = (its, its, its)
        else:
            self._ours, its = os.pipe()
            streams = (os.open(os.devnull, os.O_RDWR), os.open(os.devnull, os.O_RDWR), its)
        self.process = fork_program([*words, "--out", str(self.root)], folder, streams, prepare)
        for descriptor in set(streams):
            os.close(descriptor)

    @property
    def session(self) -> Path:
        """Its folder."""
        return next(self.root.iterdir())

    def until_recorded(self) -> bool:
        """Wait until its recording has messages; False if it has ended before."""
        while not any(has_messages(path) for path in self.root.glob("*/traffic.mcap")):
            if os.waitid(os.P_PID, self.process, os.WEXITED | os.WNOHANG | os.WNOWAIT) is not None:
                return False
            time.sleep(_POLL_s)
        return True

    def send(self, number: signal.Signals) -> None:
        """A signal."""
        os.kill(self.process, number)

    def hang_up(self) -> None:
        """Nobody reads on; a terminal is gone."""
        os.close(self._ours)
        self._ours = -1

    def ended(self) -> int:
        """Read to the end; its exit code."""
        while self._ours >= 0 and self._read():
            pass
        return os.waitstatus_to_exitcode(os.waitpid(self.process, 0)[1])

    def _read(self) -> bytes:
        try:
            data = os.read(self._ours, 65536)
        except OSError:  # the other side of a terminal has gone
            data = b""
        self.told += data.decode(errors="replace")
        return data


@dataclass(frozen=True)
class Ending:
    """A way to end.

    Attributes:
        strike: what happens when the first grasp is done.
        prepare: what is done to the program before it begins.
        terminal: whether it runs on a terminal.
        words: further options.
        disk: size of a small file system to record on, as for ``mount``; "" for the usual one.
        rig: a built-in rig; "" for the simulated one, which waits for nothing.
    """

    strike: Callable[[Running], None] = lambda running: None
    prepare: Callable[[], None] = nothing
    terminal: bool = False
    words: tuple[str, ...] = ()
    disk: str = ""
    rig: str = ""


# --- what is done to it --------------------------------------------------------------------------------------------


def _signal(number: signal.Signals, times: int = 1) -> Callable[[Running], None]:
    def strike(running: Running) -> None:
        for _ in range(times):
            running.send(number)
            time.sleep(0.3)

    return strike


def _rename(running: Running) -> None:
    running.session.rename(running.root / "renamed")


def _make_read_only(running: Running) -> None:
    running.session.chmod(0o555)
    for item in running.session.rglob("*"):
        item.chmod(0o555 if item.is_dir() else 0o444)


def _without_privileges() -> None:
    """As any user: permissions of files hold for root, too."""
    header, none = (ctypes.c_uint32 * 2)(_CAPABILITIES_VERSION, 0), (ctypes.c_uint32 * 6)()
    assert ctypes.CDLL(None).capset(header, none) == 0


def _little_memory() -> None:
    """As ``ulimit -v``: a little more than is in use now."""
    pages = int(Path("/proc/self/statm").read_text().split()[0])
    limit = pages * os.sysconf("SC_PAGE_SIZE") + 50_000_000
    resource.setrlimit(resource.RLIMIT_AS, (limit, limit))


def _bad_disk(write: Callable[[disk.CutBackFile, bytes], None]) -> Callable[[], None]:
    """Each piece of a recording goes through this first."""

    def prepare() -> None:
        usual = disk.CutBackFile.write

        def through(file: disk.CutBackFile, data: bytes) -> int:
            write(file, data)
            return usual(file, data)

        disk.CutBackFile.write = through  # type: ignore[method-assign]

    return prepare


def _take_time(file: disk.CutBackFile, data: bytes) -> None:
    time.sleep(len(data) / _SLOW_bytes_per_s)


def _go_away(file: disk.CutBackFile, data: bytes) -> None:
    if file.tell() > _ROOM_bytes:
        raise OSError(errno.EIO, os.strerror(errno.EIO))


def _stand_still(file: disk.CutBackFile, data: bytes) -> None:
    if file.tell() > _ROOM_bytes:
        time.sleep(_STALL_s)


def _clock_jumps(by: timedelta) -> Callable[[], None]:
    """The wall clock is set while the session runs: it says another time whenever it is asked after the first."""

    def prepare() -> None:
        asked = 0

        class Jumping(datetime):
            @classmethod
            def now(cls, tz: tzinfo | None = None) -> Self:
                nonlocal asked
                asked += 1
                return super().now(tz) + (by if asked > 1 else timedelta())

        seconds, usual = by.total_seconds(), (time.time, time.time_ns)
        session_files.datetime = Jumping  # type: ignore[attr-defined]
        time.time = lambda: usual[0]() + (seconds if asked else 0.0)
        time.time_ns = lambda: usual[1]() + (round(1e9 * seconds) if asked else 0)

    return prepare


def _beside_another(running: Running) -> None:
    """A second session in the same folder, to its end."""
    null = os.open(os.devnull, os.O_RDWR)
    words = ["run", "--rig", str(running.root.parent / "rig.yaml"), "--grasps", "1", "--method", "odometry"]
    other = fork_program([*words, "--out", str(running.root)], running.root.parent, (null, null, null))
    os.close(null)
    assert os.waitstatus_to_exitcode(os.waitpid(other, 0)[1]) == 0


_WIRES = "sim-wire"
_GUIDED = ("--mode", "guided", "--pace", "0")
ENDINGS: dict[str, Ending] = {
    "nothing": Ending(),
    "Ctrl+C (SIGINT)": Ending(_signal(signal.SIGINT)),
    "Ctrl+C twice": Ending(_signal(signal.SIGINT, 2)),
    "SIGTERM": Ending(_signal(signal.SIGTERM)),
    "SIGHUP": Ending(_signal(signal.SIGHUP)),
    "SIGKILL": Ending(_signal(signal.SIGKILL)),
    "standard output closed": Ending(prepare=lambda: os.close(1)),
    "standard error closed by its reader": Ending(lambda running: running.hang_up()),
    "the terminal goes": Ending(lambda running: running.hang_up(), terminal=True),
    "the terminal goes, guided": Ending(lambda running: running.hang_up(), terminal=True, words=_GUIDED),
    "memory limited (ulimit -v)": Ending(prepare=_little_memory),
    "its folder removed": Ending(lambda running: shutil.rmtree(running.session)),
    "its folder renamed": Ending(_rename),
    "its folder made read-only": Ending(_make_read_only, prepare=_without_privileges),
    "another session in the same folder": Ending(_beside_another),
    "the wall clock set back by an hour": Ending(prepare=_clock_jumps(timedelta(hours=-1))),
    "the wall clock set forward by an hour": Ending(prepare=_clock_jumps(timedelta(hours=1))),
    "a disk of 100 kB/s": Ending(prepare=_bad_disk(_take_time)),
    "a disk that stands still for 15 s": Ending(prepare=_bad_disk(_stand_still)),
    "a disk that goes away": Ending(prepare=_bad_disk(_go_away)),
    "a full disk": Ending(disk="size=700k"),
    "in real time, devices on wires": Ending(rig=_WIRES),
    "the same on a disk of 100 kB/s": Ending(prepare=_bad_disk(_take_time), rig=_WIRES),
    "the same on a disk that goes away": Ending(prepare=_bad_disk(_go_away), rig=_WIRES),
    "the same on a full disk": Ending(disk="size=2500k", rig=_WIRES),
}


# --- one of them ---------------------------------------------------------------------------------------------------


def run(ending: Ending) -> tuple[str, ...]:
    """Run a session into an ending; the cells of its row."""
    with ExitStack() as stack:
        folder = Path(stack.enter_context(tempfile.TemporaryDirectory()))
        (folder / "runs").mkdir()
        if ending.disk:
            subprocess.run(["mount", "-t", "tmpfs", "-o", ending.disk, "tmpfs", str(folder / "runs")], check=True)
            stack.callback(subprocess.run, ["umount", "-l", str(folder / "runs")], check=True)
        rig = ending.rig or str(low_rig(folder))
        words = ["run", "--rig", rig, "--grasps", "1", "--seed", "1", "--method", "odometry"]
        running = Running(folder, [*words, *ending.words], terminal=ending.terminal, prepare=ending.prepare)
        begun = time.monotonic()
        if running.until_recorded():
            begun = time.monotonic()
            with suppress(OSError):
                ending.strike(running)
        code = running.ended()
        seconds = time.monotonic() - begun
        lines = [line.strip() for line in re.sub(r"\x1b\[[0-9;?]*\w", "", running.told).splitlines() if line.strip()]
        assert "Traceback" not in running.told, running.told
        assert not (folder / "traceback").exists(), (folder / "traceback").read_text()
        said = (lines[-1] if lines else "").replace(str(folder) + "/", "")
        return str(code), f"{seconds:.1f}", *kept(folder / "runs"), said[:_SHOWN].replace("|", "/")


def kept(root: Path) -> tuple[str, str, str]:
    """Status, messages that can be read, and what is missing among them, of the first session in a folder."""
    folders = sorted(root.iterdir())
    if not folders:
        return "", "0", "the whole session"
    try:
        session = Session.open(folders[0])
        reader = session.traffic()
        count = sum(1 for _ in reader.messages())
        return session.manifest.status, str(count), reader.loss.describe()
    except TactileLabError as error:
        return "", "0", str(error).replace(str(root) + "/", "")[:_SHOWN]


def main() -> None:
    """Print the table, and store it row by row where that is asked for."""
    options = parser(__doc__)
    options.add_argument("--only", default="", help="Part of the ending's name.")
    options.add_argument("--jobs", type=int, default=1, help="Sessions side by side.")
    chosen = options.parse_args()
    if os.geteuid():
        sys.exit("a small disk and a foreign folder need root")
    load()
    table = GrowingTable(chosen.docs, OUTLINE, [(name,) for name in ENDINGS])
    names = [name for name in ENDINGS if chosen.only in name]
    for name, cells in side_by_side({name: partial(run, ENDINGS[name]) for name in names}, chosen.jobs):
        table.put((name,), cells)
    table.publish()


if __name__ == "__main__":
    main()
