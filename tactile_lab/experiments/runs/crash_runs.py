"""One failure of a recording under full load, from a cell to its figures.

The load runs in a separate process and is killed, or loses its disk. A shared file records which messages it had passed
to the recorder; the recovered session is compared with it, message by message.
"""

from __future__ import annotations

import json
import os
import random
import signal
import subprocess
import tempfile
import time
from collections import Counter
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any

from drivers.core.child_process import child_command, child_environment
from drivers.core.errors import SessionError
from sessions.recording.recovery import recover
from sessions.recording.session import Session
from tactile_lab.experiments.cells import Cell
from tactile_lab.experiments.data.recorder_load import (
    STREAMS,
    LoadSettings,
    LoadStatus,
    TICK_ns,
    number_of,
    read_status,
    read_tick_time_ns,
    tick_of,
)

KILL, KILL_LOADED, FULL, READ_ONLY, STALL, AHEAD, BACK = (
    "kill -9",
    "kill -9, loaded machine",
    "full disk",
    "read-only folder",
    "disk stalled for 3 s",
    "clock 1 s ahead",
    "clock 1 s back",
)
FAULTS = (KILL, KILL_LOADED, FULL, READ_ONLY, STALL, AHEAD, BACK)
ALLOWED_LOSS_ms = 100.0

_LONGEST_s = 60.0
_PATIENCE_s = 1200.0
"""On a machine with much to do a program takes minutes to load."""

_TMPFS_BYTES = 3_000_000
_JUMP_ns = 1_000_000_000


def needs_root() -> str:
    """The faults that an ordinary user cannot cause, as text."""
    return "" if os.geteuid() == 0 else "a full disk and a read-only one, which only root can mount"


def faults_here() -> list[str]:
    """The faults that can be caused on this machine."""
    return [fault for fault in FAULTS if not needs_root() or fault not in (FULL, READ_ONLY)]


def crash_and_recover(cell: Cell) -> dict[str, Any]:
    """Cause a failure at a time that follows from the seed. Cell: fault, one of :data:`FAULTS`.

    Raises:
        SessionError: the recording could not be recovered, lost something from before the last flush, or more than
            a tenth of a second after it.
    """
    fault = cell["fault"]
    instant_s = random.Random(cell.seed).uniform(0.0 if fault == KILL_LOADED else 0.3, 2.0)
    with tempfile.TemporaryDirectory() as folder:
        return _TRIALS[fault](Path(folder), instant_s)


# --- the failures -------------------------------------------------------------------------------------------------


def _kill(folder: Path, instant_s: float) -> dict[str, Any]:
    load = _Load(folder, LoadSettings(seconds=_LONGEST_s))
    try:
        load.wait_for_tick(round(1000 * instant_s))
        load.process.send_signal(signal.SIGKILL)
    finally:
        load.end()
    return _figures(load)


def _kill_loaded(folder: Path, instant_s: float) -> dict[str, Any]:
    """As :func:`_kill`, on a machine with more to do than it has cores, from the first tick on."""
    load = _Load(folder, LoadSettings(seconds=_LONGEST_s))
    with _busy_machine():
        try:
            load.wait_for_tick(max(1, round(1000 * instant_s)))
            load.process.send_signal(signal.SIGKILL)
            killed_ns = time.monotonic_ns()
        finally:
            load.end()
    return _figures(load, killed_ns=killed_ns)


@contextmanager
def _busy_machine() -> Iterator[None]:
    """Programs that only count, so that twice as many want to run as there are cores."""
    cores = os.cpu_count() or 1
    missing = max(0, 2 * cores - round(os.getloadavg()[0]))
    busy = [subprocess.Popen(["sh", "-c", "while :; do :; done"]) for _ in range(missing)]
    try:
        yield
    finally:
        for process in busy:
            process.kill()
            process.wait()


def _full_disk(folder: Path, instant_s: float) -> dict[str, Any]:
    with _tmpfs(folder / "disk", f"size={_TMPFS_BYTES}"):
        load = _Load(folder, LoadSettings(seconds=_LONGEST_s))
        load.wait()
        _expect(load.told, "the disk is full")
        (session,) = load.sessions()
        status = Session.open(session).manifest.status if (session / "session.yaml").is_file() else "open"
        return {**_figures(load, recover_into=folder), "closed": float(status == "failed")}


def _read_only(folder: Path, instant_s: float) -> dict[str, Any]:
    with _tmpfs(folder / "disk", "size=1m,ro"):
        load = _Load(folder, LoadSettings(seconds=_LONGEST_s))
        load.wait()
        _expect(load.told, "Read-only file system")
    return dict.fromkeys(("recovered", "lost", "lost_ms", "hand_ms", "ft_ms", "camera_ms", "write_ms", "late"), 0)


def _stall(folder: Path, instant_s: float) -> dict[str, Any]:
    settings = LoadSettings(seconds=instant_s + 4.0, stall_tick=round(1000 * instant_s), stall_s=3.0)
    load = _Load(folder, settings)
    load.wait()
    return _figures(load)


def _jump(folder: Path, instant_s: float, jump_ns: int) -> dict[str, Any]:
    settings = LoadSettings(seconds=instant_s + 2.0, jump_tick=round(1000 * instant_s), jump_ns=jump_ns)
    load = _Load(folder, settings)
    load.wait()
    return _figures(load)


_TRIALS: dict[str, Callable[[Path, float], dict[str, Any]]] = {
    KILL: _kill,
    KILL_LOADED: _kill_loaded,
    FULL: _full_disk,
    READ_ONLY: _read_only,
    STALL: _stall,
    AHEAD: lambda folder, instant_s: _jump(folder, instant_s, _JUMP_ns),
    BACK: lambda folder, instant_s: _jump(folder, instant_s, -_JUMP_ns),
}


