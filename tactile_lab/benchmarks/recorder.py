"""Measures the recorder under full load: dropped messages, growth of memory, and processor time."""

from __future__ import annotations

import json
import os
import subprocess
import tempfile
import time
from collections.abc import Callable
from dataclasses import asdict, dataclass
from pathlib import Path

import numpy as np

from drivers.core.child_process import child_command, child_environment
from drivers.core.errors import SessionError
from sessions.recording.session import TRAFFIC, Session
from sessions.recording.traffic.reader import segment_paths
from tactile_lab.experiments.data.recorder_load import LoadSettings, read_status

_BASELINE_s = 5.0
_PAGE_BYTES = os.sysconf("SC_PAGE_SIZE")


@dataclass(frozen=True)
class RecorderLoad:
    """Results of a run under full load.

    Attributes:
        seconds: duration of the load.
        messages: number recorded from the transports.
        dropped, gaps, missing: messages that the recorder dropped; missing sequence numbers of devices; messages that
            are not in the file.
        memory_MB: resident memory at the end.
        memory_MB_per_hour: slope of a straight line through the second half.
        cpu_percent: processor time of the load and its recorder, per cent of one core.
        recorder_cpu_percent: the recorder's part of it, by comparison with a load that records nothing.
        file_MB: size of the recording.
        longest_write_ms: longest time for passing a message to the recorder.
        late_ticks: milliseconds of load that started more than 5 ms late, a measure of how busy the machine was.
    """

    seconds: float
    messages: int
    dropped: int
    gaps: int
    missing: int
    memory_MB: float
    memory_MB_per_hour: float
    cpu_percent: float
    recorder_cpu_percent: float
    file_MB: float
    longest_write_ms: float
    late_ticks: int


def measure_recorder(seconds: float, waiting: Callable[[float], None] = lambda share: None) -> RecorderLoad:
    """Run the load in a separate process.

    Args:
        seconds: duration; the memory figures are meaningful from a few minutes on.
        waiting: called about once a second with the share that is done.

    Raises:
        SessionError: the load could not be recorded.
    """
    with tempfile.TemporaryDirectory(prefix="recorder-") as name:
        folder = Path(name)
        idle_s, _ = _run(folder, LoadSettings(_BASELINE_s, record=False), lambda share: None)
        cpu_s, memory = _run(folder, LoadSettings(seconds), waiting)
        (found,) = (item for item in folder.iterdir() if item.is_dir())
        session, status = Session.open(found), read_status(folder / "status")
        reader = session.traffic()
        messages = sum(message.topic.startswith("/link/") for message in reader.messages())
        streams = session.manifest.streams.values()
        return RecorderLoad(
            seconds=seconds,
            messages=messages,
            dropped=sum(one["dropped"] for one in streams),
            gaps=sum(one["gaps"] for one in streams),
            missing=sum(status.counts.values()) - messages,
            memory_MB=memory[-1][1] if memory else float("nan"),
            memory_MB_per_hour=_slope_per_hour(memory),
            cpu_percent=100 * cpu_s / seconds,
            recorder_cpu_percent=100 * (cpu_s / seconds - idle_s / _BASELINE_s),
            file_MB=sum(path.stat().st_size for path in segment_paths(found / TRAFFIC)) / 1e6,
            longest_write_ms=status.longest_write_us / 1000,
            late_ticks=status.late_ticks,
        )


def _run(
    folder: Path, settings: LoadSettings, waiting: Callable[[float], None]
) -> tuple[float, list[tuple[float, float]]]:
    """Processor seconds of the load itself, and its memory over time: seconds and megabytes."""
    words = (str(folder), str(folder / "status"), json.dumps(asdict(settings)))
    command = child_command("tactile_lab.experiments.data.recorder_load", *words)
    process = subprocess.Popen(command, stderr=subprocess.PIPE, text=True, env=child_environment())
    begun, memory = time.monotonic(), []
    try:
        while process.poll() is None:
            time.sleep(1.0)
            memory.append((time.monotonic() - begun, _resident_MB(process.pid)))
            waiting(min(1.0, memory[-1][0] / settings.seconds))
    finally:
        if process.poll() is None:
            process.kill()
        told = process.communicate()[1]
    if process.returncode:
        raise SessionError(told.strip() or f"exit code {process.returncode}", where="full load")
    return float((folder / "status.cpu").read_text()), [item for item in memory if item[1] > 0]


def _resident_MB(pid: int) -> float:
    try:
        return int(Path(f"/proc/{pid}/statm").read_text().split()[1]) * _PAGE_BYTES / 1e6
    except (OSError, IndexError):  # it has just ended
        return 0.0


def _slope_per_hour(memory: list[tuple[float, float]]) -> float:
    second_half = np.array(memory[len(memory) // 2 :])
    if len(second_half) < 3:
        return float("nan")
    return float(np.polyfit(second_half[:, 0], second_half[:, 1], 1)[0] * 3600)
