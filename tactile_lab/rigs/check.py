"""Is a rig fit to work? Connect every device, listen for a moment, and tell what each one says. Nothing moves."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from drivers.ati.force_tip import ForceTip
from drivers.biotac.biotac import BioTac
from drivers.camera.camera import Camera
from drivers.positioner import Positioner
from drivers.shadow.ethercat_link import EthercatCounts
from drivers.shadow.hand import ShadowHand
from drivers.shadow.hand_process import HandProcess
from drivers.shadow.motor_polling import load_rates
from drivers.shadow.tactile_names import TactileNames
from drivers.simulation.objects import CATALOGUE
from sessions.bench import Bench
from sessions.instruments import NamedInstrument
from sessions.interpreter import BASE_LINK, CAMERA_LINK, HAND_LINK, fingertip_link
from sessions.recorder import Recorder
from tactile_lab.clock import MonotonicClock
from tactile_lab.errors import ConfigurationError, DeviceError
from tactile_lab.geometry.contacts import FINGERS
from tactile_lab.rigs.build import check_calibration
from tactile_lab.rigs.check_calibrations import check_borrowed, check_calibrations
from tactile_lab.rigs.check_fingertips import check_fingertips
from tactile_lab.rigs.check_hand import asked_once, check_hand, firmware
from tactile_lab.rigs.check_tactile import biotac_figures, biotac_words, contradictions
from tactile_lab.rigs.description import Rig, load_rig
from tactile_lab.rigs.findings import Finding, told_losses
from tactile_lab.rigs.fingertip_rig import FingertipRig, is_fingertip_rig, load_fingertip_rig
from tactile_lab.rigs.hand_rig import HandRig, is_hand_rig, load_hand_rig
from tactile_lab.rigs.laboratory import open_laboratory
from tactile_lab.rigs.stream_watch import StreamWatch, in_words

LISTEN_ns = 500_000_000
SETTLE_ns = 500_000_000
"""Before that: what is done for the first time takes longer than a cycle."""
_NOISY = 6.0
"""How many times the calibrated noise a still force sensor may show."""

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
    return check_calibrations(rig.files, rig.installation) + _devices(rig, seed, move)


def _refuse_to_move(name: str, move: bool) -> None:
    if move:
        raise ConfigurationError("has no real motors to move", where=name, hint="Leave --move out")


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
            bench = laboratory.bench(Recorder(watch), first_move=move)
            names = _names_told(bench)
            try:
                bench.connect()
                bench.run(SETTLE_ns)
                before = _cycles_and_losses(bench)
                bench.run(LISTEN_ns)
                shares = _shares_lost(before, _cycles_and_losses(bench))
                return _findings(bench, watch, names, rig.description.devices, shares)
            finally:
                bench.close()
    except DeviceError as error:
        return [Finding(error.where or "rig", False, str(error))]


def _asking_who(rig: Rig) -> Rig:
    """The same rig, whose motors and fingertips are also asked for what never changes, such as firmware and names."""
    hand, files = rig.description.hand, dict(rig.files)
    polling = load_rates(rates) if (rates := files.pop("rates", None)) is not None else hand.polling
    asking = hand.model_copy(update={"polling": asked_once(polling), "tactile_names": True})
    return replace(rig, description=rig.description.model_copy(update={"hand": asking}), files=files)


# --- devices -------------------------------------------------------------------------------------------------------


def _names_told(bench: Bench) -> TactileNames:
    """What the fingertips say through the palm from now on."""
    names = TactileNames()

    def take(link: str, sample: Any) -> None:
        if link == HAND_LINK:
            names.take(sample)

    bench.observer.interpreter.listener = take
    return names


def _cycles_and_losses(bench: Bench) -> dict[str, tuple[int, int]]:
    """Cycles so far, and how many of them were lost, of the hand and the positioner where they count."""
    found = {}
    if isinstance(bench.hand, HandProcess):
        counts = bench.hand.report()["hand"]
        found[HAND_LINK] = counts["cycles"], counts["lost"]
    elif isinstance(bench.hand, ShadowHand):
        found[HAND_LINK] = bench.hand.counters.cycles, bench.hand.counters.lost
    if isinstance(bench.base, Positioner):
        found[BASE_LINK] = bench.base.counters.cycles, bench.base.counters.lost
    return found


def _shares_lost(before: Mapping[str, tuple[int, int]], after: Mapping[str, tuple[int, int]]) -> dict[str, float]:
    """Of the cycles in between, by link."""
    return {link: (lost - before[link][1]) / max(cycles - before[link][0], 1) for link, (cycles, lost) in after.items()}


def _findings(
    bench: Bench, watch: StreamWatch, names: TactileNames, serials: Mapping[str, str], shares: Mapping[str, float]
) -> list[Finding]:
    bench.tare()
    findings = [_hand(bench, watch, shares.get(HAND_LINK, 0.0)), _base(bench, watch, shares.get(BASE_LINK, 0.0))]
    for finger in FINGERS:
        if isinstance(tip := bench.fingertips.get(finger), BioTac):
            findings.append(_biotac(tip, names, serials.get(fingertip_link(finger), "")))
        else:
            findings.append(_fingertip(finger, bench, watch))
    if bench.camera is not None:
        findings.append(_camera(bench, watch))
    return findings


def _hand(bench: Bench, watch: StreamWatch, share: float) -> Finding:
    figures: Figures = watch.figures(HAND_LINK)
    words, losses, health = [in_words(figures)], tuple[str, ...](), bench.hand.health()
    if isinstance(bench.hand, HandProcess):
        report = bench.hand.report()
        punctual, health = report["punctuality"], tuple(report["health"])
        losses = EthercatCounts(**report["wire"]).problems()
        figures |= {"start_late_p50_us": punctual["median_us"], "start_late_p99_us": punctual["p99_us"]}
        words += [str(bench.hand.ready), f"starts late by {punctual['p99_us']:.0f} us (99 %)"]
        figures |= {"serial": str(bench.hand.ready.serial), "palm": bench.hand.ready.palm}
    elif isinstance(bench.hand, ShadowHand) and bench.hand.newest is not None:
        figures["spare_us"] = float(bench.hand.newest.idle_us)
    figures["lost_share"] = share
    if (warmest_C := bench.situation().warmest_C) is not None:
        figures["warmest_C"] = warmest_C
        words.append(f"warmest motor {warmest_C:.0f} C")
    if revisions := firmware(bench.observer.interpreter.newest[HAND_LINK].sample):
        figures["firmware"] = revisions
        words.append(f"firmware revision {revisions}")
    words.append(f"{100 * share:.1f} % of cycles lost")
    problems, remarks = told_losses(health, share, losses)
    return _finding("hand", problems, words + remarks, figures)


def _base(bench: Bench, watch: StreamWatch, share: float) -> Finding:
    place = ", ".join(f"{value:.3f}" for value in bench.perception.base_q[:3])
    figures = watch.figures(BASE_LINK)
    problems, remarks = told_losses(_problems(bench.base), share)
    return _finding("base", problems, [f"at {place} m", in_words(figures), *remarks], figures)


def _fingertip(finger: str, bench: Bench, watch: StreamWatch) -> Finding:
    """A finger without a sensor is allowed, but nobody should have to notice it by themselves."""
    if (tip := bench.fingertips.get(finger)) is None:
        return Finding(f"fingertip {finger}", True, "none: the fingertip calibration does not name it")
    figures = watch.figures(fingertip_link(finger))
    device = bench.wrench_devices.get(finger)
    identity = device.identity if isinstance(device, NamedInstrument) else ""
    problems = list(tip.health())
    words = [identity, _tared(problems), in_words(figures)]
    if isinstance(tip, ForceTip):
        figures |= {"identity": identity, **_force(tip)}
        words.append(
            f"{figures['lost']:.0f} lost, noise {figures['noise_mN']:.1f} mN (expected {figures['expected_mN']:.1f}), "
            f"bias {figures['bias_N']:.2f} N"
        )
        if float(figures["noise_mN"]) > _NOISY * float(figures["expected_mN"]):
            problems.append("noisier than its calibration says: is it touched, or is a cable loose?")
    return _finding(f"fingertip {finger}", tuple(problems), words, figures)


def _biotac(tip: BioTac, names: TactileNames, serial: str) -> Finding:
    """A BioTac, whose data come with the hand's."""
    problems = (*tip.health(), *contradictions(names, tip.finger, tip.calibration.electrodes, serial))
    who, figures = names.words(tip.finger), biotac_figures(tip)
    words = [who, _tared(problems), biotac_words(figures)]
    return _finding(f"fingertip {tip.finger}", problems, words, {"identity": who, **figures})