# --- the load ------------------------------------------------------------------------------------------------------


class _Load:
    """The load's process; its sessions are in ``disk`` in the folder."""

    def __init__(self, folder: Path, settings: LoadSettings) -> None:
        self.settings, self.told = settings, ""
        self._root, self._status = folder / "disk", folder / "status"
        self._root.mkdir(exist_ok=True)
        words = (str(self._root), str(self._status), json.dumps(asdict(settings)))
        command = child_command("tactile_lab.experiments.data.recorder_load", *words)
        self.process = subprocess.Popen(command, stderr=subprocess.PIPE, text=True, env=child_environment())

    def wait_for_tick(self, tick: int) -> None:
        """Wait until this many milliseconds of load are recorded. Raises SessionError."""
        give_up = time.monotonic() + _PATIENCE_s
        while self.status().ticks < tick:
            if self.process.poll() is not None or time.monotonic() > give_up:
                raise SessionError(f"the load did not get under way: {self.end()}", where="full load")
            time.sleep(0.002)

    def wait(self) -> None:
        """Wait until it ends by itself."""
        try:
            self.told = self.process.communicate(timeout=_PATIENCE_s)[1]
        finally:
            self.end()

    def end(self) -> str:
        """Make sure that it has ended; returns what it printed."""
        if self.process.poll() is None:
            self.process.kill()
        if self.process.stderr is not None and not self.process.stderr.closed:
            self.told = self.process.communicate()[1] or ""
        return self.told

    def status(self) -> LoadStatus:
        """Its progress."""
        return read_status(self._status) if self._status.is_file() else LoadStatus(0, 0, 0, False, {})

    def age_ms(self, tick: int, now_ns: int) -> float:
        """Real time between the beginning of a tick and a later moment."""
        return (now_ns - read_tick_time_ns(self._status, tick)) / 1e6

    def sessions(self) -> list[Path]:
        """Folders of its sessions."""
        return sorted(self._root.iterdir())


@contextmanager
def _tmpfs(folder: Path, options: str) -> Iterator[None]:
    """A small file system. Raises SessionError where it cannot be mounted."""
    folder.mkdir()
    words = ["mount", "-t", "tmpfs", "-o", options, "tmpfs", str(folder)]
    done = subprocess.run(words, capture_output=True, text=True, check=False)
    if done.returncode:
        raise SessionError(f"cannot be mounted ({done.stderr.strip()})", where=str(folder))
    try:
        yield
    finally:
        subprocess.run(["umount", "-l", str(folder)], check=True)


def _expect(told: str, words: str) -> None:
    if words not in told:
        raise SessionError(f"the load said {told!r}, not {words!r}", where="full load")


# --- the recovered session
# ------------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class _Found:
    """The part of the load that is in a recording.

    Attributes:
        counts: number of messages by stream; they are the first ones of each stream, in order and unchanged.
        drops, late: messages that the recorder reports as dropped, and messages that were late.
    """

    counts: Counter[str]
    drops: int
    late: int


def _figures(load: _Load, recover_into: Path | None = None, killed_ns: int | None = None) -> dict[str, Any]:
    """Recover the only session of a load and compare, message by message.

    Args:
        killed_ns: monotonic time of the kill; the loss is then counted in real time, by which a load on a busy machine
            is late.

    Raises:
        SessionError: see :func:`crash_and_recover`.
    """
    (session,) = load.sessions()
    recovery = recover(session, recover_into)
    found, status = _read(recovery.folder or session), load.status()
    losses = {stream: _lost_ms(load, status, stream, found.counts[stream]) for stream in STREAMS}
    worst = max(losses.values())
    if killed_ns is not None and worst:
        first = min(tick_of(one, found.counts[one]) for one, ms in losses.items() if ms)
        worst = load.age_ms(first, killed_ns)
    full = "full" in load.told  # the lost end is then what did not fit, plus what arrived until this was noticed
    if worst > ALLOWED_LOSS_ms and not full:
        raise SessionError(f"{worst:.0f} ms lost at the end", where=str(session))
    return {
        "recovered": sum(found.counts.values()),
        "lost": sum(status.counts[stream] - found.counts[stream] for stream in STREAMS),
        "lost_ms": worst,
        "hand_ms": max(losses["hand/rx"], losses["hand/tx"]),
        "ft_ms": max(ms for stream, ms in losses.items() if stream.startswith("ft/")),
        "camera_ms": losses["camera/rx"],
        "write_ms": status.longest_write_us / 1000,
        "drops": found.drops,
        "late": found.late,
    }


def _read(folder: Path) -> _Found:
    """Raises SessionError if a message is missing between others, or differs from what was sent."""
    session = Session.open(folder)
    counts: Counter[str] = Counter()
    for message in session.traffic().messages():
        stream = message.topic.removeprefix("/link/")
        if stream not in STREAMS:
            continue
        if number_of(stream, message.data) != counts[stream]:
            raise SessionError(f"message {counts[stream]} of {stream} is missing or changed", where=str(folder))
        counts[stream] += 1
    streams = session.manifest.streams.values()
    return _Found(counts, sum(one["dropped"] for one in streams), sum(one["late"] for one in streams))


def _lost_ms(load: _Load, status: LoadStatus, stream: str, recovered: int) -> float:
    """Time from the first lost message of a stream to the end of the load; 0 if none is lost."""
    if recovered >= status.counts[stream]:
        return 0.0
    plain = replace(load.settings, jump_ns=0)
    newest = max(tick_of(other, number - 1) for other, number in status.counts.items() if number)
    return (plain.stamp_ns(newest) - plain.stamp_ns(tick_of(stream, recovered)) + TICK_ns) / 1e6
