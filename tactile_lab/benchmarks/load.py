"""Measures losses, processor time and memory with five force sensors at 7 kHz and the hand at 1 kHz in one run.

The boxes, the hand's slaves and the hand's own cycle each have a process; the sensors are read here. The number of
records that the boxes report as sent is compared with the number received. Run it on an idle machine.
"""

from __future__ import annotations

import os
import resource
import time
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from drivers.ati.nano17 import Nano17, Nano17Settings
from drivers.ati.wires.rdt_wire import BoxPages, RdtWire
from drivers.core.clock import NANOSECONDS, Clock, MonotonicClock
from drivers.core.contacts import FINGERS
from drivers.core.fingertip import load_fingertips
from drivers.emulators.ati.net_box_process import NetBoxProcess
from drivers.emulators.ati.net_box_unit import COUNTS_PER_UNIT
from drivers.emulators.ethercat.server import EmulatedHandProcess
from drivers.emulators.ethercat.shadow_chain import ChainSettings
from drivers.emulators.laboratory.virtual_cable import virtual_cable
from drivers.hardware.udp import UdpTransport
from drivers.shadow.device.hand_process import HandProcess
from drivers.shadow.device.hand_settings import HandSettings
from drivers.shadow.device.hand_setup import HandSetup
from drivers.shadow.device.real_time import prefer
from drivers.shadow.ethercat.hand_transport import EthercatSettings
from tactile_lab.benchmarks.wire import CALIBRATION, CYCLE_s

RATE_Hz = 7000
PORT = 49152
_READ_s = 0.005
_LAST_s = 0.2
_MEMORY_s = 1.0
_WARM_UP_share = 0.2


@dataclass(frozen=True)
class LoadRow:
    """Messages of one device.

    Attributes:
        device: finger or hand.
        sent, received, lost: messages; for the hand: cycles, statuses and lost cycles.
        detail: further information for people.
    """

    device: str
    sent: int
    received: int
    lost: int
    detail: str


@dataclass(frozen=True)
class LoadResult:
    """The results of one run.

    Attributes:
        seconds: duration.
        rows: one per device.
        reader_share, boxes_share: processor load of this process and of the boxes' process, 1 being one core.
        memory_MB: resident memory of this process at the end.
        memory_slope_MB_per_min: its growth over the run after warming up, by least squares.
        hand: the hand's punctuality as text; "" without a hand.
    """

    seconds: float
    rows: tuple[LoadRow, ...]
    reader_share: float
    boxes_share: float
    memory_MB: float
    memory_slope_MB_per_min: float
    hand: str


def measure_load(seconds: float, *, with_hand: bool = True) -> LoadResult:
    """Run all devices at the same time.

    Args:
        seconds: duration.
        with_hand: whether to include the hand, which needs a virtual cable.

    Raises:
        DeviceError: an address is in use, or no virtual cable can be created; the message says what to do.
    """
    clock = MonotonicClock()
    if not with_hand:
        with prefer():
            return _measure(seconds, clock, None)
    near, far = f"tld{os.getpid()}", f"tle{os.getpid()}"
    chain = ChainSettings(eeprom="mapped")
    with virtual_cable(near, far), EmulatedHandProcess(far, CALIBRATION / "joints.yaml", chain):
        process = HandProcess(_hand(near))
        process.connect()
        try:
            with prefer():
                return _measure(seconds, clock, process)
        finally:
            process.close()


def _hand(interface: str) -> HandSetup:
    return HandSetup(
        ethercat=EthercatSettings(interface=interface),
        hand=HandSettings(cycle_s=CYCLE_s),
        joints=CALIBRATION / "joints.yaml",
        motors=CALIBRATION / "motors.yaml",
    )