def _tared(problems: Sequence[str]) -> str:
    return "" if "not tared" in problems else "tared"


def _force(tip: ForceTip) -> Figures:
    tare, noise = tip.tare_record, tip.noise
    bias = np.zeros(6) if tare is None else tare.bias
    return {
        "lost": float(tip.sequences.lost),
        "noise_mN": float(1e3 * noise[:3].max()),
        "noise_mNm": float(1e3 * noise[3:].max()),
        "expected_mN": float(1e3 * tip.calibration.force_sigma_N),
        "expected_mNm": float(1e3 * tip.calibration.moment_sigma_Nm),
        "bias_N": float(np.abs(bias[:3]).max()),
        "bias_mNm": float(1e3 * np.abs(bias[3:]).max()),
    }


def _camera(bench: Bench, watch: StreamWatch) -> Finding:
    assert bench.camera is not None
    height, width = bench.picture().image.shape[:2]
    figures: Figures = {"width_px": float(width), "height_px": float(height), **watch.figures(CAMERA_LINK)}
    return _finding("camera", _problems(bench.camera), [f"{width} x {height} pixels"], figures)


def _problems(device: object) -> tuple[str, ...]:
    """What a device that can tell finds wrong with itself."""
    return device.health() if isinstance(device, Positioner | Camera) else ()


def _finding(device: str, problems: tuple[str, ...], words: list[str], figures: Mapping[str, float | str]) -> Finding:
    return Finding(device, not problems, "; ".join([*problems, *(word for word in words if word)]), figures)
