"""Full load for a recorder, in a separate process: a hand and five force sensors at 1 kHz, 30 pictures per second.

It replaces a whole rig when the recorder is measured or killed. Stamp and content of message n of a stream follow from
n alone, so that every missing message can be found in the recording. The progress is kept in a small shared file, which
survives a kill.
"""

from __future__ import annotations

import argparse
import json
import mmap
import resource
import struct
import sys
import time
import zlib
from collections.abc import Callable, Iterator
from dataclasses import asdict, dataclass
from pathlib import Path

import numpy as np

from drivers.core.contacts import FINGERS
from drivers.core.errors import TactileLabError
from sessions.recording.device_stamps import rdt_stamp
from sessions.recording.recorder import NullTraffic, Recorder, TrafficSink
from sessions.recording.running_session import create_session
from sessions.recording.traffic.disk import CutBackFile
from sessions.recording.traffic.settings import TrafficSettings

TICK_ns = 1_000_000
PICTURE_TICKS = 33
STATE_TICKS = 80
HAND_TX_BYTES, HAND_RX_BYTES, PICTURE_BYTES = 70, 232, 40_000
STREAMS = ("hand/tx", "hand/rx", *(f"ft/{finger}/rx" for finger in FINGERS), "camera/rx")
_STATUS = struct.Struct(f"<{4 + len(STREAMS)}Q")
_TIME = struct.Struct("<q")
_NUMBER = struct.Struct("<QI")
_RDT = struct.Struct(">III6i")


@dataclass(frozen=True)
class LoadSettings:
    """The load to record, and the faults to inject.

    Attributes:
        seconds: duration.
        start_ns: stamp of the first tick.
        stall_tick, stall_s: from this tick on the disk accepts nothing for this time; 0 s for never.
        jump_tick, jump_ns: from this tick on the clock is ahead by this much.
        queue_bytes: size of the recorder's queue.
        record: False runs the load with a recorder that keeps nothing, for comparison.
    """

    seconds: float
    start_ns: int = 10_000_000_000
    stall_tick: int = 0
    stall_s: float = 0.0
    jump_tick: int = 0
    jump_ns: int = 0
    queue_bytes: int = 64 << 20
    record: bool = True

    def stamp_ns(self, tick: int) -> int:
        """The clock's time at a tick."""
        jump_ns = self.jump_ns if self.jump_ns and tick >= self.jump_tick else 0
        return self.start_ns + tick * TICK_ns + jump_ns


@dataclass(frozen=True)
class LoadStatus:
    """Progress of the load.

    Attributes:
        ticks: milliseconds of load completed.
        longest_write_us: longest time for passing a message to the recorder.
        late_ticks: ticks that started more than 5 ms late.
        finished: whether it ended by itself.
        counts: messages that the recorder accepted, by stream.
    """

    ticks: int
    longest_write_us: int
    late_ticks: int
    finished: bool
    counts: dict[str, int]


def read_status(path: Path) -> LoadStatus:
    """The progress of a load, or its progress when it was killed."""
    with path.open("rb") as file:
        content = file.read(_STATUS.size)
    ticks, longest, late, finished, *counts = _STATUS.unpack(content.ljust(_STATUS.size, b"\0"))
    return LoadStatus(ticks, longest, late, bool(finished), dict(zip(STREAMS, counts, strict=True)))


def read_tick_time_ns(path: Path, tick: int) -> int:
    """When a tick really began, by the monotonic clock; 0 for one that did not begin."""
    place = _STATUS.size + tick * _TIME.size
    content = path.read_bytes()[place : place + _TIME.size]
    return int(_TIME.unpack(content)[0]) if len(content) == _TIME.size else 0


def payload(stream: str, number: int) -> bytes:
    """Message ``number`` of a stream, as the load sends it."""
    if stream.startswith("ft/"):
        counter = number + 1
        return _RDT.pack(counter, 7 * counter, 0, *(number % 1000 * k for k in range(6)))
    size = {"hand/tx": HAND_TX_BYTES, "hand/rx": HAND_RX_BYTES}.get(stream, PICTURE_BYTES)
    start = number * 97 % 4096
    return _NUMBER.pack(number, zlib.crc32(stream.encode())) + _NOISE[start : start + size - _NUMBER.size]


def number_of(stream: str, data: bytes) -> int:
    """The number of a message; -1 if the load does not send such a message."""
    if len(data) < _NUMBER.size:
        return -1
    number = struct.unpack_from(">I", data)[0] - 1 if stream.startswith("ft/") else _NUMBER.unpack_from(data)[0]
    return number if 0 <= number < 1 << 40 and payload(stream, number) == data else -1


def tick_of(stream: str, number: int) -> int:
    """The tick at which message ``number`` of a stream is sent."""
    return number * PICTURE_TICKS if stream == "camera/rx" else number


_NOISE = np.random.default_rng(0).bytes(4096 + PICTURE_BYTES)