def _measure(seconds: float, clock: Clock, hand: HandProcess | None) -> LoadResult:
    hosts = [f"127.0.7.{number}" for number in range(1, len(FINGERS) + 1)]
    boxes = NetBoxProcess(hosts, RATE_Hz, PORT)
    with boxes:
        sensors = [
            _sensor(finger, host, port, clock)
            for finger, host, port in zip(FINGERS, hosts, boxes.http_ports, strict=True)
        ]
        try:
            for number, sensor in enumerate(sensors):
                sensor.connect()
                for streaming in sensors[: number + 1]:  # empty the buffers while the others connect
                    _take(streaming)
            began, boxes_began = _own_seconds(), _seconds_of(boxes.process_id)
            memory = _run(seconds, clock, sensors, hand)
            reader, served = _own_seconds() - began, _seconds_of(boxes.process_id) - boxes_began
            words = [", ".join(sensor.health()) for sensor in sensors]
            report = hand.report() if hand else None
            _stop(sensors)
        finally:
            for sensor in sensors:
                sensor.close()
    rows = [
        LoadRow(sensor.finger, sent, sensor.sequences.seen, sensor.sequences.lost, told)
        for sensor, sent, told in zip(sensors, boxes.sent, words, strict=True)
    ]
    punctual = ""
    if report is not None:
        counts, cycle = report["hand"], report["punctuality"]
        rows.append(LoadRow("hand", counts["cycles"], counts["cycles"] - counts["lost"], counts["lost"], ""))
        punctual = (
            f"{cycle['cycles']} cycles, {cycle['left_out']} left out, started late by {cycle['median_us']:.0f} us "
            f"(median), {cycle['p99_us']:.0f} us (99 %); {report['dropped_blocks']} blocks of traffic dropped"
        )
    slope = _slope_MB_per_min(memory)
    return LoadResult(
        seconds, tuple(rows), reader / seconds, served / seconds, memory[-1][1] if memory else 0.0, slope, punctual
    )


def _sensor(finger: str, host: str, http_port: int, clock: Clock) -> Nano17:
    pages = BoxPages(host, http_port, RATE_Hz)
    wire = RdtWire(COUNTS_PER_UNIT, COUNTS_PER_UNIT, pages)
    calibration = load_fingertips(CALIBRATION / "fingertips.yaml")[finger]
    return Nano17(finger, UdpTransport(f"ft/{finger}", host, PORT, clock), clock, calibration, Nano17Settings(), wire)


def _run(
    seconds: float, clock: Clock, sensors: Sequence[Nano17], hand: HandProcess | None
) -> list[tuple[float, float]]:
    """Read all devices for this time; returns times in seconds and resident memory in megabytes, once a second."""
    began_ns = looked_ns = clock.now_ns()
    memory: list[tuple[float, float]] = []
    while (now_ns := clock.now_ns()) - began_ns < seconds * NANOSECONDS:
        for sensor in sensors:
            _take(sensor)
        if hand is not None:
            hand.receive()
        if now_ns - looked_ns > _MEMORY_s * NANOSECONDS:
            memory.append(((now_ns - began_ns) / NANOSECONDS, _resident_MB()))
            looked_ns = now_ns
        clock.sleep_until_ns(now_ns + round(_READ_s * NANOSECONDS))
    return memory


def _take(sensor: Nano17) -> None:
    sensor.update(sensor.poll())


def _stop(sensors: Sequence[Nano17]) -> None:
    """End the streams and receive what is still in transit, so that received and sent records can be compared."""
    for sensor in sensors:
        sensor.stop_stream()
    until_ns = time.monotonic_ns() + round(_LAST_s * NANOSECONDS)
    while time.monotonic_ns() < until_ns:
        for sensor in sensors:
            _take(sensor)


def _slope_MB_per_min(memory: Sequence[tuple[float, float]]) -> float:
    """Growth of the memory after the warm-up, by least squares."""
    later = np.array(memory[round(len(memory) * _WARM_UP_share) :])
    return float(60.0 * np.polyfit(later[:, 0], later[:, 1], 1)[0]) if len(later) > 2 else 0.0


def _own_seconds() -> float:
    usage = resource.getrusage(resource.RUSAGE_SELF)
    return usage.ru_utime + usage.ru_stime


def _seconds_of(process_id: int) -> float:
    """Processor time of another process (Linux)."""
    fields = Path(f"/proc/{process_id}/stat").read_text().rpartition(")")[2].split()
    return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")


def _resident_MB() -> float:
    pages = int(Path("/proc/self/statm").read_text().split()[1])
    return pages * os.sysconf("SC_PAGE_SIZE") / 1e6
