"""Start-up times of the program, as ratios to a Python interpreter that does nothing.

All times are measured from outside, from the start of a new process until its end, or until the first cycles of its
session are in the recording. They are written at most 80 ms of session time after the first cycle.
"""

from __future__ import annotations

import os
import struct
import subprocess
import tempfile
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from mcap.opcode import Opcode

from drivers.core.child_process import child_command, child_environment
from drivers.core.errors import SessionError
from tactile_lab.benchmarks.components import Timing, TimingTable

_REPEATS = 7
_MAGIC_BYTES, _POLL_s = 8, 0.005


@dataclass(frozen=True)
class Start:
    """One start: processor time of the process, and elapsed time, which depends on the load of the machine; seconds."""

    processor_s: float
    wall_s: float


def start_table(repeats: int = _REPEATS) -> TimingTable:
    """Medians of processor times, with the median elapsed time in the note; a first start is not counted.

    The program starts in one thread and waits for nothing, so both are equal on an idle core.

    Raises:
        SessionError: a session does not start.
    """
    cases: tuple[tuple[str, Callable[[], Start], str], ...] = (
        ("python -c pass", lambda: _run([_program()[0], "-c", "pass"]), "a Python that does nothing"),
        ("tactile-lab --help", lambda: _run(_program("--help")), "until it has ended"),
        ("tactile-lab run --help", lambda: _run(_program("run", "--help")), "until it has ended"),
        ("tactile-lab run", first_cycle, "until the first cycles on rig sim are recorded"),
    )
    rounds = [[measure() for _, measure, _ in cases] for _ in range(repeats + 1)][1:]
    columns = zip(cases, zip(*rounds, strict=True), strict=True)
    return TimingTable("Start", tuple(_timing(name, note, starts) for (name, _, note), starts in columns))


def _timing(name: str, note: str, starts: Sequence[Start]) -> Timing:
    processor_ms = 1e3 * float(np.median([start.processor_s for start in starts]))
    wall_ms = 1e3 * float(np.median([start.wall_s for start in starts]))
    return Timing(name, processor_ms, len(starts), None, f"{note}; {wall_ms:.0f} ms in all on this machine")


def first_cycle() -> Start:
    """Times from the start of ``tactile-lab run`` until its recording has messages. Raises SessionError."""
    with tempfile.TemporaryDirectory() as folder:
        begun = time.perf_counter()
        process = _start(_program("run", "--grasps", "1", "--out", folder))
        try:
            while not any(has_messages(path) for path in Path(folder).glob("*/traffic.mcap")):
                if process.poll() is not None:
                    raise SessionError(f"ended with code {process.returncode} before it began", where="tactile-lab run")
                time.sleep(_POLL_s)
        finally:
            process.kill()
        return _ended(process, begun)


def has_messages(recording: Path) -> bool:
    """Whether a recording has its first chunk; nothing is decompressed for this."""
    with recording.open("rb") as file:
        file.seek(_MAGIC_BYTES)
        while len(head := file.read(9)) == 9:
            kind, length = struct.unpack("<BQ", head)
            if kind == Opcode.CHUNK:
                return True
            file.seek(length, 1)
    return False


def _program(*words: str) -> list[str]:
    return child_command("tactile_lab.cli.main", *words)


def _run(words: list[str]) -> Start:
    begun = time.perf_counter()
    return _ended(_start(words), begun)


def _start(words: list[str]) -> subprocess.Popen[bytes]:
    return subprocess.Popen(words, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL, env=child_environment())


def _ended(process: subprocess.Popen[bytes], begun: float) -> Start:
    _, status, used = os.wait4(process.pid, 0)
    process.returncode = os.waitstatus_to_exitcode(status)
    return Start(used.ru_utime + used.ru_stime, time.perf_counter() - begun)
