"""Checks a rig: connects every device, reads it for a moment and reports its state. Nothing moves."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from drivers.core.clock import MonotonicClock
from drivers.core.errors import ConfigurationError, DeviceError
from drivers.positioner.kinds import CountingPositioner
from drivers.shadow.device.hand import ShadowHand
from drivers.shadow.device.hand_process import HandProcess
from drivers.shadow.device.motor_polling import load_rates
from drivers.shadow.ethercat.hand_transport import EthercatCounts
from drivers.shadow.protocol.tactile_names import TactileNames
from drivers.simulation.objects import CATALOGUE
from sessions.perception.instruments import NamedInstrument, WatchedInstrument
from sessions.perception.interpreter import BASE_LINK, CAMERA_LINK, HAND_LINK, fingertip_link
from sessions.recording.recorder import Recorder
from sessions.rig_runtime.rig_runtime import RigRuntime
from tactile_lab.rigs.build import check_calibration
from tactile_lab.rigs.checks.calibrations import check_borrowed, check_calibrations
from tactile_lab.rigs.checks.findings import Finding, told, told_losses
from tactile_lab.rigs.checks.fingertips import check_fingertips
from tactile_lab.rigs.checks.hand import ask_once, check_hand, firmware
from tactile_lab.rigs.checks.stream_watch import StreamWatch, in_words
from tactile_lab.rigs.description import Rig, load_rig
from tactile_lab.rigs.fingertip_rig import FingertipRig, is_fingertip_rig, load_fingertip_rig
from tactile_lab.rigs.hand_rig import HandRig, is_hand_rig, load_hand_rig
from tactile_lab.rigs.laboratory import open_laboratory

LISTEN_ns = 500_000_000
SETTLE_ns = 500_000_000
"""Warm-up before that: first executions take longer than a cycle."""

Figures = dict[str, float | str]


def check_rig(name: str, seed: int = 0, *, move: bool = False) -> list[Finding]:
    """Findings of all calibrations and devices; a device that does not connect ends the list.

    Raises:
        ConfigurationError: the rig file, or a calibration file it names.
    """
    path = Path(name)
    is_file = path.suffix in {".yaml", ".yml"}
    if is_file and is_hand_rig(path):
        return _hand_rig(load_hand_rig(path), move)
    if is_file and is_fingertip_rig(path):
        _refuse_to_move(name, move)
        return _fingertip_rig(load_fingertip_rig(path))
    rig = load_rig(name)
    check_calibration(rig)
    _refuse_to_move(name, move and rig.description.kind == "simulated")
    return check_calibrations(rig.own_calibrations, rig.installation) + _devices(rig, seed, move)


def _refuse_to_move(name: str, move: bool) -> None:
    if move:
        raise ConfigurationError("has no real motors to move", where=name, hint="Omit --move")


def _fingertip_rig(rig: FingertipRig) -> list[Finding]:
    found = check_fingertips(rig, MonotonicClock())
    named = {fingertip_link(finger): getattr(wire, "serial", "") for finger, wire in rig.description.wires.items()}
    serials = {device: serial for device, serial in named.items() if serial}
    return check_borrowed({"fingertips": rig.folder / rig.description.calibration}, serials) + found


def _hand_rig(rig: HandRig, move: bool) -> list[Finding]:
    found, serial = check_hand(rig, MonotonicClock(), move=move), rig.description.ethercat.serial
    return check_borrowed(rig.files, {} if serial is None else {HAND_LINK: str(serial)}) + found


def _devices(rig: Rig, seed: int, move: bool) -> list[Finding]:
    watch = StreamWatch()
    try:
        with open_laboratory(_asking_who(rig), seed, next(iter(CATALOGUE))) as laboratory:
            runtime = laboratory.runtime(Recorder(watch), first_move=move)
            names = _names_told(runtime)
            try:
                runtime.connect()
                runtime.run(SETTLE_ns)
                watch.begin()
                before = _cycles_and_losses(runtime)
                runtime.run(LISTEN_ns)
                shares = _shares_lost(before, _cycles_and_losses(runtime))
                return _findings(runtime, watch, names, rig, shares)
            finally:
                runtime.close()
    except DeviceError as error:
        return [Finding(error.where or "rig", False, str(error))]


def _asking_who(rig: Rig) -> Rig:
    """The same rig, which also reads constant data of motors and fingertips, such as firmware and names."""
    hand, files = rig.description.hand, dict(rig.files)
    polling = load_rates(rates) if (rates := files.pop("rates", None)) is not None else hand.polling
    asking = hand.model_copy(update={"polling": ask_once(polling), "tactile_names": True})
    return replace(rig, description=rig.description.model_copy(update={"hand": asking}), files=files)


# --- devices -------------------------------------------------------------------------------------------------------


def _names_told(runtime: RigRuntime) -> TactileNames:
    """Collects what the fingertips send through the palm."""
    names = TactileNames()

    def take(transport: str, sample: Any) -> None:
        if transport == HAND_LINK:
            names.take(sample)

    runtime.observer.interpreter.listener = take
    return names


def _cycles_and_losses(runtime: RigRuntime) -> dict[str, tuple[int, int]]:
    """Cycles so far, and how many of them were lost, of the hand and the positioner where they count."""
    found = {}
    if isinstance(runtime.hand, HandProcess):
        counts = runtime.hand.report()["hand"]
        found[HAND_LINK] = counts["cycles"], counts["lost"]
    elif isinstance(runtime.hand, ShadowHand):
        found[HAND_LINK] = runtime.hand.counters.cycles, runtime.hand.counters.lost
    if isinstance(runtime.base, CountingPositioner):
        found[BASE_LINK] = runtime.base.counters.cycles, runtime.base.counters.lost
    return found


def _shares_lost(before: Mapping[str, tuple[int, int]], after: Mapping[str, tuple[int, int]]) -> dict[str, float]:
    """Of the cycles in between, by transport."""
    return {
        transport: (lost - before[transport][1]) / max(cycles - before[transport][0], 1)
        for transport, (cycles, lost) in after.items()
    }


def _findings(
    runtime: RigRuntime, watch: StreamWatch, names: TactileNames, rig: Rig, shares: Mapping[str, float]
) -> list[Finding]:
    runtime.tare()
    findings = [_hand(runtime, watch, shares.get(HAND_LINK, 0.0)), _base(runtime, watch, shares.get(BASE_LINK, 0.0))]
    findings += [_fingertip(finger, runtime, watch, names, rig) for finger in runtime.perception.form.fingers]
    if runtime.camera is not None:
        findings.append(_camera(runtime, watch))
    return findings


def _hand(runtime: RigRuntime, watch: StreamWatch, share: float) -> Finding:
    figures: Figures = watch.figures(HAND_LINK)
    words, losses, health = [in_words(figures)], tuple[str, ...](), runtime.hand.health()
    if isinstance(runtime.hand, HandProcess):
        report = runtime.hand.report()
        punctual, health = report["punctuality"], tuple(report["health"])
        losses = EthercatCounts(**report["wire"]).problems()
        figures |= {"start_late_p50_us": punctual["median_us"], "start_late_p99_us": punctual["p99_us"]}
        words += [str(runtime.hand.ready), f"starts late by {punctual['p99_us']:.0f} us (99 %)"]
        figures |= {"serial": str(runtime.hand.ready.serial), "palm": runtime.hand.ready.palm}
    elif isinstance(runtime.hand, ShadowHand) and runtime.hand.newest is not None:
        figures["spare_us"] = float(runtime.hand.newest.idle_us)
    figures["lost_share"] = share
    if (warmest_C := runtime.snapshot().warmest_C) is not None:
        figures["warmest_C"] = warmest_C
        words.append(f"warmest motor {warmest_C:.0f} C")
    if revisions := firmware(runtime.observer.interpreter.newest[HAND_LINK].sample):
        figures["firmware"] = revisions
        words.append(f"firmware revision {revisions}")
    words.append(f"{100 * share:.1f} % of cycles lost")
    problems, remarks = told_losses(health, share, losses)
    return told("hand", problems, words + remarks, figures)


def _base(runtime: RigRuntime, watch: StreamWatch, share: float) -> Finding:
    place = ", ".join(f"{value:.3f}" for value in runtime.perception.hand.base_q[:3])
    figures = watch.figures(BASE_LINK)
    problems, remarks = told_losses(_problems(runtime.base), share)
    identity = runtime.base.identity if isinstance(runtime.base, NamedInstrument) else ""
    words = [identity] if identity else []
    return told("base", problems, [*words, f"at {place} m", in_words(figures), *remarks], figures)


def _fingertip(finger: str, runtime: RigRuntime, watch: StreamWatch, names: TactileNames, rig: Rig) -> Finding:
    """A finger without a sensor is allowed, but must be reported."""
    if (tip := runtime.fingertips.get(finger)) is None:
        return Finding(f"fingertip {finger}", True, "none: the fingertip calibration does not name it")
    link, device = fingertip_link(finger), runtime.wrench_devices.get(finger)
    report = rig.description.fingertip_kind.report(tip, names, rig.description.devices.get(link, ""))
    figures, words = dict(report.figures), list(report.words)
    if device is not None:
        identity = device.identity if isinstance(device, NamedInstrument) else ""
        figures = {**watch.figures(link), "identity": identity, **figures}
        words = [identity, in_words(figures), *words]
    problems = (*tip.health(), *report.problems)
    return told(f"fingertip {finger}", problems, [*words[:1], _tare(problems), *words[1:]], figures)


def _tare(problems: Sequence[str]) -> str:
    return "" if "not tared" in problems else "tared"


def _camera(runtime: RigRuntime, watch: StreamWatch) -> Finding:
    assert runtime.camera is not None
    height, width = runtime.picture().image.shape[:2]
    figures: Figures = {"width_px": float(width), "height_px": float(height), **watch.figures(CAMERA_LINK)}
    return told("camera", _problems(runtime.camera), [f"{width} x {height} pixels"], figures)


def _problems(device: object) -> tuple[str, ...]:
    """Problems that a device reports about itself."""
    return device.health() if isinstance(device, WatchedInstrument) else ()