def run_load(root: Path, settings: LoadSettings, status_file: Path) -> None:
    """Record the load in a new session under ``root``.

    Raises:
        SessionError: the recording cannot be started, or failed.
        WriteError: its folder cannot be written.
    """
    status_file.write_bytes(bytes(_STATUS.size + round(1000 * settings.seconds) * _TIME.size))
    with status_file.open("r+b") as file, mmap.mmap(file.fileno(), 0) as shared:
        if not settings.record:
            _play(NullTraffic(), settings, shared)
            return
        with create_session(
            root,
            rig="load",
            rig_description={},
            object_name="none",
            settings={"load": asdict(settings)},
            stampers={f"ft/{finger}": rdt_stamp for finger in FINGERS},
            traffic_settings=TrafficSettings(
                when_full="drop", queue_bytes=settings.queue_bytes, open_file=StallingFile
            ),
        ) as session:
            _play(session.traffic_sink, settings, shared)


class _Progress:
    """The shared file: four numbers, the number of messages of each stream, then when each tick began."""

    def __init__(self, shared: mmap.mmap) -> None:
        self._shared = shared
        self.figures = [0] * (4 + len(STREAMS))

    def publish(self) -> None:
        _STATUS.pack_into(self._shared, 0, *self.figures)

    def begin(self, tick: int) -> None:
        """Note the real time of a tick."""
        _TIME.pack_into(self._shared, _STATUS.size + tick * _TIME.size, time.monotonic_ns())


def _play(sink: TrafficSink, settings: LoadSettings, shared: mmap.mmap) -> None:
    recorder, progress, begun_ns = Recorder(sink), _Progress(shared), time.monotonic_ns()
    joints = dict.fromkeys((f"J{n}" for n in range(24)), 0.1)
    for tick in range(round(1000 * settings.seconds)):
        _wait_until(begun_ns + tick * TICK_ns, progress)
        progress.begin(tick)
        if settings.stall_s and tick == settings.stall_tick:
            StallingFile.stall(settings.stall_s)
        for place, stream in _due(tick):
            _send(recorder, stream, progress.figures[4 + place], settings.stamp_ns(tick), progress)
            progress.figures[4 + place] += 1
            progress.publish()
        if tick % STATE_TICKS == 0:
            recorder.joints(settings.stamp_ns(tick), joints, {})
            recorder.loads(settings.stamp_ns(tick), dict.fromkeys(FINGERS, 0.1))
        progress.figures[0] = tick + 1
    progress.figures[3] = 1
    progress.publish()


def _due(tick: int) -> Iterator[tuple[int, str]]:
    for place, stream in enumerate(STREAMS):
        if stream != "camera/rx" or tick % PICTURE_TICKS == 0:
            yield place, stream


def _send(recorder: Recorder, stream: str, number: int, stamp_ns: int, progress: _Progress) -> None:
    transport, _, way = stream.rpartition("/")
    put: Callable[[str, bytes, int], None] = recorder.on_received if way == "rx" else recorder.on_transmitted
    content = payload(stream, number)
    before_ns = time.perf_counter_ns()
    put(transport, content, stamp_ns)
    progress.figures[1] = max(progress.figures[1], (time.perf_counter_ns() - before_ns) // 1000)


def _wait_until(deadline_ns: int, progress: _Progress) -> None:
    left_ns = deadline_ns - time.monotonic_ns()
    if left_ns > 0:
        time.sleep(left_ns / 1e9)
    elif left_ns < -5_000_000:
        progress.figures[2] += 1


class StallingFile(CutBackFile):
    """A file on a disk that accepts nothing for a while."""

    until = 0.0
    """End of the stall, monotonic time in seconds; common to all files, because they share the disk."""

    @classmethod
    def stall(cls, seconds: float) -> None:
        """Let no write and no synchronisation return for this time."""
        cls.until = time.monotonic() + seconds

    def write(self, data: bytes) -> int:
        self._wait()
        return super().write(data)

    def sync(self) -> None:
        self._wait()
        super().sync()

    def _wait(self) -> None:
        time.sleep(max(0.0, self.until - time.monotonic()))


def main() -> None:
    """Run a load with settings given as JSON; exits with 0, or with 1 and the reason on standard error."""
    parser = argparse.ArgumentParser(description="Records a synthetic full load; used by the recorder's measurements.")
    parser.add_argument("root", type=Path)
    parser.add_argument("status", type=Path)
    parser.add_argument("settings", help="LoadSettings as JSON")
    options = parser.parse_args()
    before_s = _cpu_s()
    try:
        run_load(options.root, LoadSettings(**json.loads(options.settings)), options.status)
    except TactileLabError as error:
        sys.exit(str(error))
    options.status.with_suffix(".cpu").write_text(str(_cpu_s() - before_s))


def _cpu_s() -> float:
    usage = resource.getrusage(resource.RUSAGE_SELF)
    return usage.ru_utime + usage.ru_stime


if __name__ == "__main__":
    main()
