"""Is a rig fit to work? Connect every device, listen for a moment, and tell what each one says. Nothing moves."""

from __future__ import annotations

from dataclasses import dataclass

from drivers.simulation.objects import CATALOGUE
from sessions.bench import Bench
from sessions.recorder import NullTraffic, Recorder
from tactile_lab.errors import DeviceError
from tactile_lab.rigs.build import build_bench, simulated_world
from tactile_lab.rigs.description import load_rig

LISTEN_ns = 300_000_000


@dataclass(frozen=True)
class Finding:
    """What one device said."""

    device: str
    ok: bool
    detail: str


def check_rig(name: str) -> list[Finding]:
    """Findings of all devices; a device that does not connect ends the list.

    Raises:
        ConfigurationError: the rig file, or a calibration file it names.
    """
    rig = load_rig(name)
    bench = build_bench(rig, simulated_world(rig, 0, next(iter(CATALOGUE))), Recorder(NullTraffic()))
    try:
        bench.connect()
        bench.run(LISTEN_ns)
        return _findings(bench)
    except DeviceError as error:
        return [Finding(error.where or "rig", False, str(error))]
    finally:
        bench.close()


def _findings(bench: Bench) -> list[Finding]:
    bench.tare()
    place = ", ".join(f"{value:.3f}" for value in bench.perception.base_q[:3])
    findings = [_finding("hand", bench.hand.health(), "answers"), Finding("base", True, f"at {place} m")]
    findings += [_finding(f"fingertip {f}", tip.health(), "streams, tared") for f, tip in bench.fingertips.items()]
    if bench.camera is not None:
        height, width = bench.camera.capture().image.shape[:2]
        findings.append(Finding("camera", True, f"{width} x {height} pixels"))
    return findings


def _finding(device: str, problems: tuple[str, ...], well: str) -> Finding:
    return Finding(device, not problems, "; ".join(problems) or well)
