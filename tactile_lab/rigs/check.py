"""Is a rig fit to work? Connect every device, listen for a moment, and tell what each one says. Nothing moves."""

from __future__ import annotations

from pathlib import Path

from drivers.fingertip import FingertipSensor
from drivers.simulation.objects import CATALOGUE
from sessions.bench import Bench
from sessions.recorder import NullTraffic, Recorder
from tactile_lab.clock import MonotonicClock
from tactile_lab.errors import DeviceError
from tactile_lab.geometry.contacts import FINGERS
from tactile_lab.rigs.build import build_bench, check_calibration, simulated_world
from tactile_lab.rigs.check_fingertips import check_fingertips
from tactile_lab.rigs.check_hand import check_hand
from tactile_lab.rigs.description import load_rig
from tactile_lab.rigs.findings import Finding
from tactile_lab.rigs.fingertip_rig import is_fingertip_rig, load_fingertip_rig
from tactile_lab.rigs.hand_rig import is_hand_rig, load_hand_rig

LISTEN_ns = 300_000_000


def check_rig(name: str, seed: int = 0) -> list[Finding]:
    """Findings of all devices; a device that does not connect ends the list.

    Raises:
        ConfigurationError: the rig file, or a calibration file it names.
    """
    if Path(name).suffix in {".yaml", ".yml"} and is_fingertip_rig(Path(name)):
        return check_fingertips(load_fingertip_rig(Path(name)), MonotonicClock())
    if Path(name).suffix in {".yaml", ".yml"} and is_hand_rig(Path(name)):
        return check_hand(load_hand_rig(Path(name)), MonotonicClock())
    rig = load_rig(name)
    check_calibration(rig)
    bench = build_bench(rig, simulated_world(rig, seed, next(iter(CATALOGUE))), Recorder(NullTraffic()))
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
    findings += [_fingertip(finger, bench.fingertips.get(finger)) for finger in FINGERS]
    if bench.camera is not None:
        height, width = bench.camera.capture().image.shape[:2]
        findings.append(Finding("camera", True, f"{width} x {height} pixels"))
    return findings


def _fingertip(finger: str, tip: FingertipSensor | None) -> Finding:
    """A finger without a sensor is allowed, but nobody should have to notice it by themselves."""
    if tip is None:
        return Finding(f"fingertip {finger}", True, "none: the fingertip calibration does not name it")
    return _finding(f"fingertip {finger}", tip.health(), "streams, tared")


def _finding(device: str, problems: tuple[str, ...], well: str) -> Finding:
    return Finding(device, not problems, "; ".join(problems) or well)
